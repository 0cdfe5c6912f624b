#!/usr/bin/env bash
# A process as systemd would run it (Type=notify): says READY, feeds the watchdog from its message loop, says STOPPING; and stops
# feeding when the loop stands still.
#   watchdog.sh BIN PROGRAM CONFIG
set -euo pipefail
bin=$1; program=$2; config=$3
command -v python3 >/dev/null || { echo "skipped: no python3"; exit 0; }
if [[ -z ${ROADFIX_IN_NAMESPACE:-} ]]; then
  unshare -n true 2>/dev/null || { echo "skipped: no right to make a network namespace"; exit 0; }
  exec env ROADFIX_IN_NAMESPACE=1 unshare -n "$0" "$@"
fi
ip link set lo up && ip route add 224.0.0.0/4 dev lo
folder=$(mktemp -d); trap '{ kill -KILL $(jobs -p); wait; } 2>/dev/null || true; rm -rf "$folder"' EXIT
python3 - "$folder" <<'PY' &
import socket, sys, time
s = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
s.bind(sys.argv[1] + "/notify")
with open(sys.argv[1] + "/heard", "w", buffering=1) as out:
    while True:
        out.write(s.recv(4096).decode().split("\n")[0] + "\n")
PY
until [[ -S $folder/notify ]]; do sleep 0.05; done
heard() { grep -c "^$1" "$folder/heard" || true; }
wait_for() {  # WHAT HOW_OFTEN
  for _ in $(seq 600); do [[ $(heard "$1") -ge $2 ]] && return; sleep 0.1; done
  echo "$program: $1 heard $(heard "$1") times, not $2"; cat "$folder/heard" "$folder/err"; exit 1
}
cd "$folder"
NOTIFY_SOCKET=$folder/notify WATCHDOG_USEC=2000000 "$bin/$program" --config "$config" >"$folder/err" 2>&1 & pid=$!
wait_for READY=1 1
wait_for WATCHDOG=1 3
kill -STOP $pid; sleep 2
before=$(heard WATCHDOG=1); sleep 2.5; after=$(heard WATCHDOG=1)
[[ $before == "$after" ]] || { echo "a standing loop fed the watchdog"; exit 1; }
kill -CONT $pid
wait_for WATCHDOG=1 $((after + 1))
kill -INT $pid; wait $pid
wait_for STOPPING=1 1
echo "$program: ready, $(heard WATCHDOG=1) signs of life, stopped"
