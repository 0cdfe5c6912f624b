#!/usr/bin/env bash
# What the tool writes where: to devices and pipes as to files, over no input, and nothing half.
#   outputs.sh ROADFIX CONFIG LOG
set -uo pipefail
roadfix=$1; config=$2; log=$3
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
cd "$folder" || exit 1
bad=0
fail() { echo "outputs: $*"; bad=1; }
# refused WORDS ARGUMENTS...: status 2, the words on stderr.
refused() {
  local words=$1 status; shift
  "$roadfix" "$@" >said 2>&1; status=$?
  [[ $status -eq 2 ]] && grep -q -- "$words" said || fail "$*: status $status, $(tail -1 said)"
}
replay=(replay drive.lcm --overwrite --stages wheel_odometry --config "$config" --out)
"$roadfix" log filter "$log" --channels 'CAMERA.*' --invert --out drive.lcm >/dev/null
before=$(cksum <drive.lcm)
"$roadfix" "${replay[@]}" out.lcm >/dev/null 2>&1 || fail 'a replay to a file'

ln -s /dev/null null  # what goes wrong here costs the link, not the device
"$roadfix" "${replay[@]}" null >/dev/null 2>&1 && [[ -c null ]] || fail 'a replay to /dev/null'
mkfifo pipe
timeout 30 cat pipe >piped.lcm & reader=$!
timeout 30 "$roadfix" "${replay[@]}" pipe >/dev/null 2>&1 || fail 'a replay to a pipe'
wait $reader; cmp -s piped.lcm out.lcm && [[ -p pipe ]] || fail 'a pipe gets other bytes than a file'
lines=$("$roadfix" export drive.lcm --channel REFERENCE --out /dev/stdout 2>/dev/null | wc -l)
[[ $lines -gt 800 ]] || fail "an export to /dev/stdout gives $lines lines"

ln -s drive.lcm link.lcm; ln drive.lcm hard.lcm
for name in drive link hard; do
  refused 'would replace the input' "${replay[@]}" $name.lcm
  refused 'would replace the input' log cut drive.lcm --overwrite --from-s 5 --out $name.lcm
  refused 'would replace the input' export drive.lcm --overwrite --channel REFERENCE --out $name.lcm
  refused 'is a log' export out.lcm --overwrite --channel POSE_WHEEL --out $name.lcm
  refused 'is a log' evaluate out.lcm --overwrite --json $name.lcm --out report
done
cp drive.lcm killed.lcm.part
refused 'would replace the input' log repair killed.lcm.part --out killed.lcm
cmp -s drive.lcm killed.lcm.part || fail 'what a killed run left is gone'
cp "$config/calibration.yaml" calibration.yaml
refused 'is there and no log' "${replay[@]}" calibration.yaml
cp "$config"/*.yaml .; printf 'scenario: standing\nduration_s: 2\n' >scenario.yaml
refused 'would replace the input' simulate scenario.yaml --overwrite --out scenario.yaml
refused 'is there and no log' simulate standing --no-camera --duration 2 --overwrite --out scenario.yaml
cmp -s "$config/calibration.yaml" calibration.yaml || fail 'the calibration is another one'
[[ $(cksum <drive.lcm) == "$before" ]] || fail 'the input is another one'

(ulimit -f 100; "$roadfix" "${replay[@]}" out.lcm >said 2>&1; [[ $? -eq 2 ]] && grep -q 'File too large' said) || fail 'a limit on the size of files'
cp out.lcm whole.lcm  # a run that fails leaves the earlier one's output
refused 'needs a message on' replay out.lcm --overwrite --stages wheel_odometry --config "$config" --out whole.lcm
cmp -s out.lcm whole.lcm || fail 'a failed run has touched the output'
[[ -z $(find . -name '*.part' ! -name killed.lcm.part) ]] || fail "$(find . -name '*.part') is left"
[[ $bad -eq 0 ]] && echo whole
exit $bad
