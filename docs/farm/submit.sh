#!/bin/sh
# Submits SEEDS × BANDS tasks to Slurm. Merge once all are done: a job that depends on them by `afterok`
# never starts if a task was requeued (seen with Slurm 22.05).
set -eu
last=$((${SEEDS:-2} * ${BANDS:-4} - 1))
sbatch --array="0-$last" --requeue --signal=B:TERM@60 "$(dirname "$0")/task.sh"
