#!/usr/bin/env bash
# Runs driver_recovery_test in a network namespace of its own: driver_recovery.sh BIN. As an ordinary user where one may read
# the programs: root opens a port even while another holds it.
set -euo pipefail
unshare -n true 2>/dev/null || { echo "skipped: no right to make a network namespace"; exit 0; }
user=(setpriv --reuid 65534 --regid 65534 --clear-groups)
[[ $(id -u) -eq 0 ]] && "${user[@]}" test -x "$1/roadfix" 2>/dev/null || user=()
exec unshare -n bash -c 'ip link set lo up && ip route add 224.0.0.0/4 dev lo && exec "$@"' bash "${user[@]}" env ROADFIX_BIN="$1" "$1/driver_recovery_test"
