#!/usr/bin/env bash
# Replays a log three times, normally, without OpenCV's AVX2 and FMA3 code, and on one core: the same bytes.
# A fourth time with a small change of the configuration, which must show.
# CONFIG and LOG of "made" are those of the picture drive, written by the program PICTURE_LOG.
#   same_bytes.sh ROADFIX CONFIG LOG STAGES [SED of calibration.yaml, the change]
#   same_bytes.sh ROADFIX made PICTURE_LOG STAGES SED [LINE of vo_tracker.yaml]
set -euo pipefail
roadfix=$1; config=$2; log=$3; stages=$4
change=${5:-'s/^\( *gyro_noise_radps_per_rthz: \).*/\11.1e-4/'}
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
if [[ $config == made ]]; then
  "$log" "$folder/drive.lcm" "$folder/vehicle"
  config=$folder/vehicle; log=$folder/drive.lcm
  [[ -z ${6:-} ]] || echo "$6" >"$config/vo_tracker.yaml"
fi
stage=${stages%%,*}
replay() { "$roadfix" replay "$log" --stages "${3:-$stages}" --config "${2:-$config}" --out "$folder/$1.lcm" >/dev/null; }
replay normal
OPENCV_CPU_DISABLE=AVX2,FMA3 replay narrow
taskset -c 0 env OMP_NUM_THREADS=1 "$roadfix" replay "$log" --stages "$stages" --config "$config" --out "$folder/alone.lcm" >/dev/null
cp -r "$config" "$folder/changed"
sed -i "$change" "$folder/changed/calibration.yaml"
replay changed "$folder/changed"
[[ $(stat -c %s "$folder/normal.lcm") -gt 100000 ]] || { echo 'too little was replayed'; exit 1; }
for other in narrow alone; do cmp "$folder/normal.lcm" "$folder/$other.lcm" || { echo "$other: other bytes"; exit 1; }; done
! cmp -s "$folder/normal.lcm" "$folder/changed.lcm" || { echo 'the comparison cannot fail'; exit 1; }
# The process over a log is the same handler.
replay tool "$config" "$stage"
"$(dirname "$roadfix")/$stage" --config "$config" --log-in "$log" --log-out "$folder/process.lcm"
cmp "$folder/tool.lcm" "$folder/process.lcm" || { echo "$stage over a log: other bytes than in replay"; exit 1; }
echo "$(stat -c %s "$folder/normal.lcm") bytes, three times the same"
