#!/usr/bin/env bash
# README's live block: doctor, roadfix run, lcm-logplayer, verify. What doctor prints for the missing route mends it; a
# stage that is killed comes back after a wait; Ctrl-C stops all, the last started first; the recording verifies.
#   run.sh BIN CONFIG LOG
set -euo pipefail
here=$(realpath "$(dirname "$0")"); bin=$1; config=$(realpath "$2"); log=$(realpath "$3")
if [[ -z ${ROADFIX_IN_NAMESPACE:-} ]]; then
  command -v lcm-logplayer >/dev/null || { echo "skipped: no lcm-logplayer"; exit 0; }
  unshare -n true 2>/dev/null || { echo "skipped: no right to make a network namespace"; exit 0; }
  exec env ROADFIX_IN_NAMESPACE=1 unshare -n "$0" "$@"
fi
folder=$(mktemp -d); trap 'kill $(jobs -p) 2>/dev/null || true; wait; rm -rf "$folder"' EXIT
cd "$folder"
fail() { echo "run: $*"; cat said doctor 2>/dev/null; exit 1; }
trap 'echo "run: line $LINENO: $BASH_COMMAND ended with $?"; cat said err doctor 2>/dev/null' ERR
await() { for _ in $(seq 600); do eval "$1" && return; sleep 0.1; done; fail "after a minute still not: $1"; }  # however slow the machine
export LCM_DEFAULT_URL='udpm://239.255.76.67:7667?ttl=0'

if "$bin/roadfix" doctor >doctor; then fail 'doctor finds nothing in a namespace without a route'; fi
mend=$(grep -A1 '^ERROR *multicast route' doctor | sed -n 's/.*mend: //p')
[[ -n $mend ]] || fail 'doctor names no mend for the route'
eval "$mend"
"$bin/roadfix" doctor >doctor || fail 'what doctor prints did not mend the route'
grep -q '^ok *loop-back' doctor || fail 'no message comes back'
! grep -A1 '^warning\|^ERROR' doctor | grep -v '^--' | paste - - | grep -v 'mend: \|to do: ' || fail 'a finding without what mends it'

cp -r "$config" vehicle
printf 'min_free_gib: 0\n' >vehicle/recorder.yaml
"$bin/roadfix" log cut "$log" --to-s 14 --out cut.lcm >/dev/null
"$bin/roadfix" run vehicle >said 2>err & run=$!
await '[[ $(grep -c started said) -ge $(grep -c "name:" vehicle/run.yaml) ]]'
source "$here/listeners.sh"
await_listeners "$(grep -c 'name:' vehicle/run.yaml)"
# README's page is that of the monitor which runs; another one takes another port, is silent, and says both.
"$bin/monitor" --config vehicle --plain >/dev/null 2>second & second=$!
await 'grep -q "only shows" second'
grep -q '^monitor: dashboard: cannot listen on 127.0.0.1:8420: Address already in use (monitor, process [0-9]*); this one.s page is http://127.0.0.1:8421/$' second ||
  fail "a second monitor: $(cat second)"
grep -q 'another monitor publishes HEALTH here; this one only shows' second || fail "a second monitor: $(cat second)"
status=0; "$bin/monitor" --plain --listen 127.0.0.1:8420 2>third >/dev/null || status=$?
[[ $status -eq 2 ]] && grep -q 'monitor, process [0-9]*); give another --listen' third || fail "a third monitor: $status, $(cat third)"
lcm-logplayer cut.lcm >/dev/null 2>&1 & player=$!
sleep 5
kill -KILL "$(sed -n 's/^gnss_ins_ekf started, process //p' said)"
wait $player || fail "the player ended with $?"
await '[[ $(grep -c "^gnss_ins_ekf started" said) -eq 2 ]]'
sleep 0.5
kill $second || fail "the second monitor is gone: $(cat second)"
kill -INT $run
wait $run || fail "ended with $?"
grep -q 'gnss_ins_ekf was killed by signal 9 .*starts again in' said || fail 'the death was not said'
[[ $(grep -c '^gnss_ins_ekf started' said) -eq 2 ]] || fail 'the killed stage was not started again'
[[ $(grep -c '^wheel_odometry started' said) -eq 1 ]] || fail 'a living stage was started again'
names=$(sed -n 's/^ *- {name: \([a-z_]*\).*/\1/p' vehicle/run.yaml)
stopped=$(sed -n 's/ ended with status 0$//p' said | tail -n "$(wc -w <<<"$names")")
[[ $stopped == "$(tac <<<"$names")" ]] || fail "stopped in this order:" $stopped
"$bin/roadfix" verify recordings/*.lcm --config vehicle | tee verdict || fail 'something differs'
read -r _ identical _ differing _ < <(tail -n 1 verdict)
[[ $identical -gt 1500 && $differing -eq 0 ]] || fail 'too little was verified'
