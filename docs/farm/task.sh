#!/bin/sh
# One task of a farm: one band of the picture with one seed. Its number is Slurm's, or the first argument.
# From the environment: SCENE, OUT; WIDTH, HEIGHT, BANDS, SPP, and further OPTIONS of `fenestra render`.
set -eu
task=${SLURM_ARRAY_TASK_ID:-${1:-}}
: "${task:?expected the number of a task}" "${SCENE:?}" "${OUT:?}"
width=${WIDTH:-1920} height=${HEIGHT:-1080} bands=${BANDS:-4}
band=$((task % bands)) seed=$((task / bands))
top=$((height * band / bands)) bottom=$((height * (band + 1) / bands))
mkdir -p "$OUT"
# The program takes the place of the shell, so that signals reach it and its exit status is the task's.
# shellcheck disable=SC2086
exec fenestra render "$SCENE" --size "${width}x$height" --crop "0,$top,$width,$bottom" --seed "$seed" \
    --spp "${SPP:-64}" --skip-existing --quiet ${OPTIONS:-} -o "$OUT/band$band.seed$seed.exr"
