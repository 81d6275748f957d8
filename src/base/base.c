// SPDX-License-Identifier: MIT
// Messages, memory and the clock.
#include "bergtow/base.h"
#include "base/inside.h"

#include <locale.h>
#include <string.h>
#include <time.h>

static void (*on_out_of_memory)(const char *message, void *user);
static void *on_out_of_memory_user;
static void (*leave)(int code) = _Exit;

void bt_on_out_of_memory(void (*report)(const char *message, void *user), void *user)
{
    on_out_of_memory = report;
    on_out_of_memory_user = user;
}

void bt_leave_by(void (*by)(int code)) { leave = by; }

// Not exit(): it makes HDF5 close its files, and HDF5 itself may be what asked for the memory.
static _Noreturn void out_of_memory(size_t n, size_t size)
{
    char text[160];
    snprintf(text, sizeof text, "out of memory: %zu items of %zu bytes; use fewer floes or a larger machine", n, size);
    if (on_out_of_memory) on_out_of_memory(text, on_out_of_memory_user);
    else fprintf(stderr, "bergtow: %s\n", text);
    leave(BT_ERR_NUMERIC);
    _Exit(BT_ERR_NUMERIC);
}

static size_t bytes_of(size_t n, size_t size)
{
    size_t total;
    if (__builtin_mul_overflow(n, size, &total) || total > PTRDIFF_MAX - 64) out_of_memory(n, size);
    return total ? total : 1;
}

void *bt_alloc(size_t n, size_t size)
{
    bytes_of(n, size);
    void *p = calloc(n ? n : 1, size ? size : 1);
    if (!p) out_of_memory(n, size);
    return p;
}

void *bt_realloc(void *p, size_t n, size_t size)
{
    void *q = realloc(p, bytes_of(n, size));
    if (!q) out_of_memory(n, size);
    return q;
}

void *bt_alloc_unset(size_t n, size_t size)
{
    void *p = aligned_alloc(64, (bytes_of(n, size) + 63) & ~(size_t)63);
    if (!p) out_of_memory(n, size);
    return p;
}

void *bt_alloc_aligned(size_t n, size_t size) { return memset(bt_alloc_unset(n, size), 0, bytes_of(n, size)); }

/// Let this thread write and read numbers with a decimal point. Returns its locale before.
static locale_t use_point(void)
{
    static locale_t locale; // a race here makes two equal locales and leaks one
    if (!locale) locale = newlocale(LC_ALL_MASK, "C", (locale_t)0);
    return uselocale(locale);
}

// Of the control words, since fegetenv takes a tenth of a microsecond, and fegetround neither sees the SSE unit of x86
// nor subnormal numbers that are flushed.
static bool is_default_environment(void)
{
#if defined(__x86_64__)
    enum { SSE = 0xFFC0, SSE_DEFAULT = 0x1F80, X87 = 0x0F3F, X87_DEFAULT = 0x033F }; // all but flags of the past
    uint16_t x87;
    __asm__ volatile("fnstcw %0" : "=m"(x87));
    return (__builtin_ia32_stmxcsr() & SSE) == SSE_DEFAULT && (x87 & X87) == X87_DEFAULT;
#elif defined(__aarch64__)
    uint64_t control;
    __asm__ volatile("mrs %0, fpcr" : "=r"(control));
    return control == 0;
#else
    return fegetround() == FE_TONEAREST;
#endif
}

bt_numbers bt_numbers_plain(void)
{
    bt_numbers before = {.locale = use_point(), .changed = !is_default_environment()};
    if (before.changed) {
        fegetenv(&before.environment);
        fesetenv(FE_DFL_ENV);
    }
    return before;
}

void bt_numbers_restore(const bt_numbers *before)
{
    if (before->changed) fesetenv(&before->environment);
    uselocale(before->locale);
}

void bt_text_begin(bt_text *text)
{
    *text = (bt_text){.locale = use_point()};
    text->out = open_memstream(&text->text, &text->size);
    if (!text->out) out_of_memory(1, BUFSIZ);
}

char *bt_text_end(bt_text *text)
{
    uselocale(text->locale);
    const bool lost = ferror(text->out) != 0;
    if (fclose(text->out) != 0 || lost) out_of_memory(1, text->size);
    return text->text;
}

char *bt_text_copy(const char *text)
{
    const size_t n = strlen(text) + 1;
    return memcpy(bt_alloc(n, 1), text, n);
}

static char *text_of(const char *fmt, va_list ap)
{
    char *text = NULL;
    const int n = vasprintf(&text, fmt, ap);
    if (n < 0) out_of_memory(1, strlen(fmt));
    return text;
}

char *bt_text_of(const char *fmt, ...)
{
    BT_PLAIN_NUMBERS;
    va_list ap;
    va_start(ap, fmt);
    char *text = text_of(fmt, ap);
    va_end(ap);
    return text;
}

void bt_errors_add(bt_errors *err, const char *fmt, ...)
{
    BT_PLAIN_NUMBERS;
    va_list ap;
    va_start(ap, fmt);
    bt_errors_add_list(err, fmt, ap);
    va_end(ap);
}

bt_status bt_fail(bt_errors *err, bt_status status, const char *fmt, ...)
{
    BT_PLAIN_NUMBERS;
    va_list ap;
    va_start(ap, fmt);
    bt_errors_add_list(err, fmt, ap);
    va_end(ap);
    return status;
}

void bt_errors_add_list(bt_errors *err, const char *fmt, va_list args)
{
    BT_PLAIN_NUMBERS;
    if (!err) return;
    if (err->n == err->cap) {
        err->cap = err->cap ? 2 * err->cap : 8;
        err->text = bt_realloc(err->text, err->cap, sizeof *err->text);
        err->note = bt_realloc(err->note, err->cap, sizeof *err->note);
    }
    char *text = text_of(fmt, args);
    // Messages quote texts of an input: control characters, which could steer a terminal or split a line, become
    // question marks.
    for (char *s = text; *s; s++)
        if ((unsigned char)*s < 0x20 || *s == 0x7F) *s = '?';
    err->note[err->n] = (bt_note){0};
    err->text[err->n++] = text;
}

void bt_errors_code(bt_errors *err, const char *code)
{
    if (err && err->n > 0) err->note[err->n - 1].code = bt_text_copy(code);
}

void bt_errors_move(bt_errors *to, bt_errors *from)
{
    for (size_t i = 0; to && i < from->n; i++) {
        bt_errors_add(to, "%s", from->text[i]);
        to->note[to->n - 1] = from->note[i];
        from->note[i] = (bt_note){0};
    }
    bt_errors_free(from);
}

void bt_errors_free(bt_errors *err)
{
    for (size_t i = 0; i < err->n; i++)
        BT_FREE(err->text[i], err->note[i].code, err->note[i].values);
    free(err->text);
    free(err->note);
    *err = (bt_errors){0};
}

double bt_clock(void)
{
    BT_PLAIN_NUMBERS;
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}
