# SPDX-License-Identifier: MIT
"""Recipe for Spack 1.0 or later, of a checkout:

    spack repo add install/spack/spack_repo/bergtow
    spack dev-build --source-path "$PWD" bergtow@main
"""
from spack_repo.builtin.build_systems.makefile import MakefilePackage

from spack.package import Executable, depends_on, license, version


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
    depends_on("hdf5@1.10: +hl")
    depends_on("metis@5:")
    depends_on("libyaml")
    depends_on("jansson")
    depends_on("random123")
    depends_on("xxhash@0.8:")
    depends_on("zlib-api")
    for package in ("numpy", "h5py", "matplotlib", "jinja2", "pyyaml", "scipy"):
        depends_on(f"py-{package}", type="run")

    @property
    def made_with(self):
        """Variables of the Makefile: Spack's compiler wrapper knows where the libraries are."""
        return [
            f"CC={self.module.spack_cc}",
            f"MPICC={self.spec['mpi'].mpicc}",
            f"HDF5_CFLAGS={self.spec['hdf5'].headers.include_flags}",
            f"HDF5_LIBS={self.spec['hdf5:hl'].libs.ld_flags}",
            # the wrapper adds -march where the Makefile does not see it: no fused operations, the same bits
            "EXTRA_CFLAGS=-fno-tree-vectorize",
            f"PYTHON={self.spec['python'].command.path}",
        ]

    @property
    def build_targets(self):
        return ["all", "lib", *self.made_with]

    @property
    def install_targets(self):
        return ["install", f"PREFIX={self.prefix}", *self.made_with]

    def check(self):
        """Not `make test`, which would install Debian's packages."""

    def installcheck(self):
        Executable(self.prefix.bin.bergtow)("run", "cases/basin/basin-20.yml", "--steps", "10", "-o", "out/check",
                                            "--force")

    def setup_run_environment(self, env):
        env.set("PYTHON", self.spec["python"].command.path)
        env.prepend_path("PYTHONPATH", self.prefix.share.bergtow.postproc)
