#!/usr/bin/env bash
# Every process on the bus has the same command line: command_lines.sh BIN. Options that all have, --help on stdout with status 0, what the user
# can mend on stderr under the program's own name with status 2.
set -uo pipefail
bin=$1
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
bad=0
fail() { echo "$*"; bad=1; }
stages="gnss_ins_ekf wheel_odometry imm_fusion vo_tracker"
drivers="camera_driver gnss_driver imu_driver wheel_driver"
help_of() { "$bin/$1" --help | tr '\n' ' ' | tr -s ' '; }

for program in $stages $drivers recorder monitor pose_server; do
  "$bin/$program" --help >"$folder/help" 2>"$folder/errors" || fail "$program --help ends with $?"
  [[ -s $folder/errors ]] && fail "$program --help says something on stderr"
  for words in "--config TEXT.*The vehicle's configuration folder" "--bus TEXT=udpm://239.255.76.67:7667?ttl=0 LCM URL" \
    "--realtime INT:INT in \[1 - 99\] Scheduling priority (SCHED_FIFO); others wait while this runs" "--print-config Print the effective configuration and end"; do
    help_of "$program" | grep -q -- "$words" || fail "$program --help lacks: $words"
  done
  "$bin/$program" --config "$folder" --nonsense >"$folder/out" 2>"$folder/errors"; status=$?
  [[ $status == 2 ]] || fail "$program --nonsense ends with $status"
  grep -q "nonsense" "$folder/errors" && [[ ! -s $folder/out ]] || fail "$program --nonsense: $(cat "$folder/out" "$folder/errors")"
  "$bin/$program" --config "$folder" --realtime 200 >"$folder/out" 2>"$folder/errors"; status=$?
  [[ $status == 2 ]] && grep -q -- "--realtime" "$folder/errors" || fail "$program --realtime 200: status $status, $(cat "$folder/errors")"
  # A configuration that is wrong is told under the program's name.
  echo "nonsense: 1" | tee "$folder/$program.yaml" >"$folder/calibration.yaml"
  "$bin/$program" --config "$folder" --print-config >"$folder/out" 2>"$folder/errors"; status=$?
  [[ $status == 2 ]] && grep -q "^$program: $folder/.*yaml" "$folder/errors" || fail "$program with a wrong configuration: status $status, $(cat "$folder/errors")"
done
for program in $stages $drivers; do
  "$bin/$program" --print-config >"$folder/out" 2>"$folder/errors"; status=$?
  [[ $status == 2 ]] && grep -q -- "--config is required" "$folder/errors" || fail "$program without --config: status $status"
  "$bin/$program" --config "$folder" --log-in some.lcm >"$folder/out" 2>"$folder/errors"; status=$?
  [[ $status == 2 ]] && grep -q -- "--log-in requires --log-out" "$folder/errors" || fail "$program --log-in alone: status $status, $(cat "$folder/errors")"
done
# Over logs: no output over the input, and none from a log with nothing to make it of.
"$bin/roadfix" simulate standing --no-camera --duration 3 --out "$folder/drive.lcm" >/dev/null
rm -f "$folder"/*.yaml
for driver in gnss_driver imu_driver; do
  printf 'device: /dev/null\n' >"$folder/$driver.yaml"
  "$bin/$driver" --config "$folder" --log-in "$folder/drive.lcm" --log-out "$folder/made.lcm" >"$folder/out" 2>"$folder/errors"; status=$?
  [[ $status == 2 && ! -e $folder/made.lcm ]] && grep -q "no message on RAW_" "$folder/errors" || fail "$driver without raw bytes: status $status, $(cat "$folder/out" "$folder/errors")"
done
"$bin/monitor" --plain --no-dashboard --log-in "$folder/drive.lcm" --log-out "$folder/drive.lcm" >"$folder/out" 2>"$folder/errors"; status=$?
[[ $status == 2 ]] && grep -q 'would replace the input' "$folder/errors" || fail "monitor over its own log: status $status, $(cat "$folder/errors")"
exit $bad
