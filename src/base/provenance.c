// SPDX-License-Identifier: MIT
// Where a file comes from: version, build, machine, command and time, as attributes of its root.
#include "base/provenance.h"

#include <omp.h>
#include <stdio.h>
#include <time.h>
#include <unistd.h>

#include "revision.h"

const char *bt_provenance_revision(void) { return BT_REVISION; }

void bt_provenance_write(bt_h5 *h, const char *command_line)
{
    char host[256] = "unknown", mpi[MPI_MAX_LIBRARY_VERSION_STRING], text[sizeof mpi + 60];
    if (gethostname(host, sizeof host - 1) != 0) snprintf(host, sizeof host, "unknown");

    const time_t now = time(NULL);
    struct tm utc;
    char start[40] = "unknown";
    if (gmtime_r(&now, &utc)) strftime(start, sizeof start, "%Y-%m-%dT%H:%M:%SZ", &utc);

    unsigned major = 0, minor = 0, release = 0;
    H5get_libversion(&major, &minor, &release);
    snprintf(text, sizeof text, "HDF5 %u.%u.%u, %s", major, minor, release, bt_comm_library(mpi));

    bt_h5_attr_text(h, "/", "program", "bergtow");
    bt_h5_attr_text(h, "/", "version", BT_VERSION);
    bt_h5_attr_text(h, "/", "revision", BT_REVISION);
    bt_h5_attr_text(h, "/", "compiler", BT_COMPILER);
    bt_h5_attr_text(h, "/", "flags", BT_FLAGS);
    bt_h5_attr_text(h, "/", "libraries", text);
    bt_h5_attr_text(h, "/", "command_line", command_line ? command_line : "");
    bt_h5_attr_text(h, "/", "host", host);
    bt_h5_attr_text(h, "/", "start_time", start);
    bt_h5_attr_int(h, "/", "ranks", bt_comm_world()->size);
    bt_h5_attr_int(h, "/", "threads", omp_get_max_threads());
}
