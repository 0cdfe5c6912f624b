#!/usr/bin/env bash
# The monitor beside the live stack on the demo drive: it says OK, then the fusion is killed with SIGKILL and started again. Prints
# how long verdict and recovery took (wanted: one second and two, on a quiet machine); fails where they do not come within a minute.
#   monitor.sh BIN CONFIG LOG
set -euo pipefail
bin=$1; config=$(realpath "$2"); log=$(realpath "$3")
if [[ -z ${ROADFIX_IN_NAMESPACE:-} ]]; then
  command -v lcm-logplayer >/dev/null || { echo "skipped: no lcm-logplayer"; exit 0; }
  unshare -n true 2>/dev/null || { echo "skipped: no right to make a network namespace"; exit 0; }
  exec env ROADFIX_IN_NAMESPACE=1 unshare -n "$0" "$@"
fi
ip link set lo up && ip route add 224.0.0.0/4 dev lo
folder=$(mktemp -d); trap 'kill $(jobs -p) 2>/dev/null || true; rm -rf "$folder"' EXIT
source "$(dirname "$0")/listeners.sh"
mkdir "$folder/vehicle"; cp "$config/calibration.yaml" "$folder/vehicle"; printf 'health: {process: {disk_gib: 0}}\n' >"$folder/vehicle/monitor.yaml"
for name in wheel_odometry gnss_ins_ekf; do "$bin/$name" --config "$config" 2>>"$folder/errors" & done
"$bin/imm_fusion" --config "$config" 2>>"$folder/errors" & fusion=$!
"$bin/monitor" --config "$folder/vehicle" --plain --no-dashboard > >(while read -r line; do echo "$EPOCHREALTIME $line"; done >"$folder/lines") &
await_listeners 4
lcm-logplayer "$log" >/dev/null 2>&1 &

# await SECONDS PATTERN FROM: the time of the first line after FROM that matches.
await() {
  local end=$((SECONDS + $1)) at
  while ((SECONDS < end)); do
    at=$(awk -v from="$3" -v pattern="$2" '$1 > from && $0 ~ pattern { print $1; exit }' "$folder/lines" 2>/dev/null)
    [[ -n $at ]] && { echo "$at"; return; }
    sleep 0.1
  done
  echo "the monitor never said: $2"; cat "$folder/lines"; exit 1
}
well=$(await 60 ' OK$' 0) || { echo "$well"; exit 1; }
sleep 3  # rates are learnt
killed=$EPOCHREALTIME
kill -KILL $fusion
told=$(await 60 'DO NOT USE: .*POSE_FUSED is silent' "$killed") || { echo "$told"; exit 1; }
again=$EPOCHREALTIME
"$bin/imm_fusion" --config "$config" 2>>"$folder/errors" &
mended=$(await 60 ' OK$' "$again") || { echo "$mended"; exit 1; }
awk -v k="$killed" -v t="$told" -v a="$again" -v m="$mended" 'BEGIN {
  printf "verdict_s %.2f\nrecovery_s %.2f\n", t - k, m - a }'
