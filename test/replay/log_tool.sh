#!/usr/bin/env bash
# roadfix log info, check, cut, filter and repair on a log: what goes in comes out, what is damaged is said.
#   log_tool.sh ROADFIX LOG
set -euo pipefail
roadfix=$1; log=$2
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
fail() { echo "log: $*"; exit 1; }
events() { "$roadfix" log info "$1" 2>/dev/null | sed -n 's/.*: \([0-9]*\) events.*/\1/p'; }
of() { "$roadfix" log info "$1" 2>/dev/null | awk -v channel="$2" '$1 == channel { print $3 }'; }
tool() { "$roadfix" log "$@" >"$folder/said" 2>&1; }

tool check "$log" || fail 'a whole log does not pass the check'
tool filter "$log" --channels 'IMU|GN.*' --out "$folder/two.lcm"
tool filter "$log" --channels 'IMU|GN.*' --invert --out "$folder/rest.lcm"
[[ $(of "$folder/two.lcm" IMU) == "$(of "$log" IMU)" && $(of "$folder/two.lcm" GNSS) == "$(of "$log" GNSS)" ]] || fail 'filter lost events'
[[ -z $(of "$folder/two.lcm" WHEELS) && -z $(of "$folder/rest.lcm" IMU) ]] || fail 'filter took others'
[[ $(($(events "$folder/two.lcm") + $(events "$folder/rest.lcm"))) == "$(events "$log")" ]] || fail 'the two halves are not the whole'
tool cut "$log" --from-s 5 --to-s 10 --out "$folder/cut.lcm"
tool cut "$log" --to-s 5 --out "$folder/before.lcm"
tool cut "$log" --from-s 10 --out "$folder/after.lcm"
imu=$(of "$folder/cut.lcm" IMU)
[[ $imu -ge 499 && $imu -le 501 ]] || fail "5 s hold $imu IMU samples"  # at 100 Hz
[[ $(($(events "$folder/before.lcm") + $(events "$folder/cut.lcm") + $(events "$folder/after.lcm"))) == "$(events "$log")" ]] ||
  fail 'the three stretches are not the whole'

cp "$folder/cut.lcm" "$folder/hurt.lcm"  # the 4-byte magic of three events
offsets=$(LC_ALL=C grep -obUaP '\xed\xa1\xda\x01' "$folder/hurt.lcm" | cut -d: -f1 | sed -n '100p;101p;300p')
for offset in $offsets; do printf 'ABCD' | dd of="$folder/hurt.lcm" bs=1 seek="$offset" conv=notrunc status=none; done
if tool check "$folder/hurt.lcm"; then fail 'three broken events pass the check'; fi
grep -q 'hold no intact event' "$folder/said" || fail 'the damage is not said'
grep -q 'missing by seq' "$folder/said" || fail 'what is missing is not said'
tool repair "$folder/hurt.lcm" --out "$folder/mended.lcm"
[[ $(events "$folder/mended.lcm") == $(($(events "$folder/cut.lcm") - 3)) ]] || fail 'repair lost whole events'
if tool check "$folder/mended.lcm"; then fail 'events that are missing pass the check'; fi
! grep -q 'hold no intact event' "$folder/said" || fail 'what was repaired is still damaged'
status=0; tool filter "$log" --channels '(' --out "$folder/x.lcm" || status=$?
[[ $status -eq 2 && ! -e $folder/x.lcm ]] || fail "a wrong pattern ends with $status"
for stretch in '--from-s 10 --to-s 5' '--from-s 5 --to-s 5' '--to-s -1' '--from-s inf'; do
  status=0; tool cut "$log" $stretch --out "$folder/x.lcm" || status=$?
  [[ $status -eq 2 && ! -e $folder/x.lcm ]] && grep -q 'ends before it begins' "$folder/said" || fail "cut $stretch ends with $status"
done
tool cut "$log" --from-s -5 --to-s inf --out "$folder/all.lcm" && [[ $(events "$folder/all.lcm") == "$(events "$log")" ]] || fail 'a stretch beyond both ends is not the whole'
# A log of 0.1 becomes one of today, and one of today stays as it is, byte for byte.
released=${log%/*}/released/0.1.lcm
tool info "$released" && grep -q 'log convert' "$folder/said" || fail 'info does not tell what makes an old log a new one'
tool convert "$released" --out "$folder/today.lcm" && grep -q '^vo_features_t of 0.1: 9 messages' "$folder/said" || fail 'convert converts nothing'
[[ $(events "$folder/today.lcm") == "$(events "$released")" ]] || fail 'convert loses events'
tool check "$folder/today.lcm" || [[ $(grep -c undecodable "$folder/said") == $(grep -c ' 0 undecodable' "$folder/said") ]] || fail 'what was converted is undecodable'
tool convert "$folder/today.lcm" --out "$folder/same.lcm" && grep -q 'nothing to convert' "$folder/said" || fail 'convert converts twice'
cmp -s "$folder/today.lcm" "$folder/same.lcm" || fail 'convert changes what is of today'
status=0; tool convert "$released" --out "$released" || status=$?
[[ $status -eq 2 ]] || fail "converting a log into itself ends with $status"
head -c 100000 "$released" >"$folder/short.lcm"
tool convert "$folder/short.lcm" --out "$folder/converted.lcm" && grep -q 'hold no intact event: the last event is cut off' "$folder/said" || fail 'convert does not tell of a cut'
printf 'no log' >"$folder/none.lcm"
status=0; tool convert "$folder/none.lcm" --out "$folder/never.lcm" || status=$?
[[ $status -eq 2 && ! -e $folder/never.lcm && ! -e $folder/never.lcm.part ]] || fail "converting no log ends with $status"
echo "$(events "$log") events"
