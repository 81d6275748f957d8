// SPDX-License-Identifier: MIT
#include "domain.h"
void bt_domain_free(bt_domain *d) { (void)d; }
bool bt_domain_owns_tile(const bt_world *w, int32_t x, int32_t y) { (void)w, (void)x, (void)y; return true; }
bool bt_domain_owns_large(const bt_world *w) { (void)w; return true; }
bool bt_domain_owns(const bt_world *w, bt_idx i) { (void)w, (void)i; return true; }
void bt_domain_maxima(const bt_world *w, double *x, int n) { (void)w, (void)x, (void)n; }
void bt_domain_reduce(const bt_world *w, bt_totals *t) { (void)w, (void)t; }
uint64_t bt_domain_sum_words(const bt_world *w, uint64_t x) { (void)w; return x; }
bool bt_domain_due(const bt_world *w) { (void)w; return false; }
bt_trace *bt_domain_migrate(bt_world *w, bt_trace *trace, int64_t *n) { (void)w, (void)n; return trace; }
void bt_domain_connect(bt_world *w) { (void)w; }
void bt_domain_share_speeds(bt_world *w) { (void)w; }
void bt_domain_select(bt_world *w) { (void)w; }
void bt_domain_send(bt_world *w, int phase, bt_vel *v) { (void)w, (void)phase, (void)v; }
void bt_domain_receive(bt_world *w, int phase, bt_vel *v) { (void)w, (void)phase, (void)v; }
void bt_domain_settle(bt_world *w) { (void)w; }
void bt_domain_largest(const bt_world *w, double *x) { (void)w, (void)x; }
void bt_domain_join_names(const bt_world *w, bt_gid *name) { (void)w, (void)name; }
void bt_domain_add_by_name(const bt_world *w, const bt_idx *root, const bt_gid *name, bt_sum *sum) { (void)w, (void)root, (void)name, (void)sum; }
