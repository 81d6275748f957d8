// SPDX-License-Identifier: MIT
// What the build needs: compiled and linked once for each set of flags, so that what is missing is told first.
#include <argp.h>
#include <hdf5.h>
#include <jansson.h>
#include <metis.h>
#include <mpi.h>
#include <omp.h>
#include <Random123/philox.h>
#include <xxhash.h>
#include <yaml.h>
#include <zlib.h>

int main(int argc, char **argv)
{
    char text[MPI_MAX_LIBRARY_VERSION_STRING];
    unsigned release[3];
    int length, whole[METIS_NOPTIONS];
    philox4x64_ctr_t counter = {{0}};
    philox4x64_key_t key = {{0}};
    MPI_Get_library_version(text, &length);
    H5get_libversion(&release[0], &release[1], &release[2]);
    METIS_SetDefaultOptions(whole);
    json_decref(json_integer(yaml_get_version_string() != NULL));
    counter = philox4x64(counter, key);
    return argp_parse(NULL, argc, argv, ARGP_NO_EXIT | ARGP_NO_HELP, NULL, NULL) + omp_get_max_threads() +
           (int)XXH3_64bits(&counter, sizeof counter) + (*zlibVersion() == 0);
}
