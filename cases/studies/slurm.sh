#!/bin/bash
# SPDX-License-Identifier: MIT
# A study as one MPI job: each rank (or each group of `ranks`) takes one member at a time. Submit it again to go on:
#     sbatch cases/studies/slurm.sh
#SBATCH --job-name=bergtow
#SBATCH --nodes=2
#SBATCH --ntasks-per-node=32
#SBATCH --cpus-per-task=1
#SBATCH --time=12:00:00
#SBATCH --signal=TERM@120
set -eu
srun --mpi=pmix build/release/bergtow ensemble "${STUDY:-cases/studies/fullscale.yml}" -o "${OUT:-out/fullscale}" \
    --threads "$SLURM_CPUS_PER_TASK"
