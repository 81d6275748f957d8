# SPDX-License-Identifier: MIT
# bergtow: `make help` lists what there is.

CONFIG ?= release
BUILD  := build/$(CONFIG)
PYTHON ?= /usr/bin/python3
PREFIX ?= /usr/local
J      ?= $(shell nproc 2>/dev/null || echo 2)

CC     := $(if $(filter default undefined,$(origin CC)),gcc,$(CC))
MPI_CFLAGS  := $(shell pkg-config --cflags ompi-c 2>/dev/null)
MPI_LIBS    := $(shell pkg-config --libs ompi-c 2>/dev/null)
HDF5_CFLAGS := $(shell pkg-config --cflags hdf5-openmpi 2>/dev/null)
HDF5_LIBS   := $(shell pkg-config --libs hdf5-openmpi 2>/dev/null)

# -ffp-contract=off -mno-fma and never -ffast-math: the same bits in every build of one compiler.
BASE   := -std=c17 -D_GNU_SOURCE -fopenmp -Iinclude -Isrc -Ipartition -MMD -MP -ffp-contract=off -mno-fma -fno-math-errno \
          -Wall -Wextra -Wpedantic -Wshadow $(MPI_CFLAGS) $(HDF5_CFLAGS)
ifeq ($(CI),true)
BASE   += -Werror
endif
OPT_release := -O3 -g -march=x86-64-v3 -DNDEBUG
OPT_debug   := -O1 -g3
OPT_validate := -O2 -g -march=x86-64-v3 -DBT_VALIDATE
OPT_asan    := -O1 -g3 -fsanitize=address,undefined -fno-sanitize-recover=undefined
ifeq ($(filter $(CONFIG),release debug validate asan),)
$(error CONFIG=$(CONFIG) is unknown: use release, debug, validate or asan)
endif
CFLAGS := $(BASE) $(OPT_$(CONFIG)) $(EXTRA_CFLAGS)
LDLIBS := $(HDF5_LIBS) $(MPI_LIBS) -lyaml -ljansson -lmetis -lxxhash -lm

REVISION := $(shell git describe --always --dirty 2>/dev/null || echo unknown)

LIB_SRC := $(filter-out src/main.c $(wildcard src/cmd_*.c),$(wildcard src/*.c partition/*.c))
BIN_SRC := src/main.c $(wildcard src/cmd_*.c)
LIB_OBJ := $(LIB_SRC:%.c=$(BUILD)/%.o)
BIN_OBJ := $(BIN_SRC:%.c=$(BUILD)/%.o)
TEST_SRC := $(wildcard tests/unit/test_*.c tests/physics/test_*.c)
TEST_BIN := $(TEST_SRC:%.c=$(BUILD)/%)
# Started under mpirun by the Python tests, not by themselves.
RANK_BIN := $(patsubst %.c,$(BUILD)/%,$(wildcard tests/parallel/*.c))

.PHONY: all help deps demo test test-long validate bench fullscale clean install tests lint asan partition-study FORCE
.DEFAULT_GOAL := all

all: $(BUILD)/bergtow ## build build/release/bergtow (CONFIG=debug, validate or asan for the others)

help: ## this list
	@awk -F':.*## ' '/^[a-z-]+:.*## /{printf "  make %-15s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

# The stamp changes when the flags do, so that a new flag rebuilds everything.
STAMP := $(BUILD)/flags
$(STAMP): FORCE
	@[ -n "$(HDF5_LIBS)" ] && command -v $(firstword $(CC)) >/dev/null || { echo "the compiler or a library is missing; run: make deps"; exit 1; }
	@mkdir -p $(BUILD)
	@echo '$(CC) $(CFLAGS) $(LDLIBS)' | cmp -s - $@ || echo '$(CC) $(CFLAGS) $(LDLIBS)' > $@
FORCE:

REV := $(BUILD)/revision.h
$(REV): FORCE
	@mkdir -p $(BUILD)
	@printf '#define BT_REVISION "%s"\n#define BT_COMPILER "%s"\n#define BT_FLAGS "%s"\n' \
	  '$(REVISION)' "$$($(CC) --version | head -1)" '$(OPT_$(CONFIG)) -ffp-contract=off -mno-fma' > $@.new
	@cmp -s $@.new $@ && rm $@.new || mv $@.new $@

$(BUILD)/%.o: %.c $(STAMP) | $(REV)
	@mkdir -p $(@D)
	@echo '  CC   $<'
	@$(CC) $(CFLAGS) -I$(BUILD) -c $< -o $@

$(BUILD)/libbergtow.a: $(LIB_OBJ)
	@rm -f $@
	@ar rcs $@ $^

$(BUILD)/bergtow: $(BIN_OBJ) $(BUILD)/libbergtow.a
	@echo '  LINK $@'
	@$(CC) $(CFLAGS) $^ $(LDLIBS) -o $@

$(BUILD)/tests/%: tests/%.c $(BUILD)/libbergtow.a $(STAMP)
	@mkdir -p $(@D)
	@echo '  TEST $@'
	@$(CC) $(CFLAGS) -Itests $< $(BUILD)/libbergtow.a -lcmocka $(LDLIBS) -o $@

tests: $(TEST_BIN) $(RANK_BIN) $(BUILD)/triad ## build the test programs

$(BUILD)/triad: cases/scaling/triad.c $(STAMP)
	@mkdir -p $(@D)
	@echo '  LINK $@'
	@$(CC) $(CFLAGS) $< -o $@

# --- What a fresh Debian lacks -------------------------------------------------------------------------------

DEPS := build-essential pkg-config git libyaml-dev libopenmpi-dev openmpi-bin libhdf5-openmpi-dev librandom123-dev libmetis-dev libjansson-dev libxxhash-dev \
        libcmocka-dev python3 python3-numpy python3-scipy python3-h5py python3-matplotlib python3-pil \
        python3-yaml python3-pytest ffmpeg

deps: ## install the Debian packages that are missing
	@missing=$$(for p in $(DEPS); do dpkg-query -W -f='$${Status}' $$p 2>/dev/null | grep -q 'install ok installed' || echo $$p; done); \
	if [ -z "$$missing" ]; then exit 0; fi; \
	echo "bergtow needs these Debian packages (on a bare system 360 MB to fetch, some minutes without a word):" $$missing; \
	if [ "$$(id -u)" = 0 ]; then as=; elif command -v sudo >/dev/null; then as=sudo; else \
	  echo "no root and no sudo here; install them with:"; echo "  apt-get install" $$missing; exit 1; fi; \
	echo "+ $$as apt-get update && $$as apt-get install" $$missing; \
	$$as apt-get update -qq && $$as env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends $$missing >/dev/null

# pkg-config may only have come with `deps`: what needs the libraries is made by a second make.
AGAIN := $(MAKE) --no-print-directory -j$(J)

DEMO := out/demo
demo: deps ## tow the berg of cases/basin/basin-80.yml, print the result, draw its pictures
	@$(AGAIN) all
	build/release/bergtow run cases/basin/basin-80.yml -o $(DEMO) --force
	$(PYTHON) postproc/plot_force.py $(DEMO)
	$(PYTHON) postproc/plot_field.py $(DEMO)
	$(PYTHON) postproc/animate.py $(DEMO) -o $(DEMO)/tow.mp4
	@echo "pictures:"; ls $(DEMO)/*.png $(DEMO)/*.mp4

PYTEST := $(PYTHON) -m pytest -q -p no:cacheprovider
test: deps ## every test: units, known answers, same bits, command line
	@$(AGAIN) all tests
	@$(AGAIN) CONFIG=validate all
	@BERGTOW=build/release/bergtow tests/run.sh $(TEST_BIN)

test-long: deps ## studies that take minutes: 2,000 s in 80 % ice, halved time step, tolerance cut tenfold
	@$(AGAIN) all
	BERGTOW=build/release/bergtow $(PYTEST) -s tests/long

STUDY := $(BUILD)/partition/study/partition_quality
$(STUDY): partition/study/partition_quality.c $(BUILD)/libbergtow.a $(STAMP)
	@mkdir -p $(@D)
	@echo '  LINK $@'
	@$(CC) $(CFLAGS) $< $(BUILD)/libbergtow.a $(LDLIBS) -o $@

partition-study: $(STUDY) ## cut tile graphs of a million floes into up to 4,096 parts: partition/quality.csv
	$(STUDY) > partition/quality.csv.new
	mv partition/quality.csv.new partition/quality.csv

BENCH ?= default
bench: deps ## time a floe and step over sizes, threads and ranks (BENCH=quick a minute, BENCH=full to 300,000 floes)
	@$(AGAIN) CONFIG=release all build/release/triad
	$(PYTHON) cases/scaling/bench.py $(BENCH)

fullscale: deps ## resistance of an 80 m berg at 20 to 95 % ice beside the estimates, at full scale: table and picture in out/fullscale
	@$(AGAIN) CONFIG=release all
	$(PYTHON) cases/fullscale/study.py concentration

lint: all ## names of external symbols, licence lines, syntax
	@tests/lint.sh

asan: ## the unit and physics tests under AddressSanitizer and UBSan
	@$(AGAIN) CONFIG=asan all tests
	@for t in $(TEST_SRC:%.c=build/asan/%); do echo $$t; ASAN_OPTIONS=allocator_may_return_null=1 OMP_WAIT_POLICY=passive $$t >build/asan/log 2>&1 || { cat build/asan/log; exit 1; }; done

validate: deps ## the program with assertions, checks of the division, and teams of threads for every loop: build/validate/bergtow
	@$(AGAIN) CONFIG=validate all

install: all ## install the program into DESTDIR PREFIX
	install -D -m 755 $(BUILD)/bergtow $(DESTDIR)$(PREFIX)/bin/bergtow

clean: ## remove build/ and out/
	rm -rf build out

-include $(LIB_OBJ:.o=.d) $(BIN_OBJ:.o=.d) $(TEST_BIN:=.d) $(RANK_BIN:=.d) $(STUDY).d $(BUILD)/triad.d
