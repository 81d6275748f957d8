// SPDX-License-Identifier: MIT
// Ranks: sums, agreement, messages and rows by id, on one rank here and on several under mpirun.
//
//     test_comm                 the tests; the second half starts mpirun -n R test_comm ranks
//     test_comm ranks           what each rank checks
#include "test.h"
#include "bergtow/comm.h"

static const char *self = "test_comm";

#define CHECK(x)                                                                             \
    do {                                                                                     \
        if (!(x)) {                                                                          \
            fprintf(stderr, "rank %d, line %d: %s\n", bt_comm_world()->rank, __LINE__, #x); \
            bt_comm_abort(1);                                                                \
        }                                                                                    \
    } while (0)

// Terms that a plain sum of doubles adds to different values in different orders; negative ones carry between the
// words.
static double term(int i) { return (i % 3 == 0 ? -1 : 1) * 1e15 / (7.0 + i) + 1e-9 * i - (i % 7 == 0 ? 3e14 : 0); }

static void reduce(const bt_comm *c)
{
    enum { TERMS = 1000, MANY = 100 };
    bt_sum all[MANY], mine[MANY];
    for (int k = 0; k < MANY; k++) { // more numbers than the fixed buffer holds
        all[k] = mine[k] = (bt_sum){0};
        for (int i = 0; i < TERMS; i++) {
            bt_sum_add(&all[k], term(i + k));
            if ((i * 7 + k) % c->size == c->rank) bt_sum_add(&mine[k], term(i + k));
        }
    }
    double top[4] = {-5.0 - c->rank, c->rank == c->size - 1 ? (double)NAN : 1.0, c->rank == 0 ? 0.0 : -0.0,
                     c->rank ? 1.0 : (double)NAN};
    uint64_t bits[2] = {(uint64_t)1 << c->rank, (uint64_t)1 << 63};
    bt_comm_reduce(c, mine, MANY, top, 4, bits, 2);
    for (int k = 0; k < MANY; k++) CHECK(mine[k].v == all[k].v && !mine[k].bad);
    CHECK(top[0] == -5 && isnan(top[1]) && top[2] == 0 && !signbit(top[2]) && isnan(top[3]));
    CHECK(bits[0] == ((uint64_t)1 << c->size) - 1 && bits[1] == (uint64_t)1 << 63);

    bt_sum bad = {0};
    bt_sum_add(&bad, c->rank == c->size - 1 ? INFINITY : 1);
    bt_comm_reduce(c, &bad, 1, NULL, 0, NULL, 0);
    CHECK(bad.bad);
    bt_comm_reduce(c, NULL, 0, NULL, 0, NULL, 0);
}

static void agreement(const bt_comm *c)
{
    const bool last = c->rank == c->size - 1;
    CHECK(bt_comm_agree(c, BT_OK) == BT_OK);
    CHECK(bt_comm_agree(c, last ? BT_ERR_SIGNAL : BT_OK) == BT_ERR_SIGNAL);
    CHECK(bt_comm_agree(c, last ? BT_ERR_IO : c->rank ? BT_ERR_NUMERIC : BT_ERR_SIGNAL) == BT_ERR_IO);
    CHECK((int)bt_comm_agree(c, last ? (bt_status)-3 : c->rank ? (bt_status)1 : BT_ERR_IO) == -3);
    if (c->size > 1) CHECK(bt_comm_agree(c, last ? BT_ERR_NUMERIC : BT_ERR_CASE) == BT_ERR_NUMERIC);
    CHECK(!bt_comm_any(c, false) && bt_comm_any(c, last));
    bt_comm_rest(c);
    int64_t total, before = bt_comm_before(c, 10 + c->rank, &total), wanted = 0;
    for (int k = 0; k < c->rank; k++) wanted += 10 + k;
    CHECK(before == wanted);
    for (int k = c->rank; k < c->size; k++) wanted += 10 + k;
    CHECK(total == wanted);

    char text[40] = "not yet";
    if (c->rank == 0) strcpy(text, "from rank 0");
    bt_comm_bcast(c, text, sizeof text);
    CHECK(!strcmp(text, "from rank 0"));

    bt_errors err = {0};
    bt_errors_add(&err, "the same everywhere");
    if (c->rank) bt_errors_add(&err, "only on rank %d", c->rank);
    bt_comm_errors(c, &err);
    if (c->rank) {
        CHECK(err.n == 0);
    } else {
        CHECK(err.n == (size_t)c->size && !strcmp(err.text[0], "the same everywhere"));
        for (int k = 1; k < c->size; k++) CHECK(err.text[k][13] == '0' + k);
    }
    bt_errors_free(&err);
}

// Ids are assigned by a hash; `change`: 0 = as it should be, 1 = nobody gives id 5, 2 = all ranks do, 3 = an id too
// large, 4 = id 6 goes as another id 5, so that the number of rows is right.
static bt_status exchange(const bt_comm *c, int64_t n, int change, bt_errors *err)
{
    enum { MOST = 1000, WIDTH = 3 };
    int64_t first[20];
    for (int k = 0; k <= c->size; k++) first[k] = bt_comm_first(c, k, n);
    bt_gid gid[MOST];
    double rows[MOST][WIDTH], block[MOST][WIDTH] = {{0}};
    bt_idx m = 0;
    for (bt_gid g = n; g-- > 0;) {
        const bool mine = (g * 2654435761u >> 7) % (unsigned)c->size == (unsigned)c->rank;
        if (!(g == 5 && change && change < 3 ? change == 2 : mine)) continue;
        gid[m] = change == 4 && g == 6 ? 5 : g;
        for (int k = 0; k < WIDTH; k++) rows[m][k] = 10.0 * (double)g + k;
        m++;
    }
    if (change == 3 && c->rank == 0) gid[m] = n + 7, rows[m][0] = 0, m++;
    const bt_status status = bt_comm_rows_by_gid(c, first, m, gid, WIDTH, &rows[0][0], &block[0][0], err);
    if (change == 0)
        for (int64_t i = 0; i < first[c->rank + 1] - first[c->rank]; i++)
            for (int k = 0; k < WIDTH; k++) CHECK(block[i][k] == 10.0 * (double)(first[c->rank] + i) + k);
    return status;
}

static void rows(const bt_comm *c)
{
    bt_errors err = {0};
    const int64_t sizes[] = {0, 1, 2, 3, 5, 100, 997}; // with empty blocks
    for (size_t k = 0; k < sizeof sizes / sizeof *sizes; k++)
        CHECK(exchange(c, sizes[k], 0, &err) == BT_OK && err.n == 0);
    const char *const said[] = {NULL, "no rank: id 5;", "several ranks: id 5;", "id 107", "several ranks: id 5;"};
    for (int change = 1; change <= 4; change++) {
        if (c->size == 1 && change == 2) continue;
        CHECK(exchange(c, 100, change, &err) == BT_ERR_NUMERIC); // on all ranks
        bt_comm_errors(c, &err);
        if (c->rank == 0) {
            bool found = false;
            for (size_t i = 0; i < err.n; i++) found |= strstr(err.text[i], said[change]) != NULL;
            CHECK(found);
        }
        bt_errors_free(&err);
    }
    for (int k = 0; k < c->size; k++)
        CHECK(bt_comm_first(c, k, INT64_C(1) << 61) <= bt_comm_first(c, k + 1, INT64_C(1) << 61));
}

static int all_checks(void)
{
    const bt_comm *c = bt_comm_world();
    reduce(c);
    agreement(c);
    rows(c);
    return BT_OK;
}

TEST(one_rank_needs_no_mpi)
{
    unsetenv("OMPI_COMM_WORLD_SIZE");
    unsetenv("PMIX_RANK");
    bt_comm_start(NULL, NULL);
    int initialised;
    MPI_Initialized(&initialised);
    assert_false(initialised);
    assert_int_equal(bt_comm_world()->size, 1);
    assert_int_equal(all_checks(), BT_OK);
    assert_int_equal(bt_comm_end(BT_ERR_CASE), BT_ERR_CASE);
}

// Exit code of mpirun -n ranks self word. Leak checkers see what Open MPI never frees.
static int mpirun(int ranks, const char *word)
{
    char command[600];
    const char *said = getenv("MPIRUN"); // as tests/harness.py
    snprintf(command, sizeof command,
             "OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 ASAN_OPTIONS=detect_leaks=0 "
             "timeout 60 %s -n %d %s %s >%s.log 2>&1", said ? said : "mpirun --oversubscribe", ranks, self, word, self);
    const int status = system(command);
    return WEXITSTATUS(status);
}

TEST(several_ranks)
{
    for (int ranks = 1; ranks <= 4; ranks++) {
        const int code = mpirun(ranks, "ranks");
        if (code) fail_msg("%d ranks: code %d, see %s.log", ranks, code, self);
    }
}

TEST(all_ranks_leave_with_the_worst_code)
{
    assert_int_equal(mpirun(3, "worst"), BT_ERR_IO);
    assert_int_equal(mpirun(2, "own"), EXIT_FAILURE);
    assert_int_equal(mpirun(2, "alone"), BT_ERR_NUMERIC); // the other waits for ever
    assert_int_equal(mpirun(2, "usage"), BT_ERR_USAGE);
}

int main(int argc, char **argv)
{
    self = argv[0];
    if (argc == 2) {
        bt_comm_start(&argc, &argv);
        const bt_comm *c = bt_comm_world();
        int code = BT_OK;
        if (!strcmp(argv[1], "ranks")) code = all_checks();
        else if (!strcmp(argv[1], "worst")) code = c->rank == 1 ? BT_ERR_IO : c->rank ? BT_ERR_CASE : BT_OK;
        else if (!strcmp(argv[1], "own")) code = c->rank == 1 ? EXIT_FAILURE : BT_OK;
        else if (!strcmp(argv[1], "usage")) exit(BT_ERR_USAGE);
        else if (c->rank == 1) exit(BT_ERR_NUMERIC);
        else bt_comm_rest(c);
        return bt_comm_end(code);
    }
    return run_all_tests(NULL, NULL);
}
