#!/bin/sh
# Submits SEEDS × BANDS tasks to Slurm, and a job that merges them once all are done.
set -eu
here=$(dirname "$0")
last=$((${SEEDS:-2} * ${BANDS:-4} - 1))
job=$(sbatch --parsable --array="0-$last" --requeue --signal=B:TERM@60 "$here/task.sh")
sbatch --dependency="afterok:$job" --wrap "fenestra merge $OUT/band*.exr -o $OUT.exr"
