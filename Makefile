# SPDX-License-Identifier: MIT
# bergtow: `make help` lists what there is.

CONFIG ?= release
BUILD  := build/$(CONFIG)
PYTHON ?= /usr/bin/python3
PREFIX ?= /usr/local
J      ?= $(shell nproc 2>/dev/null || echo 2)

ifneq ($(filter $(CONFIG),fuzz tsan),)
CC     := clang-14
endif
CC     := $(if $(filter default undefined,$(origin CC)),gcc,$(CC))
# MPI is that of $(MPICC), whichever it is, or without one what pkg-config knows. HDF5 is the one without MPI, for its
# parallel driver is not used; or one of the same MPI, since its headers include mpi.h. To choose: make
# MPICC=mpicc.mpich HDF5=hdf5-mpich, or all four variables of flags by hand (docs/install.md).
# MPI=no builds a program of one process.
MPICC    ?= mpicc
known     = $(firstword $(foreach package,$(1),$(shell pkg-config --exists $(package) 2>/dev/null && echo $(package))))
flags     = $(if $(2),$(shell pkg-config $(1) $(2)))
MPI_SHOWN  := $(wordlist 2,99,$(shell $(MPICC) -show 2>/dev/null))
MPI_PKG    := $(if $(MPI_SHOWN),,$(call known,ompi-c mpich mpi-c))
MPI_CFLAGS := $(filter -I% -D%,$(MPI_SHOWN)) $(call flags,--cflags,$(MPI_PKG))
MPI_LIBS   := $(filter-out -I% -D% -O% -f%,$(MPI_SHOWN)) $(call flags,--libs,$(MPI_PKG))
ifeq ($(MPI),no)
MPI_CFLAGS := -Iinstall/alone
MPI_LIBS   :=
endif
HDF5       ?= $(call known,hdf5-serial $(if $(findstring mpich,$(MPI_LIBS)),hdf5-mpich) \
                $(if $(findstring openmpi,$(MPI_CFLAGS)),hdf5-openmpi) hdf5)
HDF5       := $(HDF5)
HDF5_CFLAGS := $(call flags,--cflags,$(HDF5))
HDF5_LIBS   := $(or $(call flags,--libs,$(HDF5)),-lhdf5)
# its part for dimension scales
HDF5_HL     := $(filter -L%,$(HDF5_LIBS)) -lhdf5_hl

# -ffp-contract=off and never -ffast-math: every build of one compiler gives the same bits, on any processor. For the
# same reason the target is the plain x86-64 (or ARM); only functions with BT_FOR_EACH_CPU (src/base/inside.h),
# where the time goes, are also compiled for AVX2.
# -fPIC: the program and the shared library are made of the same objects; without interposition it costs no instruction.
# -Wno-psabi: how vectors of four are passed to functions does not matter, as all of those are inlined.
BASE   := -std=c17 -D_GNU_SOURCE -fopenmp -Iinclude -Isrc -I. -MMD -MP -ffp-contract=off -fno-math-errno \
          -fPIC -fno-semantic-interposition \
          -Wall -Wextra -Wpedantic -Wshadow -Wno-psabi $(MPI_CFLAGS) $(HDF5_CFLAGS)
ifeq ($(CI),true)
BASE   += -Werror
endif
OPT_release := -O3 -g -DNDEBUG
OPT_debug   := -O1 -g3
OPT_validate := -O2 -g -DBT_VALIDATE
# BT_VALIDATE: checks of the division among ranks, and every loop that may run in parallel does.
OPT_asan    := -O1 -g1 -DBT_VALIDATE -fsanitize=address,undefined,float-cast-overflow \
               -fno-sanitize-recover=undefined,float-cast-overflow
OPT_fuzz    := -O1 -g -Wno-pass-failed -fsanitize=fuzzer-no-link,address,undefined,float-cast-overflow \
               -fno-sanitize-recover=undefined,float-cast-overflow
# The thread sanitizer does not know gcc's libgomp, hence clang.
OPT_tsan    := -O1 -g -fsanitize=thread -DBT_VALIDATE -Wno-pass-failed
OPT_coverage := -O1 -g --coverage -fprofile-abs-path -fprofile-update=atomic
ifeq ($(filter $(CONFIG),release debug validate asan fuzz tsan coverage),)
$(error CONFIG=$(CONFIG) is unknown: use release, debug, validate, asan, fuzz, tsan or coverage)
endif
# Where a -march allows fused operations, the vectorizers of gcc 12 make vfmaddsub, with one rounding, of products and
# what they take for addsub, whatever -ffp-contract says; gcc 14 does not.
FUSES := $(shell $(CC) $(EXTRA_CFLAGS) -dM -E -x c /dev/null 2>/dev/null | grep -cE '__(FMA|AVX512F)__')
CFLAGS := $(BASE) $(OPT_$(CONFIG)) $(EXTRA_CFLAGS) $(if $(filter-out 0,$(FUSES)),-fno-tree-vectorize)
# argp is part of glibc, and a library of its own elsewhere.
ARGP_LIBS := $(if $(wildcard $(addsuffix /libargp.*,/usr/lib /usr/local/lib)),-largp)
LDLIBS := $(HDF5_HL) $(HDF5_LIBS) $(MPI_LIBS) $(ARGP_LIBS) -lyaml -ljansson -lmetis -lxxhash -lz -lm

REVISION := $(shell git describe --always --dirty 2>/dev/null || echo unknown)

BIN_SRC := $(wildcard src/app/*.c)
LIB_SRC := $(filter-out $(BIN_SRC),$(wildcard src/*/*.c partition/*.c))
LIB_OBJ := $(LIB_SRC:%.c=$(BUILD)/%.o)
BIN_OBJ := $(BIN_SRC:%.c=$(BUILD)/%.o)
TEST_SRC := $(wildcard tests/unit/test_*.c tests/physics/test_*.c)
TEST_BIN := $(TEST_SRC:%.c=$(BUILD)/%)
UNIT_BIN := $(filter $(BUILD)/tests/unit/%,$(TEST_BIN))
# Hostile input: harnesses for libFuzzer, and the kept inputs as a test.
HARNESS := $(patsubst tests/fuzz/fuzz_%.c,%,$(wildcard tests/fuzz/fuzz_*.c)) setup
HARNESS_OBJ := $(patsubst %.c,$(BUILD)/%.o,tests/fuzz/fuzz.c $(wildcard tests/fuzz/fuzz_*.c))
TEST_BIN += $(BUILD)/tests/fuzz/test_corpus
# Started under mpirun by the Python tests, not by themselves.
RANK_BIN := $(patsubst %.c,$(BUILD)/%,$(wildcard tests/parallel/*.c))
# The program with what tests/examples/ adds to it.
EXTENDED := $(BUILD)/tests/examples/extended

.PHONY: all help lib tests helpers install deb uninstall clean FORCE deps deps-demo deps-test deps-long deps-lint \
        deps-dev deps-docs docs demo report bench fullscale partition-study validation check test test-long mutate \
        findings lint tidy validate asan tsan valgrind coverage fuzz
.DEFAULT_GOAL := all
.SECONDARY: $(TEST_BIN:=.o) $(RANK_BIN:=.o)

all: $(BUILD)/bergtow $(BUILD)/libbergtow.so ## build the program and the library (CONFIG=debug, validate, asan)

lib: $(BUILD)/libbergtow.a $(BUILD)/libbergtow.so ## the library: static, and shared for programs and Python

help: ## this list
	@awk -F':.*## ' '/^[a-z-]+:.*## /{printf "  make %-15s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

# The stamp changes when the flags do, so that a new flag rebuilds everything.
STAMP := $(BUILD)/flags
$(STAMP): FORCE
	@mkdir -p $(BUILD)
	@echo '$(CC) $(CFLAGS) $(LDLIBS)' | cmp -s - $@ || { \
	  $(CC) $(CFLAGS) -MF /dev/null install/needs.c $(LDLIBS) -o $(BUILD)/needs 2>$(BUILD)/needs.log || { \
	    echo "the compiler, MPI or a library is missing: make deps installs all of it on Debian;"; \
	    echo "elsewhere see docs/install.md; the compiler said:"; head -5 $(BUILD)/needs.log; exit 1; }; \
	  echo '$(CC) $(CFLAGS) $(LDLIBS)' > $@; }
FORCE:

# First under a name of its own: another make may be at the same.
REV := $(BUILD)/revision.h
$(REV): FORCE
	@mkdir -p $(BUILD)
	@new=$@.$$$$; printf '#define BT_REVISION "%s"\n#define BT_COMPILER "%s"\n#define BT_FLAGS "%s"\n' \
	  '$(REVISION)' "$$($(CC) --version | head -1)" '$(OPT_$(CONFIG)) -ffp-contract=off' > $$new && \
	{ cmp -s $$new $@ && rm $$new || mv $$new $@; }

$(BUILD)/%.o: %.c $(STAMP) | $(REV)
	@mkdir -p $(@D)
	@echo '  CC   $<'
	@$(CC) $(CFLAGS) -I$(BUILD) -c $< -o $@

$(BUILD)/libbergtow.a: $(LIB_OBJ)
	@rm -f $@
	@ar rcs $@ $^

# --- The shared library, and what is installed with it -------------------------------------------------------------

# The number of the soname rises when a public header changes so that programs built before no longer work.
VERSION := $(shell sed -n 's/^\#define BT_VERSION "\(.*\)"/\1/p' include/bergtow/base.h)
SONAME := libbergtow.so.$(firstword $(subst ., ,$(VERSION)))

$(BUILD)/symbols.map: $(BUILD)/libbergtow.a install/symbols.sh $(wildcard include/bergtow/*.h)
	@install/symbols.sh $< > $@.$$$$ && mv $@.$$$$ $@

$(BUILD)/libbergtow.so.$(VERSION): $(LIB_OBJ) $(BUILD)/symbols.map
	@echo '  LINK $@'
	@$(CC) $(CFLAGS) -shared -Wl,-soname,$(SONAME) -Wl,--version-script,$(BUILD)/symbols.map -Wl,-z,defs \
	  $(LIB_OBJ) $(LDLIBS) -o $@

$(BUILD)/libbergtow.so: $(BUILD)/libbergtow.so.$(VERSION)
	@ln -sf $(<F) $(BUILD)/$(SONAME)
	@ln -sf $(SONAME) $@

$(BUILD)/share/bergtow.pc: install/bergtow.pc.in include/bergtow/base.h $(STAMP)
	@mkdir -p $(@D)
	@sed 's|@VERSION@|$(VERSION)|; s|@PRIVATE@|-fopenmp $(LDLIBS)|' $< > $@

$(BUILD)/share/bergtow.1: $(BUILD)/bergtow install/from_help.py
	@PYTHONDONTWRITEBYTECODE=1 $(PYTHON) install/from_help.py $< $(@D)

$(BUILD)/bergtow: $(BIN_OBJ) $(BUILD)/libbergtow.a
	@echo '  LINK $@'
	@$(CC) $(CFLAGS) $^ $(LDLIBS) -o $@

$(BUILD)/tests/%.o: tests/%.c $(STAMP) | $(REV)
	@mkdir -p $(@D)
	@echo '  CC   $<'
	@$(CC) $(CFLAGS) -Itests -c $< -o $@

# From an object of its own: after a change of the library a test program is linked, in a tenth of the time.
$(BUILD)/tests/%: $(BUILD)/tests/%.o $(BUILD)/libbergtow.a
	@echo '  TEST $@'
	@$(CC) $(CFLAGS) $(filter %.o %.a,$^) -lcmocka $(LDLIBS) -o $@

# Kept inputs that have no name of their own.
CORPUS := $(wildcard tests/fuzz/corpus/*.tar.gz)
build/corpus: $(CORPUS)
	@rm -rf $@
	@for packed in $(CORPUS:.tar.gz=); do \
	    mkdir -p $@/$${packed##*/} && tar -xzf $$packed.tar.gz -C $@/$${packed##*/} || exit 1; \
	done

$(BUILD)/tests/fuzz/test_corpus: tests/fuzz/test_corpus.c $(HARNESS_OBJ) $(BUILD)/libbergtow.a $(STAMP) | build/corpus
	@echo '  TEST $@'
	@$(CC) $(CFLAGS) -Itests $(filter %.c %.o,$^) $(BUILD)/libbergtow.a -lcmocka $(LDLIBS) -o $@

# build/fuzz/fuzz_NAME (CONFIG=fuzz)
$(HARNESS:%=$(BUILD)/fuzz_%): $(BUILD)/fuzz_%: tests/fuzz/entry.c $(HARNESS_OBJ) $(BUILD)/libbergtow.a $(STAMP)
	@echo '  FUZZ $@'
	@$(CC) $(CFLAGS) -fsanitize=fuzzer -DBT_FUZZ=bt_fuzz_$* $(filter %.c %.o,$^) $(BUILD)/libbergtow.a $(LDLIBS) \
	  -o $@

$(EXTENDED): tests/examples/extended.c $(BIN_OBJ) $(BUILD)/libbergtow.a $(STAMP)
	@mkdir -p $(@D)
	@echo '  TEST $@'
	@$(CC) $(CFLAGS) -Itests $< $(BIN_OBJ) $(BUILD)/libbergtow.a $(LDLIBS) -o $@

# Preloaded by Python tests.
FAULT := $(patsubst %.c,$(BUILD)/%.so,$(wildcard tests/fault/*.c))
$(FAULT): $(BUILD)/%.so: %.c $(STAMP)
	@mkdir -p $(@D)
	@echo '  TEST $@'
	@$(CC) $(CFLAGS) -shared $< -ldl -o $@

helpers: lib $(RANK_BIN) $(EXTENDED) $(FAULT) # what Python tests call

tests: $(TEST_BIN) helpers $(BUILD)/triad ## build the test programs

$(BUILD)/triad: cases/scaling/triad.c $(STAMP)
	@mkdir -p $(@D)
	@echo '  LINK $@'
	@$(CC) $(CFLAGS) $< -o $@

# --- What a fresh Debian lacks -------------------------------------------------------------------------------

# An MPI or HDF5 that is here already serves. Open MPI is the smaller one. python3-munkres and libblas-dev are
# named to keep apt from their larger alternatives: scipy in place of munkres for the fonts of matplotlib, and with it
# a C++ compiler and Boost; OpenBLAS's headers for scipy.
DEPS_MPI := $(if $(MPI_SHOWN)$(MPI_PKG),,libopenmpi-dev)
DEPS_BUILD := gcc libc6-dev pkg-config $(if $(HDF5),,libhdf5-dev) \
        librandom123-dev libyaml-dev libmetis-dev libjansson-dev libxxhash-dev zlib1g-dev
DEPS_DEMO := $(DEPS_BUILD) \
        python3 python3-numpy python3-h5py python3-matplotlib python3-munkres python3-pil python3-yaml python3-jinja2
DEPS := $(DEPS_DEMO) $(DEPS_MPI) libblas-dev python3-scipy

# For make docs, which prints the PDF by the browser that reports are printed by.
DEPS_DOCS := python3-sphinx python3-myst-parser furo chromium

# For the tests: their own tools; and what a single script needs, which says so where it is missing: ffmpeg
# (animations), chromium (reports as PDF), xarray (open_result of the Python package), gdal, pyproj and shapely (maps);
# netCDF's and UDUNITS' own readers (files).
DEPS_TEST := build-essential git libopenmpi-dev libcmocka-dev python3-pytest python3-pytest-xdist python3-selenium \
             chromium chromium-driver ffmpeg poppler-utils python3-hypothesis python3-xarray python3-h5netcdf \
             python3-netcdf4 python3-pip python3-venv python3-setuptools python3-wheel python3-gdal gdal-bin \
             python3-pyproj python3-shapely python3-distributed zsh netcdf-bin libudunits2-0 $(DEPS_DOCS)

# For make test-long, beyond that: programs that read results (ParaView, Octave), Snakemake, and what makes Debian
# packages, their root, and a container.
DEPS_LONG := dpkg-dev debhelper fakeroot lintian snakemake python3-paraview octave mmdebstrap buildah

# SIZE: what apt says of the packages, before it fetches any. Where there is no dpkg the compiler tells what is missing.
SIZE := sed -n 's/^Need to get \(.*\) of archives.*/to fetch: \1/p; s/^After this operation, /on the disk: /p'
deps: ## install the Debian packages that are missing, for all but the tests
	@command -v dpkg-query >/dev/null || exit 0; missing=$$(for p in $(DEPS); do \
	  dpkg-query -W -f='$${Status}' $$p 2>/dev/null | grep -q 'install ok installed' || echo $$p; done); \
	if [ -z "$$missing" ]; then exit 0; fi; \
	echo "bergtow needs these Debian packages:" $$missing; \
	if [ "$$(id -u)" = 0 ]; then as=; elif command -v sudo >/dev/null; then as=sudo; else \
	  echo "no root and no sudo here; install them with:"; \
	  echo "  apt-get install --no-install-recommends" $$missing; exit 1; fi; \
	echo "+ $$as apt-get update && $$as apt-get install --no-install-recommends ..."; \
	$$as apt-get update -qq && \
	LC_ALL=C apt-get install --no-install-recommends --assume-no $$missing 2>/dev/null | $(SIZE); \
	echo "fetching and unpacking them: a minute or two, without a word"; \
	$$as env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends \
	  -o APT::Keep-Downloaded-Packages=false $$missing >/dev/null

# For make lint, and for the other checks of developers; make test needs none of them.
DEPS_LINT := cppcheck shellcheck pyflakes3 mypy
DEPS_DEV  := $(DEPS_LINT) clang-14 clang-tidy-14 llvm-14 libclang-rt-14-dev libomp-14-dev valgrind gcovr

deps-lint: ## install what make lint can use
	@$(MAKE) --no-print-directory deps DEPS='$(DEPS) $(DEPS_LINT)'

deps-dev: ## install what tidy, tsan, valgrind, coverage and fuzz need
	@$(MAKE) --no-print-directory deps DEPS='$(DEPS) $(DEPS_DEV)'

# pkg-config may only have come with `deps`: what needs the libraries is made by a second make.
AGAIN := $(MAKE) --no-print-directory -j$(J)

deps-demo: ## install what make demo needs: neither MPI nor scipy
	@$(MAKE) --no-print-directory deps DEPS='$(DEPS_DEMO)'

DEMO := out/demo
FIELD := $(DEMO)/members/c003-r001
demo: deps-demo ## resistance of an iceberg in 20, 50 and 80 % ice: the answer, its picture, a replay: 100 s
	@echo "now the program is built, and the iceberg towed through 15 ice fields: 100 s on two cores"
	@$(AGAIN) $(if $(DEPS_MPI),MPI=no) all
	build/release/bergtow ensemble cases/studies/demo.yml -o $(DEMO)
	build/release/bergtow report $(FIELD) -o $(DEMO)/replay.html
	build/release/bergtow plot-resistance $(DEMO)/members/* -o $(DEMO)/resistance.png --words
	@echo "picture of it: $(DEMO)/resistance.png; one field of 80 % with a replay: $(DEMO)/replay.html"
	@echo "tows that are done are kept; remove $(DEMO) for new ones"

RUN ?=
report: deps ## RUN=DIR: a run (with replay) or an ensemble as one HTML page, DIR/report.html
	@[ -n "$(RUN)" ] || { echo "which run? make report RUN=out/demo"; exit 2; }
	build/release/bergtow report $(RUN)

deps-docs: ## install what make docs needs
	@$(MAKE) --no-print-directory deps DEPS='$(DEPS) $(DEPS_DOCS)'

docs: deps-docs ## the manual: build/docs/html/index.html and build/docs/bergtow.pdf
	@$(AGAIN) CONFIG=release all
	@PYTHONDONTWRITEBYTECODE=1 $(PYTHON) docs/build.py build/release/bergtow build/docs

PYTEST := $(PYTHON) -m pytest -q -p no:cacheprovider
deps-test: ## install what make test needs
	@$(MAKE) --no-print-directory deps DEPS='$(DEPS) $(DEPS_TEST)'

# NEAR=src/contact/pack.c src/case/value.c: the tests nearest to these files in place of all units and scenes.
NEAR ?=
check: all $(if $(NEAR),,$(UNIT_BIN)) ## a minute: lint, units, scenes, links (NEAR=FILE: nearest tests)
	@PYTHONDONTWRITEBYTECODE=1 BERGTOW=$(BUILD)/bergtow $(PYTHON) tests/check.py $(NEAR)

test: deps-test ## the tests: units, known answers, same bits, command line, short runs under the sanitizers
	@$(AGAIN) all lib tests
	@$(AGAIN) CONFIG=asan all build/asan/tests/fuzz/test_corpus
	@BERGTOW=build/release/bergtow tests/run.sh $(TEST_BIN)

deps-long: ## install what make test-long needs
	@$(MAKE) --no-print-directory deps DEPS='$(DEPS) $(DEPS_TEST) $(DEPS_LONG)'

test-long: deps-long ## tests that take minutes: intervals over fields, long tows, finer steps, kills, faults, soak
	@$(AGAIN) all lib tests
	@$(AGAIN) CONFIG=asan all
	@failed=; for tests in "-m slow tests/parallel tests/cli" "-s tests/long"; do \
	    BERGTOW=build/release/bergtow $(PYTEST) $$tests || failed=1; done; [ ! "$$failed" ]
	@! command -v clang-14 >/dev/null || $(AGAIN) tsan

# FLAGS='-j 2 --only solve': tests/mutate.py --help
mutate: deps-test ## mutation testing: one wrong line at a time, and the test that detects it: hours; can be resumed
	$(PYTHON) tests/mutate.py $(FLAGS)

STUDY := $(BUILD)/partition/study/partition_quality
$(STUDY): partition/study/partition_quality.c $(BUILD)/libbergtow.a $(STAMP)
	@mkdir -p $(@D)
	@echo '  LINK $@'
	@$(CC) $(CFLAGS) $< $(BUILD)/libbergtow.a $(LDLIBS) -o $@

partition-study: $(STUDY) ## cut cell graphs of a million floes into up to 4,096 parts: partition/quality.csv
	$(STUDY) > partition/quality.csv.new
	mv partition/quality.csv.new partition/quality.csv

BENCH ?= default
bench: deps ## time per floe and step over sizes, threads, ranks (BENCH=quick: a minute, full: to 300,000 floes)
	@$(AGAIN) CONFIG=release all build/release/triad
	$(PYTHON) cases/scaling/bench.py $(BENCH)

fullscale: deps ## resistance of an 80 m berg in 20 to 95 % ice beside the estimates: table, picture in out/fullscale
	@$(AGAIN) CONFIG=release all
	$(PYTHON) cases/fullscale/study.py concentration

validation: deps ## the comparisons of cases/validation: tables, pictures in out/validation; an hour of one core
	@$(AGAIN) CONFIG=release all
	$(PYTHON) cases/validation/arching.py
	$(PYTHON) cases/validation/barrier.py
	$(PYTHON) cases/validation/ship.py

FINDINGS := $(filter-out findings/packages.sh,$(wildcard findings/*.sh))
findings: ## surprises of other software, each seen once more (findings/README.md): minutes, needs apt-get
	@failed=; for f in $(FINDINGS); do echo "$$f"; $$f || failed="$$failed $$f"; done; \
	[ -z "$$failed" ] || { echo "another output than before:$$failed"; exit 1; }

lint: all ## names of external symbols, licence lines, length of lines, syntax; cppcheck, shellcheck, pyflakes
	@tests/lint.sh

tidy: all ## clang-tidy over the program (minutes)
	@tests/tidy.sh

# BT_PYTEST=tests/cli: these Python tests, too.
asan: ## unit and physics tests, kept hostile input, and runs on threads and ranks under ASan and UBSan
	@$(AGAIN) CONFIG=asan all tests
	@tests/sanitize.sh asan $(TEST_BIN:build/$(CONFIG)/%=build/asan/%)

tsan: ## tows on threads and ranks, and the tests that use threads, under ThreadSanitizer (clang, archer)
	@$(AGAIN) CONFIG=tsan all build/tsan/tests/unit/test_contacts build/tsan/tests/unit/test_phases
	@tests/sanitize.sh tsan build/tsan/tests/unit/test_contacts build/tsan/tests/unit/test_phases

valgrind: ## short runs under memcheck
	@$(AGAIN) CONFIG=debug all
	@tests/sanitize.sh valgrind

coverage: ## lines of src/ and partition/ that the tests reach: build/coverage/table.txt
	@$(AGAIN) CONFIG=coverage all tests
	@tests/coverage.sh $(TEST_BIN:build/$(CONFIG)/%=build/coverage/%)

# make fuzz TARGET=case TIME=600; targets: case, setup, values, study, table, outlines, field, checkpoint
TIME ?= 60
fuzz: all ## hostile input by libFuzzer: TARGET=case, study, outlines, field, ..., TIME in seconds
	@$(AGAIN) CONFIG=fuzz build/fuzz/fuzz_$(or $(TARGET),case)
	@tests/fuzz/fuzz.sh $(or $(TARGET),case) $(TIME)

validate: deps ## build/validate/bergtow: assertions, checks of the division, teams of threads for every loop
	@$(AGAIN) CONFIG=validate all

ifneq ($(filter install,$(MAKECMDGOALS)),)
ifeq ($(MPI),no)
$(error bergtow/comm.h of an installed library needs an MPI: make install without MPI=no)
endif
endif
install: all lib $(BUILD)/share/bergtow.pc $(BUILD)/share/bergtow.1 ## program, library, scripts into DESTDIR PREFIX
	@install/install.sh put $(BUILD) $(VERSION) $(PREFIX) $(DESTDIR)

deb: ## Debian packages and their source package: build/deb
	@install/deb.sh $(VERSION)

uninstall: ## take away what make install has put into DESTDIR PREFIX
	@install/install.sh remove $(PREFIX) $(DESTDIR)

clean: ## remove build/ and out/
	rm -rf build out

-include $(patsubst %.o,%.d,$(LIB_OBJ) $(HARNESS_OBJ) $(BIN_OBJ))
-include $(TEST_BIN:=.d) $(RANK_BIN:=.d) $(EXTENDED).d $(STUDY).d $(BUILD)/triad.d $(FAULT:.so=.d)
