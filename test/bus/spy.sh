#!/usr/bin/env bash
# scripts/spy on a screen without a monitor (Xvfb) beside a bus that plays: lcm-spy opens its window and knows our types.
#   spy.sh BIN LOG
set -euo pipefail
bin=$(realpath "$1"); log=$(realpath "$2")
cd "$(dirname "$0")/../.."
[[ $bin == "$PWD/build/release/bin" ]] || { echo "skipped: scripts/spy takes the types of build/release, this is $bin"; exit 0; }
for program in Xvfb java javac lcm-spy lcm-logplayer; do command -v "$program" >/dev/null || { echo "skipped: no $program"; exit 0; }; done
[[ -f /usr/share/java/lcm.jar && -f /usr/share/java/jchart2d.jar ]] || { echo "skipped: no lcm.jar and jchart2d.jar"; exit 0; }
if [[ -z ${ROADFIX_IN_NAMESPACE:-} ]]; then
  unshare -n true 2>/dev/null || { echo "skipped: no right to make a network namespace"; exit 0; }
  exec env ROADFIX_IN_NAMESPACE=1 unshare -n test/bus/spy.sh "$bin" "$log"
fi
ip link set lo up && ip route add 224.0.0.0/4 dev lo
folder=$(mktemp -d)
stop() { kill "${pids[@]}" 2>/dev/null || true; wait 2>/dev/null || true; rm -rf "$folder"; }
pids=(); trap stop EXIT
fail() { echo "spy: $*"; cat "$folder"/* 2>/dev/null | tail -n 20; exit 1; }
Xvfb -displayfd 3 -screen 0 1280x800x24 -nolisten tcp 3>"$folder/display" >"$folder/xvfb" 2>&1 & pids+=($!)
for _ in $(seq 300); do [[ -s $folder/display ]] && break; sleep 0.1; done
[[ -s $folder/display ]] || fail 'Xvfb gives no display'
export DISPLAY=:$(cat "$folder/display") LCM_DEFAULT_URL='udpm://239.255.76.67:7667?ttl=0'
scripts/spy >"$folder/spy" 2>&1 & pids+=($!); spy=$!
lcm-logplayer "$log" >/dev/null 2>&1 & pids+=($!)
types=$(ls lcmtypes/roadfix_*_t.lcm | wc -l)
for _ in $(seq 900); do
  grep -q '^Found [0-9]* LCM types' "$folder/spy" && break
  kill -0 $spy 2>/dev/null || fail 'it ended'
  sleep 0.1
done
found=$(sed -n 's/^Found \([0-9]*\) LCM types.*/\1/p' "$folder/spy")
[[ $found == "$types" ]] || fail "it knows '$found' of $types types"
kill -0 $spy 2>/dev/null || fail 'it ended'
if command -v xwininfo >/dev/null; then
  for _ in $(seq 300); do xwininfo -root -tree 2>/dev/null | grep -q '"LCM Spy"' && break; sleep 0.1; done
  xwininfo -root -tree | grep -q '"LCM Spy"' || fail 'there is no window'
fi
! grep -q 'Exception' "$folder/spy" || fail 'it threw'
echo "$found types"
