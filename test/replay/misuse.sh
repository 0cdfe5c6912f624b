#!/usr/bin/env bash
# What a user gets wrong on the tool's command line is told, and nothing pretends to have been done.
#   misuse.sh ROADFIX CONFIG LOG
set -uo pipefail
roadfix=$1; config=$2; log=$3
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
cd "$folder" || exit 1
bad=0
fail() { echo "misuse: $*"; bad=1; }
# said STATUS WORDS ARGUMENTS...
said() {
  local wanted=$1 words=$2 status; shift 2
  timeout 20 "$roadfix" "$@" >out 2>&1; status=$?
  [[ $status -eq $wanted ]] && grep -qF -- "$words" out || fail "$*: status $status, $(tail -1 out)"
}
"$roadfix" log filter "$log" --channels 'CAMERA.*' --invert --out drive.lcm >/dev/null
"$roadfix" replay drive.lcm --stages wheel_odometry --config "$config" --out out.lcm >/dev/null 2>&1
mkdir empty

said 2 "there is no subcommand 'evalute' (there are calibrate, doctor, evaluate" evalute out.lcm
for value in nan NaN -nan; do
  said 2 'is no number' simulate city_loop --no-camera --duration $value --out x.lcm
  said 2 'is no number' simulate city_loop --camera-rate-hz $value --out x.lcm
  said 2 'is no number' import empty --start-after=$value --out x.lcm
  said 2 'is no number' log cut drive.lcm --to-s=$value --out x.lcm
  said 2 'is no number' import empty --score-skip=$value --out x.lcm
  said 2 'is no number' evaluate out.lcm --turn-degps=$value
  said 2 'is no number' doctor --no-loopback --space-gib=$value
  said 2 'is no number' replay drive.lcm --stages wheel_odometry --config "$config" --from-s=$value --out x.lcm
done
for value in inf -1; do
  said 2 '--from-s' replay drive.lcm --stages wheel_odometry --config "$config" --from-s=$value --out x.lcm
  said 2 '--space-gib' doctor --no-loopback --space-gib=$value
  said 2 '--turn-degps' evaluate out.lcm --turn-degps=$value
done
said 2 'none of the' log cut drive.lcm --from-s 1000 --out x.lcm
said 2 'none of the' log filter drive.lcm --channels NOPE --out x.lcm
said 2 'has no name' log repair drive.lcm --out ''
said 2 'no poses on channel CONFIG_DRIVE' export out.lcm --channel CONFIG_DRIVE --out x.tum
said 2 'no poses on channel GNSS' export drive.lcm --channel GNSS --out x.tum
said 2 'no stage can be made with this configuration' verify drive.lcm --config empty
said 2 'only udpm:// goes over a network' run "$config" --bus nonsense
mkdir vehicle; echo 'processes: []' >vehicle/run.yaml
said 2 'vehicle/run.yaml:1: processes' run vehicle
echo 'processes: [{name: monitor}, {name: monitor}]' >vehicle/run.yaml
said 2 'must not have two of one name' run vehicle
said 2 'is where the page goes' evaluate out.lcm --out report --json ./report/report.html
said 2 'neither a folder nor a file' import /dev/null --out x.lcm
[[ ! -e x.lcm && ! -e x.tum ]] || fail 'something was written'

said 0 'POSE_WHEEL' evaluate out.lcm --channel POSE_WHEEL --channel POSE_WHEEL --out report
! grep -q 'no figures' out || fail 'a channel named twice has no figures'
said 0 'never acts: the drive ends at 2 s' simulate standing --no-camera --duration 2 --fault gnss.silence@2 --out s.lcm
said 0 'never acts: there is no camera' simulate standing --no-camera --duration 2 --fault camera.dark@1 --overwrite --out s.lcm
said 0 's.lcm' simulate standing --no-camera --duration 2 --fault gnss.silence@1 --overwrite --out s.lcm
! grep -q 'never acts' out || fail 'a fault that acts is said not to'
[[ $bad -eq 0 ]] && echo told
exit $bad
