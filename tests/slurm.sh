#!/bin/bash
# SPDX-License-Identifier: MIT
# Launchers of every kind, from a Slurm of one node that lives as long as this script: srun with PMIx for Open MPI, with
# PMI2 for MPICH, each MPI's own mpirun, and each MPI under the launcher of the other, which has to be refused; and a
# study as an array of jobs.
#
#     tests/slurm.sh [FOLDER]      as root, who alone may start slurmd; FOLDER takes what is built with MPICH, and logs
#
# Needs slurmctld, slurmd, munge, slurm-wlm-basic-plugins, libopenmpi-dev, libmpich-dev. Neither the services of the
# system nor their configuration are touched. Ends with `N passed, N failed`.
set -euo pipefail
cd "$(dirname "$0")/.."
folder=$(mkdir -p "${1:-/tmp/bergtow-slurm}" && cd "${1:-/tmp/bergtow-slurm}" && pwd)
for tool in slurmctld slurmd munged mpicc.openmpi mpicc.mpich; do
  PATH=$PATH:/usr/sbin command -v $tool >/dev/null || { echo "$tool is missing: apt-get install slurmctld slurmd munge \
slurm-wlm-basic-plugins libopenmpi-dev libmpich-dev"; exit 1; }
done
PATH=$PATH:/usr/sbin
make -s MPICC=mpicc.openmpi BUILD="$folder/openmpi" all >"$folder/openmpi.log"
make -s MPICC=mpicc.mpich BUILD="$folder/mpich" all >"$folder/mpich.log"

# --- Slurm -----------------------------------------------------------------------------------------------------------

rm -rf "$folder/state"
mkdir -p "$folder/state/slurmd"
chmod 755 "$folder" "$folder/state"
dd if=/dev/urandom of="$folder/state/key" bs=1024 count=1 2>/dev/null
chmod 600 "$folder/state/key"
host=$(hostname -s)
cat >"$folder/slurm.conf" <<END
ClusterName=bergtow
SlurmctldHost=$host(127.0.0.1)
SlurmctldPort=16817
SlurmdPort=16818
SlurmUser=root
AuthType=auth/munge
AuthInfo=socket=$folder/state/munge
CredType=cred/munge
StateSaveLocation=$folder/state
SlurmdSpoolDir=$folder/state/slurmd
SlurmctldPidFile=$folder/state/slurmctld.pid
SlurmdPidFile=$folder/state/slurmd.pid
SlurmctldLogFile=$folder/slurmctld.log
SlurmdLogFile=$folder/slurmd.log
ProctrackType=proctrack/pgid
TaskPlugin=task/affinity
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
ReturnToService=2
NodeName=$host NodeAddr=127.0.0.1 CPUs=$(nproc)
PartitionName=all Nodes=ALL Default=YES State=UP
END
export SLURM_CONF=$folder/slurm.conf
daemons=()
# shellcheck disable=SC2317  # called at the end
finish() { for pid in "${daemons[@]}"; do kill "$pid" 2>/dev/null || true; done; }
trap finish EXIT
munged --foreground --force --key-file="$folder/state/key" --socket="$folder/state/munge" \
  --pid-file="$folder/state/munged.pid" --seed-file="$folder/state/seed" --log-file="$folder/munged.log" \
  >"$folder/munged.out" 2>&1 &
daemons+=($!)
for _ in {1..50}; do [ ! -S "$folder/state/munge" ] && sleep 0.1; done
slurmctld -D >"$folder/slurmctld.out" 2>&1 &
daemons+=($!)
slurmd -D >"$folder/slurmd.out" 2>&1 &
daemons+=($!)
for _ in {1..100}; do [ "$(sinfo -h -o %t 2>/dev/null)" = idle ] && break; sleep 0.3; done
[ "$(sinfo -h -o %t)" = idle ] || { echo "Slurm does not start: see $folder/*.log, $folder/*.out"; exit 1; }

# --- Runs ------------------------------------------------------------------------------------------------------------

export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
passed=0 failed=0
count() { if [ "$1" = 0 ]; then passed=$((passed + 1)); else failed=$((failed + 1)); fi; }
state() { sed -n 's/.*"state_hash": "\(.*\)".*/\1/p' "$folder/out/summary.json"; }
attribute() {
  ${PYTHON:-/usr/bin/python3} -c 'import h5py, sys; print(h5py.File(sys.argv[1])["/"].attrs[sys.argv[2]])' \
    "$folder/out/result.h5" "$1"
}

# same NAME RANKS LAUNCHER...: the state of one rank, on as many ranks as were asked for
same() {
  local name=$1 ranks=$2 hash='' there=''
  shift 2
  rm -rf "$folder/out"
  if timeout 120 "$@" run cases/basin/basin-50.yml --steps 100 -o "$folder/out" --quiet >"$folder/run.log" 2>&1; then
    hash=$(state) there=$(attribute ranks)
  fi
  echo "$name: state ${hash:-none, see $folder/run.log}, ${there:-no} ranks"
  [ "$hash" = "${one:=$hash}" ] && [ "$there" = "$ranks" ]
  count $?
}

# refused NAME LAUNCHER...: the launcher of another MPI
refused() {
  local name=$1 status=0
  shift
  timeout 60 "$@" run cases/basin/basin-50.yml --steps 1 -o "$folder/refused" --force --quiet \
    >"$folder/refused.log" 2>&1 || status=$?
  echo "$name: code $status, $(grep -c 'each is alone' "$folder/refused.log") message"
  [ $status != 0 ] && [ "$(grep -c 'each is alone' "$folder/refused.log")" = 1 ]
  count $?
}

# threads NAME N LAUNCHER...: threads of each of two ranks where nothing says how many
threads() {
  local name=$1 n=$2 there=''
  shift 2
  timeout 120 "$@" run cases/basin/basin-50.yml --steps 2 -o "$folder/out" --force --quiet >"$folder/run.log" 2>&1 &&
    there=$(attribute threads)
  echo "$name: ${there:-no} threads a rank"
  [ "$there" = "$n" ]
  count $?
}

set +e
mpich=$folder/mpich/bergtow openmpi=$folder/openmpi/bergtow
same "Open MPI alone" 1 "$openmpi"
same "MPICH alone" 1 "$mpich"
same "Open MPI, mpirun" 2 mpirun.openmpi --oversubscribe -n 2 "$openmpi"
same "MPICH, mpirun" 2 mpirun.mpich -n 2 "$mpich"
same "Open MPI, srun --mpi=pmix" 2 srun -n 2 --mpi=pmix "$openmpi"
same "MPICH, srun --mpi=pmi2" 2 srun -n 2 --mpi=pmi2 "$mpich"
same "Open MPI, srun of one task" 1 srun -n 1 "$openmpi"
refused "Open MPI under MPICH's mpirun" mpirun.mpich -n 2 "$openmpi"
refused "MPICH under Open MPI's mpirun" mpirun.openmpi --oversubscribe -n 2 "$mpich"
refused "MPICH, srun --mpi=none" srun -n 2 --mpi=none "$mpich"
cores=$(nproc)
threads "cores for all ranks" $((cores / 2)) mpirun.openmpi --bind-to none --oversubscribe -n 2 "$openmpi"
threads "cores for each rank" 1 mpirun.openmpi --bind-to core --oversubscribe -n 2 "$openmpi"
threads "srun, one core a task" 1 srun -n 2 -c 1 --mpi=pmix "$openmpi"
threads "one task, all cores" "$cores" srun -n 1 -c "$cores" --mpi=pmix "$openmpi"

# --- A study as an array of jobs -------------------------------------------------------------------------------------

# ensemble.h5 of an array, of which one task is cancelled in the middle of a member and another comes too late for any,
# is that of one call.
cat >"$folder/study.yml" <<END
base: $PWD/cases/basin/basin-80.yml
repeats: 3
parameters: {tow.speed: [0.1, 0.2]}
set: {run.duration: 20, output.window_start: 10, output.checkpoint_steps: 50}
END
rm -rf "$folder/alone" "$folder/array"
"$openmpi" ensemble "$folder/study.yml" -o "$folder/alone" --threads 1 --quiet
export BERGTOW=$openmpi STUDY=$folder/study.yml OUT=$folder/array
job=$(sbatch --parsable --array=1-3 --output="$folder/array-%a.txt" cases/studies/slurm-array.sh)
for _ in {1..600}; do compgen -G "$OUT/members/*/checkpoint.h5" >/dev/null && break; sleep 0.1; done
scancel "${job}_1"
for _ in {1..600}; do [ -z "$(squeue -h -j "$job")" ] && break; sleep 0.5; done
finished=$(find "$OUT/members" -name finished | wc -l)
echo "array: $finished members finished by the tasks that were left"
[ "$finished" = 6 ]
count $?
"$openmpi" ensemble "$STUDY" -o "$OUT" --threads 1 --quiet
count $?
differing=$(PYTHONPATH=tests ${PYTHON:-/usr/bin/python3} -c \
  "import sys, harness; print(harness.differing(*sys.argv[1:]))" "$folder/alone/ensemble.h5" "$OUT/ensemble.h5")
echo "array: differs in $differing"
[ "$differing" = "[]" ]
count $?
echo "$passed passed, $failed failed"
[ $failed = 0 ]
