#!/bin/bash
# SPDX-License-Identifier: MIT
# The same bits from another compiler (clang) and on another architecture (ARM, under qemu, where the unit tests run
# too): runs of cases, by hashes; and from another C library (musl, static): steps of a world without files, as
# Debian's other libraries are for glibc. What writes files is compiled with musl's headers, all but src/app, whose
# argp musl leaves to a library of its own.
#
#     tests/machines.sh [FOLDER]      FOLDER takes 600 MB: Debian's libraries for arm64, and what is built with them
#
# Needs gcc-aarch64-linux-gnu, qemu-user-static, clang-14, musl-tools, and the network for Debian's packages of the
# other architecture, which are unpacked into FOLDER and never installed. Ends with `N passed, N failed`.
set -euo pipefail
cd "$(dirname "$0")/.."
folder=$(mkdir -p "${1:-/tmp/bergtow-machines}" && cd "${1:-/tmp/bergtow-machines}" && pwd)
root=$folder/root lib=$folder/root/usr/lib/aarch64-linux-gnu

for tool in aarch64-linux-gnu-gcc qemu-aarch64-static clang-14 musl-gcc; do
  command -v $tool >/dev/null ||
    { echo "$tool is missing: apt-get install gcc-aarch64-linux-gnu qemu-user-static clang-14 musl-tools"; exit 1; }
done

# Whatever the steps call, in one static program without MPI and OpenMP; what they do not call falls away.
steps() { # COMPILER OPTION...
  local of=() file
  for file in src/{geometry,body,tow,space,contact,force,loads,solve,step,base}/*.c partition/*.c; do
    case $file in src/base/h5* | src/base/snapshot* | src/base/json* | src/base/provenance* | src/base/syntax* | \
      src/base/tree*) ;; *) of+=("$file") ;; esac
  done
  "$@" -std=c17 -D_GNU_SOURCE -DXXH_INLINE_ALL -Iinstall/alone -Iinclude -Isrc -I. -Itests -ffp-contract=off \
    -fno-math-errno -O3 -ffunction-sections -Wl,--gc-sections -static -w -Wno-psabi -o "$folder/steps" tests/steps.c \
    "${of[@]}" src/case/{speed_law,arch,law_keys,schema,value,body_shapes}.c -lm
  "$folder/steps"
}
musl=(musl-gcc -idirafter /usr/include -idirafter "/usr/include/$(gcc -dumpmachine)")
here=$(steps gcc) there=$(steps "${musl[@]}")
echo "steps: glibc $here, musl $there"
make -s all

foreign=0
for file in src/*/*.c partition/*.c; do
  case $file in src/app/*) continue ;; esac
  # a name that only glibc has is a function without declaration here; with -w gcc would let it pass
  "${musl[@]}" -std=c17 -D_GNU_SOURCE -DXXH_INLINE_ALL -Iinstall/alone -I/usr/include/hdf5/serial -Iinclude -Isrc -I. \
    -Ibuild/release -Wno-psabi -Werror=implicit-function-declaration -fsyntax-only "$file" || foreign=$((foreign + 1))
done
echo "sources that musl does not compile: $foreign"
make -s CC=clang-14 BUILD="$folder/clang" all >"$folder/clang.log"

if [ ! -e "$lib/libmetis.so" ] || [ ! -e "$lib/libcmocka.so" ]; then
  mkdir -p "$folder"/apt/{lists,cache/archives,state} "$root"
  : >"$folder/apt/state/status"
  # shellcheck disable=SC1091
  codename=$(. /etc/os-release && echo "$VERSION_CODENAME")
  echo "deb [signed-by=/usr/share/keyrings/debian-archive-keyring.gpg] http://deb.debian.org/debian $codename main" \
    >"$folder/sources.list"
  cat >"$folder/apt.conf" <<END
APT::Architecture "arm64"; APT::Architectures {"arm64";}; APT::Install-Recommends "false"; APT::Sandbox::User "root";
Dir::State "$folder/apt/state"; Dir::State::status "$folder/apt/state/status"; Dir::State::Lists "$folder/apt/lists";
Dir::Cache "$folder/apt/cache"; Dir::Etc::sourcelist "$folder/sources.list"; Dir::Etc::sourceparts "/dev/null";
END
  apt-get -qq -c "$folder/apt.conf" update
  apt-get -qq -c "$folder/apt.conf" install -y --download-only libhdf5-openmpi-dev libopenmpi-dev libmetis-dev \
    libyaml-dev libjansson-dev libxxhash-dev zlib1g-dev librandom123-dev libgomp1 libc6-dev \
    libcmocka-dev >"$folder/apt.log"
  for package in "$folder"/apt/cache/archives/*.deb; do dpkg -x "$package" "$root"; done
  # links to the root of a machine lead out of this one; without libm.so its static half would be taken
  find "$lib" -maxdepth 1 -lname '/*' | while read -r link; do ln -sf "$root$(readlink "$link")" "$link"; done
fi
make -s CC="aarch64-linux-gnu-gcc --sysroot=$root" BUILD="$folder/arm" \
  MPI_CFLAGS="-I$lib/openmpi/include" HDF5_CFLAGS="-I$root/usr/include/hdf5/openmpi" \
  MPI_LIBS="-L$lib/openmpi/lib -lmpi" HDF5_LIBS="-L$lib/hdf5/openmpi -lhdf5" all tests >"$folder/arm.log"

search=/usr/lib/aarch64-linux-gnu
emulated="qemu-aarch64-static -E LD_LIBRARY_PATH=$search:$search/openmpi/lib:$search/hdf5/openmpi -L $root"
arm() { # PROGRAM ARGUMENT...
  # shellcheck disable=SC2086 # one word an option
  BERGTOW_STARTED=1 $emulated "$folder/arm/$1" "${@:2}"
}
# Open MPI of this machine starts ranks of the other: ranks -n R PROGRAM WORD
cat >"$folder/ranks" <<END
#!/bin/sh
exec mpirun --oversubscribe -n "\$2" $emulated "\$3" "\$4"
END
chmod +x "$folder/ranks"
export MPIRUN=$folder/ranks EMULATOR=$emulated GOMP_SPINCOUNT=5000 # as tests/run.sh has it
state() { sed -n 's/.*"state_hash": "\(.*\)".*/\1/p' "$folder/$1/summary.json"; }

passed=0 failed=0
if [ "${#here}" = 16 ] && [ "$here" = "$there" ]; then passed=1; else failed=1; fi
if [ $foreign = 0 ]; then passed=$((passed + 1)); else failed=$((failed + 1)); fi
for test in tests/{unit,physics,fuzz}/test_*.c; do
  test=$folder/arm/${test%.c}
  if arm "tests/${test#*/arm/tests/}" >"$test.log" 2>&1; then passed=$((passed + 1)); else
    failed=$((failed + 1)) && echo "ARM, ${test##*/}: failed, see $test.log"; fi
done
compare() { # NAME CASE OPTION...
  local name=$1
  shift
  build/release/bergtow run "$@" -o "$folder/here" --force --quiet
  "$folder/clang/bergtow" run "$@" -o "$folder/there" --force --quiet
  arm bergtow run "$@" -o "$folder/far" --force --quiet
  echo "$name: gcc $(state here), clang $(state there), ARM $(state far)"
  if [ "$(state here)" = "$(state there)" ] && [ "$(state here)" = "$(state far)" ]; then passed=$((passed + 1)); else
    failed=$((failed + 1)); fi
}
compare "rafting in the basin" cases/basin/basin-80-rafting.yml --set run.duration=30 --set output.window_start=10
compare "a vessel and a bridle" cases/field/barents-2005.yml --steps 60
compare "outlines of a map" cases/outlines/outlines.yml --steps 100
compare "line in the basin" cases/basin/basin-50.yml --steps 200
# and a checkpoint from here goes on over there
build/release/bergtow run cases/basin/basin-50.yml --steps 100 -o "$folder/far" --force --quiet
arm bergtow resume "$folder/far" --steps 100 --quiet
build/release/bergtow run cases/basin/basin-50.yml --steps 200 -o "$folder/here" --force --quiet
if [ "$(state here)" = "$(state far)" ]; then passed=$((passed + 1)); else failed=$((failed + 1)); fi
echo "$passed passed, $failed failed"
[ $failed = 0 ]
