# SPDX-License-Identifier: MIT
"""Recipe for Spack, of a checkout:

    spack repo add install/spack
    spack dev-build --source-path "$PWD" bergtow@main
"""
from spack.package import (Executable, MakefilePackage, depends_on, license, on_package_attributes, run_after,
                           version)


class Bergtow(MakefilePackage):
    """Resistance that broken ice gives to a towed iceberg: planar non-smooth discrete elements, with the same bits on
    any number of threads and MPI ranks."""

    license("MIT")

    version("main")

    depends_on("c", type="build")
    depends_on("gmake", type="build")
    depends_on("pkgconfig", type="build")
    depends_on("python@3.10:", type=("build", "run"))
    depends_on("mpi@3:")
    depends_on("hdf5@1.10:")
    depends_on("metis@5:")
    depends_on("libyaml")
    depends_on("jansson")
    depends_on("random123")
    depends_on("xxhash")
    for package in ("numpy", "h5py", "matplotlib", "jinja2", "pyyaml", "scipy"):
        depends_on(f"py-{package}", type="run")

    @property
    def made_with(self):
        """Variables of the Makefile: Spack's compiler wrapper knows where the libraries are."""
        return [
            f"CC={self.module.spack_cc}",
            f"MPICC={self.spec['mpi'].mpicc}",
            f"HDF5_CFLAGS={self.spec['hdf5'].headers.include_flags}",
            f"HDF5_LIBS={self.spec['hdf5:c'].libs.ld_flags}",
            # the wrapper adds -march where the Makefile does not see it: no fused operations, the same bits
            "EXTRA_CFLAGS=-fno-tree-vectorize",
            f"PYTHON={self.spec['python'].command.path}",
        ]

    def build(self, spec, prefix):
        self.module.make("all", *self.made_with)

    def install(self, spec, prefix):
        self.module.make("install", f"PREFIX={prefix}", *self.made_with)

    @run_after("install")
    @on_package_attributes(run_tests=True)
    def check_install(self):
        Executable(self.prefix.bin.bergtow)("--version")
