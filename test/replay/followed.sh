#!/usr/bin/env bash
# A recording of ../shared/data through vo_tracker in mode filter: after the first valid pose none is lost. Where
# a time between two updates is called coasting that some exceed (if one is given), some are.
#   followed.sh ROADFIX DRIVE [LIMIT in s]
set -euo pipefail
roadfix=$1; drive=$(cd "$(dirname "$0")/../../.." && pwd)/shared/data/$2; limit=${3:-}
[[ -d $drive ]] || { echo "skipped: no $drive"; exit 0; }
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
"$roadfix" import "$drive" --out "$folder/drive.lcm" --vehicle "$folder/vehicle" >/dev/null
# How the camera sits on Malaga's car is known to 15 degrees and 0.3 s only.
[[ $2 != malaga* ]] || "$roadfix" calibrate camera-imu "$folder/drive.lcm" --config "$folder/vehicle" >/dev/null
# Poses, and those after the first valid one that are not valid.
counts() {
  echo "$1" >"$folder/vehicle/vo_tracker.yaml"
  "$roadfix" replay "$folder/drive.lcm" --stages vo_tracker --config "$folder/vehicle" --out "$folder/$2.lcm" >/dev/null
  "$roadfix" export "$folder/$2.lcm" --channel POSE_VO --format csv --out "$folder/$2.csv" >/dev/null
  awk -F, 'NR == 1 { next } $NF == "valid" { begun = 1; ++valid } begun && $NF != "valid" { ++lost }
    END { print valid + 0, lost + 0 }' "$folder/$2.csv"
}
read -r valid lost < <(counts "mode: filter" all)
echo "$2: $valid valid poses, $lost lost"
[[ $valid -gt 200 && $lost -eq 0 ]] || exit 1
[[ -n $limit ]] || exit 0
read -r valid lost < <(counts "{mode: filter, filter: {navigation: {start: {coasting_s: $limit}}}}" limited)
[[ $lost -gt 0 ]] || { echo 'the count cannot fail'; exit 1; }
