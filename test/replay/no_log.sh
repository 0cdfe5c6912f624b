#!/usr/bin/env bash
# What is no log, an empty one or another LCM user's, is called that by every subcommand that reads one.
#   no_log.sh ROADFIX CONFIG
set -uo pipefail
roadfix=$1; config=$2
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
cd "$folder" || exit 1
bad=0
fail() { echo "no log: $*"; bad=1; }
# said STATUS WORDS ARGUMENTS...
said() {
  local wanted=$1 words=$2 status; shift 2
  "$roadfix" "$@" >out 2>&1; status=$?
  [[ $status -eq $wanted ]] && grep -q -- "$words" out || fail "$*: status $status, $(tail -1 out)"
  [[ ! -e made ]] || fail "$*: something was written"
}
event() { printf '\xed\xa1\xda\x01%b%b\0\0\0\x03\0\0\0\x10FOO0123456789abcdef' '\0\0\0\0\0\0\0\0' '\0\0\0\0\0\0\0\1'; }
: >empty.lcm
yes 'utime_us,lat_deg' | head -c 100000 >text.lcm
event >foreign.lcm; event >>foreign.lcm
event | head -c 40 >begun.lcm
readers=("replay --stages wheel_odometry --config $config --out made" "evaluate --out made" "export --out made" "verify --config $config"
  "calibrate camera-imu --config $config")
plain=("log info" "log check" "log repair --out made" "log cut --out made" "log filter --channels .* --out made")
for arguments in "${readers[@]}" "${plain[@]}"; do
  said 2 'empty.lcm: is empty' $arguments empty.lcm
  said 2 'text.lcm: is no LCM log' $arguments text.lcm
  said 2 'begun.lcm: is cut off within its first event' $arguments begun.lcm
done
for arguments in "${readers[@]:0:4}"; do said 2 "no message of a type of Roadfix's is in it: FOO" $arguments foreign.lcm; done
said 0 "another LCM user's log" log info foreign.lcm
said 0 "whole as a log, but none of them is a message of Roadfix's" log check foreign.lcm
"$roadfix" log repair foreign.lcm --out copy.lcm >/dev/null && cmp -s <(tail -c 16 copy.lcm) <(printf '0123456789abcdef') || fail "another's log is not copied"
[[ $bad -eq 0 ]] && echo told
exit $bad
