// SPDX-License-Identifier: MIT
// The ranks of the program: start, end, agreement, and rows in the order of global ids.
//
// Reduction. MPI's own sums of doubles depend on how the ranks are combined, and MPI has no 128-bit integers. So every
// number travels as an item of 32 bytes {kind, two words, bad}, with one operation for all kinds. It combines item by
// item, so that MPI may cut the message anywhere, and sums, maxima and ors of one moment share a message.
#include "bergtow/comm.h"
#include "base/inside.h"

#include <ctype.h>
#include <signal.h>
#include <string.h>
#include <time.h>

#include "base/checksum.h"
#include "base/process.h"

#define ALONE {.mpi = MPI_COMM_NULL, .rank = 0, .size = 1, .ranks_here = 1}
const bt_comm bt_comm_alone = ALONE;
static bt_comm world = ALONE;
static bool running; // between start and end, with MPI
static bool foreign; // the calling program has started MPI, and will end it

enum kind { SUM, MAX, OR };
typedef struct item { uint64_t kind, low, high, bad; } item;

static double as_double(uint64_t u)
{
    double x;
    memcpy(&x, &u, sizeof x);
    return x;
}

static uint64_t as_word(double x)
{
    uint64_t u;
    memcpy(&u, &x, sizeof u);
    return u;
}

// The larger of two; NaN above all, +0 above −0, so that any order of combination gives the same bits.
static double larger(double a, double b)
{
    if (isnan(a) || isnan(b)) return (double)NAN;
    if (a == b) return signbit(a) ? b : a;
    return a > b ? a : b;
}

static void combine(const item *a, item *b, int n)
{
    for (int i = 0; i < n; i++) {
        switch ((enum kind)a[i].kind) {
        case SUM: {
            const uint64_t low = a[i].low + b[i].low;
            b[i].high += a[i].high + (low < b[i].low);
            b[i].low = low;
            break;
        }
        case MAX: b[i].low = as_word(larger(as_double(a[i].low), as_double(b[i].low))); break;
        case OR: b[i].low |= a[i].low; break;
        }
        b[i].bad |= a[i].bad;
    }
}

const bt_comm *bt_comm_world(void) { return &world; }

const char *bt_comm_library(char text[MPI_MAX_LIBRARY_VERSION_STRING])
{
    int length;
    MPI_Get_library_version(text, &length);
    // "Open MPI v4.1.4, package: ...", "MPICH Version:      4.0.2\nMPICH Release date: ...",
    // "Intel(R) MPI Library 2021.9 for ..."
    text[strcspn(text, ",\n")] = 0;
    char *end = text;
    for (const char *p = text; *p; p++) // one blank for any white space
        if (!isspace((unsigned char)*p)) *end++ = *p;
        else if (end > text && end[-1] != ' ') *end++ = ' ';
    *end = 0;
    return text;
}

static void on_mpi_error(MPI_Comm *mpi, int *code, ...)
{
    (void)mpi;
    char text[MPI_MAX_ERROR_STRING] = "unknown error";
    int length;
    MPI_Error_string(*code, text, &length);
    fprintf(stderr, "bergtow: rank %d: MPI: %s; the other ranks end, too; start the run again\n", world.rank, text);
    bt_comm_abort(BT_ERR_NUMERIC);
}

#ifdef __GLIBC__
static void on_leaving(int code, void *unused)
{
    (void)unused;
    if (!running) return;
    if (code == BT_OK || code == BT_ERR_USAGE) bt_comm_end(code);
    else bt_comm_abort(code);
}
static void watch_exits(void) { on_exit(on_leaving, NULL); }
#else // other C libraries do not give the code: a rank that exits without bt_comm_end counts as failed
static void on_leaving(void)
{
    if (running) bt_comm_abort(BT_ERR_NUMERIC);
}
static void watch_exits(void) { atexit(on_leaving); }
#endif

static void count_here(bt_comm *comm)
{
    MPI_Comm node;
    MPI_Comm_split_type(comm->mpi, MPI_COMM_TYPE_SHARED, comm->rank, MPI_INFO_NULL, &node);
    MPI_Comm_size(node, &comm->ranks_here);
    MPI_Comm_free(&node);
}

void bt_comm_split(const bt_comm *comm, int group, bt_comm *part)
{
    *part = bt_comm_alone;
    part->divides = comm->divides;
    if (comm->size == 1) return;
    MPI_Comm_split(comm->mpi, group, comm->rank, &part->mpi); // inherits the error handler
    MPI_Comm_rank(part->mpi, &part->rank);
    MPI_Comm_size(part->mpi, &part->size);
    count_here(part);
}

void bt_comm_split_end(bt_comm *part)
{
    if (part->mpi != MPI_COMM_NULL) MPI_Comm_free(&part->mpi);
    *part = bt_comm_alone;
}

static bool start_mpi(int *argc, char ***argv)
{
    // Threads that MPI starts must leave signals to the main thread, so that METIS can hold SIGTERM back
    // (partition/cut.h).
    sigset_t block, before;
    sigemptyset(&block);
    sigaddset(&block, SIGTERM);
    pthread_sigmask(SIG_BLOCK, &block, &before);
    int provided;
    const bool started = MPI_Init_thread(argc, argv, MPI_THREAD_FUNNELED, &provided) == MPI_SUCCESS;
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    if (!started)
        fprintf(stderr, "bergtow: MPI cannot be started; check the mpirun call, or start bergtow without it\n");
    return started;
}

/// *wanted: is MPI to be started? BERGTOW_MPI decides, or else whether a launcher has started this process.
static bool wants_mpi(const bt_launcher *by, bool *wanted)
{
    const char *said = getenv("BERGTOW_MPI");
    if (!said || !*said) *wanted = by->found;
    else if (!strcmp(said, "yes") || !strcmp(said, "no")) *wanted = said[0] == 'y';
    else return fprintf(stderr, "bergtow: BERGTOW_MPI=%s: give yes or no, or unset it\n", said), false;
    return true;
}

/// *divides: as BERGTOW_DIVIDE says.
static bool wants_division(bool *divides)
{
    const char *said = getenv("BERGTOW_DIVIDE");
    *divides = said && !strcmp(said, "always");
    if (!said || !*said || *divides) return true;
    fprintf(stderr, "bergtow: BERGTOW_DIVIDE=%s: give always, or unset it\n", said);
    return false;
}

/// Does MPI know all processes? Started by another MPI's launcher, each is alone, and all would do the same work.
static bool knows_all(const bt_launcher *by)
{
    int size;
    MPI_Comm_size(MPI_COMM_WORLD, &size);
    if (size > 1 || by->size < 2) return true;
    char mpi[MPI_MAX_LIBRARY_VERSION_STRING];
    if (by->first)
        fprintf(stderr, "bergtow: %d processes were started, but each runs alone: this program was built with %s; "
                "start it with the mpirun of that MPI, or srun with the --mpi it needs (BERGTOW_MPI=no: they work "
                "separately)\n",
                by->size, bt_comm_library(mpi));
    else nanosleep(&(struct timespec){.tv_nsec = 300000000}, NULL); // else the launcher ends rank 0 in mid-message
    MPI_Finalize();
    return false;
}

bt_status bt_comm_start(int *argc, char ***argv)
{
    BT_PLAIN_NUMBERS;
    if (running) return BT_OK;
    if (!wants_division(&world.divides)) return BT_ERR_USAGE;
    int begun = 0;
    MPI_Initialized(&begun);
    if (!begun) {
        const bt_launcher by = bt_launcher_find();
        bool wanted;
        if (!wants_mpi(&by, &wanted)) return BT_ERR_USAGE;
        if (!wanted) return BT_OK;
        if (!start_mpi(argc, argv) || !knows_all(&by)) return BT_ERR_USAGE;
    }
    running = true;
    foreign = begun != 0;
    world.mpi = MPI_COMM_WORLD;
    if (foreign) MPI_Comm_dup(MPI_COMM_WORLD, &world.mpi); // messages and error handler of our own
    MPI_Comm_rank(world.mpi, &world.rank);
    MPI_Comm_size(world.mpi, &world.size);
    MPI_Errhandler handler;
    MPI_Comm_create_errhandler(on_mpi_error, &handler);
    MPI_Comm_set_errhandler(world.mpi, handler);
    MPI_Errhandler_free(&handler);
    count_here(&world);
    world.divides = bt_comm_any(&world, world.divides); // launchers do not pass variables on to other machines
    if (!foreign) watch_exits();
    bt_leave_by(bt_comm_abort);
    return BT_OK;
}

int bt_comm_end(int code)
{
    BT_PLAIN_NUMBERS;
    if (!running) return code;
    // Wait for all: a launcher that sees one rank exit with an error ends the others, in the middle of their messages.
    fflush(NULL);
    bt_comm_rest(&world);
    code = (int)bt_comm_agree(&world, (bt_status)code);
    running = false;
    if (foreign) MPI_Comm_free(&world.mpi);
    else MPI_Finalize();
    world = (bt_comm)ALONE;
    return code;
}

_Noreturn void bt_comm_abort(int code)
{
    fflush(NULL);
    if (running) {
        running = false;
        MPI_Abort(MPI_COMM_WORLD, code);
    }
    _Exit(code);
}

bt_status bt_comm_agree(const bt_comm *comm, bt_status status)
{
    BT_PLAIN_NUMBERS;
    if (comm->size == 1) return status;
    static const bt_status order[] = {BT_OK, BT_ERR_SIGNAL, BT_ERR_USAGE, BT_ERR_CASE, BT_ERR_NUMERIC, BT_ERR_IO};
    enum { N = sizeof order / sizeof *order };
    double worst = N + (double)(uint32_t)status; // a code of the program's own
    for (int i = 0; i < N; i++)
        if (order[i] == status) worst = i;
    bt_comm_reduce(comm, NULL, 0, &worst, 1, NULL, 0);
    return worst < N ? order[(int)worst] : (bt_status)(uint32_t)(worst - N);
}

static int running_sum(int size, const int *counts, int *starts)
{
    int all = 0;
    for (int k = 0; k < size; k++) {
        starts[k] = all;
        all += counts[k];
    }
    return all;
}

static bool has(const bt_errors *err, const char *text)
{
    for (size_t i = 0; i < err->n; i++)
        if (!strcmp(err->text[i], text)) return true;
    return false;
}

static const char *code_of(const bt_errors *err, size_t i) { return err->note[i].code ? err->note[i].code : ""; }

void bt_comm_errors(const bt_comm *comm, bt_errors *err)
{
    BT_PLAIN_NUMBERS;
    if (comm->size == 1) return;
    int n = 0, *counts = NULL, *starts = NULL, all = 0;
    for (size_t i = 0; i < err->n; i++) n += (int)(strlen(code_of(err, i)) + strlen(err->text[i])) + 2;
    char *mine = bt_alloc((size_t)n, 1), *texts = NULL, *end = mine;
    for (size_t i = 0; i < err->n; i++) end = stpcpy(stpcpy(end, code_of(err, i)) + 1, err->text[i]) + 1;
    bt_errors_free(err);
    if (comm->rank == 0) counts = bt_alloc(2 * (size_t)comm->size, sizeof *counts);
    MPI_Gather(&n, 1, MPI_INT, counts, 1, MPI_INT, 0, comm->mpi);
    if (comm->rank == 0) {
        starts = counts + comm->size;
        all = running_sum(comm->size, counts, starts);
        texts = bt_alloc((size_t)all, 1);
    }
    MPI_Gatherv(mine, n, MPI_CHAR, texts, counts, starts, MPI_CHAR, 0, comm->mpi);
    for (int at = 0; at < all;) {
        const char *code = texts + at, *text = code + strlen(code) + 1;
        at = (int)(text - texts) + (int)strlen(text) + 1;
        if (has(err, text)) continue;
        bt_errors_add(err, "%s", text);
        if (*code) bt_errors_code(err, code);
    }
    BT_FREE(mine, texts, counts);
}

void bt_comm_bcast(const bt_comm *comm, void *data, size_t bytes)
{
    if (comm->size == 1) return;
    const size_t most = (size_t)1 << 30; // MPI counts have 31 bits
    for (size_t at = 0; at < bytes; at += most)
        MPI_Bcast((char *)data + at, (int)(bytes - at < most ? bytes - at : most), MPI_BYTE, 0, comm->mpi);
}

bt_status bt_comm_same(const bt_comm *comm, const char *path, const char *text, bt_errors *err)
{
    BT_PLAIN_NUMBERS;
    char mine[BT_CHECKSUM_DIGEST], first[BT_CHECKSUM_DIGEST];
    bt_checksum_digest_text(text, strlen(text), mine);
    memcpy(first, mine, sizeof first);
    bt_comm_bcast(comm, first, sizeof first);
    if (!bt_comm_any(comm, strcmp(mine, first) != 0)) return BT_OK;
    return bt_fail(err, BT_ERR_CASE,
                   "%s: this file, or one that it names, has other contents or another path on some of the %d ranks; "
                   "give all of them the same files at the same place",
                   path, comm->size);
}

bool bt_comm_any(const bt_comm *comm, bool value)
{
    if (comm->size == 1) return value;
    uint64_t any = value;
    bt_comm_reduce(comm, NULL, 0, NULL, 0, &any, 1);
    return any;
}

enum { TESTS = 5000 };

// Blocking MPI calls poll, and occupy the core. Where other programs share the cores, the rank that is waited for then
// stands still while this one polls: of two runs of two ranks each side by side on two cores, both took 7 times as long
// as alone; with this wait 2.3 times. So test TESTS times, for some tenths of a millisecond: most waits within a step
// are shorter (with 1,000 tests a run alone took 1.14 times as long). Then sleep between tests, at last for `longest`
// ns.
static void await(MPI_Request *request, int tests, long longest)
{
    int there = 0;
    for (long pause = 20000; MPI_Test(request, &there, MPI_STATUS_IGNORE), !there;) {
        if (tests-- > 0) continue;
        nanosleep(&(struct timespec){.tv_nsec = pause}, NULL);
        pause = 2 * pause < longest ? 2 * pause : longest;
    }
}

void bt_comm_wait(int n, MPI_Request *request)
{
    for (int i = 0; i < n; i++) await(&request[i], TESTS, 20000);
}

void bt_comm_rest(const bt_comm *comm)
{
    if (comm->size == 1) return;
    MPI_Request all;
    MPI_Ibarrier(comm->mpi, &all);
    await(&all, 0, 10000000);
}

enum { TAG_ITEMS = 90 }; // no other message between two ranks has it (partition/)

/// Send items to a rank, and receive its items, [n] or NULL.
static void exchange(const bt_comm *comm, int rank, const item *out, item *in, int n)
{
    MPI_Request request[2];
    int n_requests = 0;
    const int bytes = n * (int)sizeof *out;
    if (in) MPI_Irecv(in, bytes, MPI_BYTE, rank, TAG_ITEMS, comm->mpi, &request[n_requests++]);
    if (out) MPI_Isend(out, bytes, MPI_BYTE, rank, TAG_ITEMS, comm->mpi, &request[n_requests++]);
    bt_comm_wait(n_requests, request);
}

/// Combine the items of all ranks, in log2(size) exchanges: after each, a rank has those of twice as many ranks. Ranks
/// beyond a power of two give theirs to another rank before, and take the result from it. other: [n], for messages.
/// Rejected: MPI_Allreduce, which polls (see await); MPI_Iallreduce, 2 µs between two ranks of one node, where both
/// others take 0.4 µs.
static void combine_all(const bt_comm *comm, item *items, item *other, int n)
{
    int half = 1;
    while (2 * half <= comm->size) half *= 2;
    const int rank = comm->rank, partner = rank < half ? rank + half : rank - half;
    if (rank >= half) {
        exchange(comm, partner, items, NULL, n);
        exchange(comm, partner, NULL, items, n);
        return;
    }
    if (partner < comm->size) {
        exchange(comm, partner, NULL, other, n);
        combine(other, items, n);
    }
    for (int bit = 1; bit < half; bit *= 2) {
        exchange(comm, rank ^ bit, items, other, n);
        combine(other, items, n);
    }
    if (partner < comm->size) exchange(comm, partner, items, NULL, n);
}

void bt_comm_reduce(const bt_comm *comm, bt_sum *sums, int n_sums, double *maxima, int n_max, uint64_t *ors, int n_ors)
{
    BT_PLAIN_NUMBERS;
    if (comm->size == 1) return;
    enum { FEW = 64 };
    item few[2 * FEW], *items = few;
    const int n = n_sums + n_max + n_ors;
    if (n == 0) return;
    if (n > FEW) items = bt_alloc(2 * (size_t)n, sizeof *items);
    item *p = items;
    for (int i = 0; i < n_sums; i++) *p++ = (item){SUM, (uint64_t)sums[i].v, (uint64_t)(sums[i].v >> 64), sums[i].bad};
    for (int i = 0; i < n_max; i++) *p++ = (item){MAX, as_word(maxima[i]), 0, 0};
    for (int i = 0; i < n_ors; i++) *p++ = (item){OR, ors[i], 0, 0};
    combine_all(comm, items, items + n, n);
    p = items;
    for (int i = 0; i < n_sums; i++, p++)
        sums[i] =
            (bt_sum){.v = (bt_int128)((__extension__(unsigned __int128) p->high) << 64 | p->low), .bad = p->bad != 0};
    for (int i = 0; i < n_max; i++) maxima[i] = as_double(p++->low);
    for (int i = 0; i < n_ors; i++) ors[i] = p++->low;
    if (items != few) free(items);
}

int64_t bt_comm_before(const bt_comm *comm, int64_t value, int64_t *total)
{
    int64_t before = 0, all = value;
    if (comm->size > 1) {
        MPI_Exscan(&value, &before, 1, MPI_INT64_T, MPI_SUM, comm->mpi);
        if (comm->rank == 0) before = 0; // undefined by MPI
        MPI_Allreduce(&value, &all, 1, MPI_INT64_T, MPI_SUM, comm->mpi);
    }
    if (total) *total = all;
    return before;
}

// ---- rows by id ----

// The rank whose block holds an id; empty blocks hold none.
static int rank_of(const int64_t *first, int size, bt_gid gid)
{
    int low = 0, high = size;
    while (high - low > 1) {
        const int middle = (low + high) / 2;
        if (first[middle] <= gid) low = middle;
        else high = middle;
    }
    return low;
}

// Report the ids of a block that are missing, or are held more than once, as "1, 2, 3, ...".
static void name_ids(const unsigned char *count, int64_t from, int64_t n, bool missing, bt_errors *err)
{
    enum { SHOWN = 5 };
    char text[200] = "";
    int64_t found = 0;
    for (int64_t i = 0; i < n; i++) {
        if (missing ? count[i] != 0 : count[i] < 2) continue;
        const size_t used = strlen(text);
        if (found++ < SHOWN)
            snprintf(text + used, sizeof text - used, "%s%lld", used ? ", " : "", (long long)(from + i));
    }
    if (found)
        bt_errors_add(err, "%lld bodies are %s: id %s%s; please report this case", (long long)found,
                      missing ? "held by no rank" : "held by several ranks", text, found > SHOWN ? ", ..." : "");
}

static bt_status put_in_order(int64_t from, int64_t count, int64_t n, const bt_gid *gid, int width, const double *rows,
                              double *block, bt_errors *err)
{
    unsigned char *seen = bt_alloc((size_t)count, 1);
    bool wrong = n != count;
    for (int64_t i = 0; i < n; i++) {
        const int64_t at = gid[i] - from;
        if (at < 0 || at >= count) {
            bt_errors_add(err, "a body has the unknown id %lld; please report this case",
                          (long long)gid[i]);
            wrong = true;
            continue;
        }
        if (seen[at]) wrong = true;
        if (seen[at] < 2) seen[at]++;
        memcpy(block + at * width, rows + i * width, (size_t)width * sizeof *block);
    }
    if (wrong) {
        name_ids(seen, from, count, true, err);
        name_ids(seen, from, count, false, err);
    }
    free(seen);
    return wrong ? BT_ERR_NUMERIC : BT_OK;
}

bt_status bt_comm_rows_by_gid(const bt_comm *comm, const int64_t *first, bt_idx n, const bt_gid *gid, int width,
                              const double *rows, double *block, bt_errors *err)
{
    BT_PLAIN_NUMBERS;
    const int size = comm->size;
    const int64_t from = first[comm->rank], count = first[comm->rank + 1] - from;
    if (size == 1) return put_in_order(from, count, n, gid, width, rows, block, err);

    int *numbers = bt_alloc(5 * (size_t)size, sizeof *numbers);
    int *send = numbers, *send_at = numbers + size, *take = numbers + 2 * size, *take_at = numbers + 3 * size,
        *next = numbers + 4 * size;
    for (bt_idx i = 0; i < n; i++) send[rank_of(first, size, gid[i])]++;
    running_sum(size, send, send_at);
    MPI_Alltoall(send, 1, MPI_INT, take, 1, MPI_INT, comm->mpi);
    const int n_take = running_sum(size, take, take_at);

    bt_gid *gid_out = bt_alloc((size_t)n, sizeof *gid_out), *gid_in = bt_alloc((size_t)n_take, sizeof *gid_in);
    double *out = bt_alloc((size_t)n, (size_t)width * sizeof *out);
    memcpy(next, send_at, (size_t)size * sizeof *next);
    for (bt_idx i = 0; i < n; i++) {
        const int at = next[rank_of(first, size, gid[i])]++;
        gid_out[at] = gid[i];
        memcpy(out + (size_t)at * (size_t)width, rows + (size_t)i * (size_t)width, (size_t)width * sizeof *out);
    }
    MPI_Datatype row;
    MPI_Type_contiguous(width, MPI_DOUBLE, &row);
    MPI_Type_commit(&row);
    double *in = bt_alloc((size_t)n_take, (size_t)width * sizeof *in);
    MPI_Alltoallv(gid_out, send, send_at, MPI_INT64_T, gid_in, take, take_at, MPI_INT64_T, comm->mpi);
    MPI_Alltoallv(out, send, send_at, row, in, take, take_at, row, comm->mpi);
    MPI_Type_free(&row);
    free(out);
    free(gid_out);
    const bt_status status = put_in_order(from, count, n_take, gid_in, width, in, block, err);
    BT_FREE(in, gid_in, numbers);
    return bt_comm_agree(comm, status);
}

double *bt_comm_gather(const bt_comm *comm, int64_t n, int width, const double *rows, int64_t *total)
{
    const size_t bytes = (size_t)width * sizeof *rows;
    double *all = NULL;
    if (comm->size == 1) {
        *total = n;
        all = bt_alloc((size_t)n, bytes);
        if (n > 0) memcpy(all, rows, (size_t)n * bytes);
        return all;
    }
    int mine = (int)n, *counts = NULL, *starts = NULL;
    *total = 0;
    if (comm->rank == 0) counts = bt_alloc(2 * (size_t)comm->size, sizeof *counts);
    MPI_Gather(&mine, 1, MPI_INT, counts, 1, MPI_INT, 0, comm->mpi);
    if (comm->rank == 0) {
        starts = counts + comm->size;
        *total = running_sum(comm->size, counts, starts);
        all = bt_alloc((size_t)*total, bytes);
    }
    MPI_Datatype row;
    MPI_Type_contiguous(width, MPI_DOUBLE, &row);
    MPI_Type_commit(&row);
    MPI_Gatherv(rows, mine, row, all, counts, starts, row, 0, comm->mpi);
    MPI_Type_free(&row);
    free(counts);
    return all;
}
