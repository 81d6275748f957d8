#!/bin/bash
# SPDX-License-Identifier: MIT
# A study as an array of jobs without MPI, which share out the members by file locks:
#     sbatch cases/studies/slurm-array.sh
#SBATCH --job-name=bergtow
#SBATCH --array=1-16
#SBATCH --ntasks=1
#SBATCH --cpus-per-task=1
#SBATCH --time=12:00:00
#SBATCH --signal=B:TERM@120
set -eu
exec "${BERGTOW:-build/release/bergtow}" ensemble "${STUDY:-cases/studies/fullscale.yml}" -o "${OUT:-out/fullscale}" \
    --threads "$SLURM_CPUS_PER_TASK" --no-wait
