#!/usr/bin/env bash
# The shipped stages live on a drive, played by lcm-logplayer, recorded by lcm-logger and by our recorder, then both
# recordings are verified; and again with one value of the configuration or calibration changed, which must be named.
# Prints the lines of roadfix verify (of our recorder's recording last); fails where anything differs.
#   stack.sh BIN CONFIG LOG [SECONDS]     every stage, on a drive that has all of their inputs
#   stack.sh BIN pictures                 the camera tracker, on the short drive that the program picture_log makes
set -euo pipefail
bin=$1; config=$2; log=${3:-}; seconds=${4:-20}
if [[ -z ${ROADFIX_IN_NAMESPACE:-} ]]; then
  command -v lcm-logger >/dev/null || { echo "skipped: no lcm-logger"; exit 0; }
  unshare -n true 2>/dev/null || { echo "skipped: no right to make a network namespace"; exit 0; }
  exec env ROADFIX_IN_NAMESPACE=1 unshare -n "$0" "$@"
fi
ip link set lo up && ip route add 224.0.0.0/4 dev lo
folder=$(mktemp -d); trap 'kill $(jobs -p) 2>/dev/null || true; rm -rf "$folder"' EXIT
names=(wheel_odometry gnss_ins_ekf vo_tracker imm_fusion)
changes=("configuration: 'publish_period_s: 0.02' in the car, 'publish_period_s: 0.05' here" 'calibration: .*speed_noise_mps: 0.04')
if [[ $config == pictures ]]; then
  config=$folder/car; log=$folder/pictures.lcm; names=(vo_tracker); changes=('calibration: .*speed_noise_mps: 0.04')
  "$bin/picture_log" "$log" "$config"
fi
list=$(IFS=,; echo "${names[*]}")
url='udpm://239.255.76.67:7667?ttl=0'
"$bin/roadfix" log cut "$log" --to-s "$seconds" --out "$folder/cut.lcm" >/dev/null
lcm-logger --lcm-url="$url&recv_buf_size=4194304" -q "$folder/drive.lcm" >/dev/null 2>&1 & logger=$!
mkdir "$folder/vehicle"; printf 'min_free_gib: 0\n' >"$folder/vehicle/recorder.yaml"
"$bin/recorder" --config "$folder/vehicle" --folder "$folder/ours" --bus "$url" >/dev/null 2>>"$folder/stages.err" & recorder=$!
stages=()
for name in "${names[@]}"; do
  "$bin/$name" --config "$config" --bus "$url" 2>>"$folder/stages.err" & stages+=($!)
done
source "$(dirname "$0")/listeners.sh"
await_listeners $((${#names[@]} + 2))
lcm-logplayer --lcm-url="$url" "$folder/cut.lcm" >/dev/null 2>&1
sleep 0.5
for pid in "${stages[@]}"; do kill -INT "$pid"; done
for pid in "${stages[@]}"; do wait "$pid" || { echo "a stage ended with $?"; cat "$folder/stages.err"; exit 1; }; done
sleep 0.5; kill -INT $logger; kill -TERM $recorder; wait $logger || true
wait $recorder || { echo "the recorder ended with $?"; cat "$folder/stages.err"; exit 1; }
cp -r "$config" "$folder/changed"
[[ ${names[0]} != wheel_odometry ]] || echo 'publish_period_s: 0.05' >"$folder/changed/wheel_odometry.yaml"
sed -i 's/speed_noise_mps: 0.03/speed_noise_mps: 0.04/' "$folder/changed/calibration.yaml"
if "$bin/roadfix" verify "$folder/drive.lcm" --stages "$list" --config "$folder/changed" >"$folder/verdict" && [[ ${names[0]} == wheel_odometry ]]; then
  echo 'a changed configuration passes'; exit 1
fi
for said in "${changes[@]}"; do
  grep -q "not the same as in the car: $said" "$folder/verdict" || { cat "$folder/verdict"; echo "not said: $said"; exit 1; }
done
"$bin/roadfix" verify "$folder/drive.lcm" --stages "$list" --config "$config"
"$bin/roadfix" verify "$folder"/ours/*.lcm --stages "$list" --config "$config"
