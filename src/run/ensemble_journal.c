// SPDX-License-Identifier: MIT
// The journal of an ensemble; reasons in bergtow/ensemble.h.
#include "run/ensemble_journal.h"

#include <fcntl.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "run/ensemble_member.h"

#define JOURNAL "journal.jsonl"

void bt_journal_add(const char *dir, const char *event, const char *member, double wall, int code)
{
    struct timespec now;
    clock_gettime(CLOCK_REALTIME, &now);
    char line[256], took[32] = "null";
    if (isfinite(wall)) snprintf(took, sizeof took, "%.3f", wall);
    const int n = snprintf(line, sizeof line,
                           "{\"time\": %.3f, \"event\": \"%s\", \"member\": \"%s\", \"pid\": %ld, \"wall_time_s\": "
                           "%s, \"exit_code\": %d}\n",
                           (double)now.tv_sec + 1e-9 * (double)now.tv_nsec, event, member, (long)getpid(), took, code);
    const int fd = bt_member_open(dir, JOURNAL, O_WRONLY | O_CREAT | O_APPEND);
    if (fd < 0) return;
    if (write(fd, line, (size_t)n) == n) fsync(fd);
    close(fd);
}

void bt_journal_strike_ended(const char *dir, int64_t repeats, int64_t n, bool *lacking)
{
    bool *ended = bt_alloc((size_t)n, sizeof *ended);
    // Line by line: a journal may be longer than the texts that bt_file_read takes.
    const int fd = bt_member_open(dir, JOURNAL, O_RDONLY);
    FILE *f = fd < 0 ? NULL : fdopen(fd, "r");
    char *line = NULL;
    size_t room = 0;
    while (f && getline(&line, &room, f) > 0) {
        int64_t condition, repeat;
        const char *name = strstr(line, "\"member\": \"c");
        if (!name || sscanf(name, "\"member\": \"c%" SCNd64 "-r%" SCNd64, &condition, &repeat) != 2) continue;
        const int64_t i = (condition - 1) * repeats + repeat - 1;
        // with fewer repeats than before there are lines of members that are no longer asked for
        if (i >= 0 && i < n && repeat >= 1 && repeat <= repeats)
            ended[i] = strstr(line, "\"event\": \"finished\"") != NULL;
    }
    const bool whole = f && !ferror(f); // what cannot be read may say anything
    for (int64_t i = 0; i < n; i++) lacking[i] = lacking[i] && whole && !ended[i];
    free(line);
    free(ended);
    if (f) fclose(f);
    else if (fd >= 0) close(fd);
}
