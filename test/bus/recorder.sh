#!/usr/bin/env bash
# Our recorder on real UDP, killed by SIGKILL or on a disk that is full: what it has written comes back, what is damaged
# is said, and the exit status tells.
# A limit on the size of files only splits.
#   recorder.sh BIN killed|full|limited
set -euo pipefail
bin=$1; trouble=$2
if [[ -z ${ROADFIX_IN_NAMESPACE:-} ]]; then
  unshare -nm true 2>/dev/null || { echo "skipped: no right to make namespaces"; exit 0; }
  exec env ROADFIX_IN_NAMESPACE=1 unshare -nm "$0" "$@"
fi
ip link set lo up && ip route add 224.0.0.0/4 dev lo
folder=$(mktemp -d); disk=$folder/disk
trap 'kill $(jobs -p) 2>/dev/null || true; wait; umount "$disk" 2>/dev/null || true; rm -rf "$folder"' EXIT
fail() { echo "recorder $trouble: $*"; exit 1; }
url='udpm://239.255.76.67:7667?ttl=0'
seconds=5; [[ $trouble == full ]] && seconds=9
mkdir "$disk" "$folder/vehicle"
printf 'min_free_gib: 0\nflush_interval_s: 0.1\n' >"$folder/vehicle/recorder.yaml"
if [[ $trouble == full ]]; then
  mount -t tmpfs -o size=128k none "$disk" 2>/dev/null || { echo "skipped: no right to mount a small disk"; exit 0; }
fi
[[ $trouble == limited ]] && ulimit -f 100  # KiB
"$bin/recorder" --config "$folder/vehicle" --folder "$disk" --bus "$url" >"$folder/out" 2>"$folder/err" & recorder=$!
source "$(dirname "$0")/listeners.sh"
await_listeners 1
"$bin/play_drive" "$url" "$seconds" >/dev/null & player=$!
if [[ $trouble == killed ]]; then
  sleep 3; kill -KILL $recorder
else
  wait $player; sleep 0.5; kill -INT $recorder
fi
status=0; wait $recorder || status=$?
wait $player || true
if [[ $trouble == limited ]]; then
  ulimit -f unlimited 2>/dev/null || true
  [[ $status -eq 0 ]] || { cat "$folder/err"; fail "ended with $status"; }
  [[ $(ls "$disk"/*.lcm | wc -l) -gt 1 ]] || fail 'the limit was not met'
  total=0
  for log in "$disk"/*.lcm; do total=$((total + $("$bin/roadfix" log info "$log" | sed -n 's/.*: \([0-9]*\) events.*/\1/p'))); done
  [[ $total -gt 840 ]] || fail "only $total events came back"  # 847, as without a limit
  echo "$total events in $(ls "$disk"/*.lcm | wc -l) files"; exit 0
fi
log=$(ls "$disk"/*.lcm)
events() { "$bin/roadfix" log info "$1" 2>/dev/null | sed -n 's/.*: \([0-9]*\) events.*/\1/p'; }
if [[ $trouble == killed ]]; then
  [[ $(events "$log") -gt 350 ]] || fail "of 3 s only $(events "$log") events came back"   # 182 messages a second
  # Wherever the file ends: all whole events, the rest is reported, and the exit status says so.
  size=$(stat -c %s "$log")
  for cut in 1 7 27 28 100 333; do
    head -c $((size - cut)) "$log" >"$folder/cut.lcm"
    if "$bin/roadfix" log check "$folder/cut.lcm" >/dev/null 2>"$folder/said"; then fail "$cut bytes short passes the check"; fi
    grep -q 'hold no intact event' "$folder/said" || fail "$cut bytes short: the damage is not said"
    "$bin/roadfix" log repair "$folder/cut.lcm" --out "$folder/mended.lcm" --overwrite >/dev/null 2>&1 || true
    "$bin/roadfix" log check "$folder/mended.lcm" >/dev/null || fail 'what was repaired does not pass the check'
    [[ $(events "$folder/mended.lcm") -ge $(($(events "$log") - 4)) ]] || fail 'repair lost whole events'
  done
else
  [[ $status -eq 3 ]] || fail "ended with $status, not with 3"
  grep -q 'recorder: stopped: .*No space left' "$folder/err" || { cat "$folder/err"; fail 'the reason was not said'; }
  [[ $(events "$log") -gt 200 ]] || fail "only $(events "$log") events came back"
  [[ $(stat -c %s "$log") -gt 40000 ]] || fail "the disk was not used"
fi
echo "$(events "$log") events came back, exit status $status"
