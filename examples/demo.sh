#!/usr/bin/env bash
# The whole chain on the synthetic machine files of data_raw/: card, touch, sweep, surrogates, reports.
# Usage: demo.sh OUT_FOLDER SCENES WORKERS; with two workers or more, what follows the sweep runs two at a time.
set -euo pipefail
cd "$(dirname "$0")/.."
out=${1:-reports/out} scenes=${2:-200} workers=${3:-2}
mkdir -p "$out"
rm -rf "$out/sweep" "$out/nested"
began=$SECONDS

step() { # step RESULT COMMAND...: run it, say where the result went and what it took
  local TIMEFORMAT="-> $1 (%R s, %U s of CPU)"
  shift
  printf '\n$ %s\n' "$*"
  { time "$@" 2>&3; } 3>&2 2>&1
}

together() { # together FUNCTION OTHER: both at the same time, if on two cores; what the other prints follows as a whole
  local printed status=0
  if ((workers < 2)); then
    "$1"
    "$2"
    return
  fi
  printed=$(mktemp)
  ("$2") >"$printed" 2>&1 &
  trap "pkill -P $! || true; rm -f '$printed'" EXIT # where the first fails, the other ends with it
  "$1"
  wait $! || status=$?
  trap - EXIT
  cat "$printed"
  rm -f "$printed"
  return $status
}

forward() {
  step "$out/forward/" surrogate train "$out/sweep" --out "$out/forward" --method forward --seed 1
  step "the tables above" surrogate evaluate "$out/forward" "$out/sweep" --noise-db 90,80
  step "$out/forward.pdf" surrogate report "$out/forward" --out "$out/forward.pdf"
}

others() {
  step "$out/sweep.pdf" eitsim report "$out/sweep" --out "$out/sweep.pdf"
  step "$out/trainbr/" surrogate train "$out/sweep" --out "$out/trainbr" --method trainbr --outputs x0,y0,d,F --seed 1
  step "$out/trainbr.pdf" surrogate report "$out/trainbr" --out "$out/trainbr.pdf"
  step "$out/nested/" eitsim sweep examples/uncertain.toml --card "$out/card.json" --scenes 24 --workers 1 \
    --out "$out/nested"
  step "$out/indices.csv" eitsim indices "$out/nested" --out "$out/indices.csv"
}

step "$out/card.json, $out/calibration.pdf" matcal fit data_raw/mts_uniaxial.txt data_raw/mts_shear.txt \
  data_raw/mts_relaxation.txt conductivity=data_raw/mts_stretch.txt,data_raw/nova_stretch.txt \
  --specimen data_raw/specimen.toml --posterior --seed 1 --out "$out/card.json" --report "$out/calibration.pdf"
step "$out/touch.json, $out/skin.vtu, $out/touch.pdf" eitsim run examples/scene.toml --card "$out/card.json" \
  --out "$out/touch.json" --skin "$out/skin.vtu" --skin-patterns 0,4 --report "$out/touch.pdf"
step "$out/sweep/" eitsim sweep examples/design.toml --card "$out/card.json" --scenes "$scenes" \
  --workers "$workers" --out "$out/sweep"
together forward others
printf '\ndemo: %d s in all; the PDFs:\n' "$((SECONDS - began))"
ls "$out"/*.pdf
