#!/usr/bin/env bash
# Every fault that `roadfix simulate --list` names, from the command line and from the YAML that --print-config makes of it:
# both must give the same log, byte for byte, and another one than the drive without the fault.
#   faults.sh BIN
set -euo pipefail
roadfix=$1/roadfix
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
drive=(car_park --seed 3 --duration 8 --threads 1)
eye=(--mono --camera-rate-hz 2 --picture-size 64x48)
# Without the first message, which names the scenario with its faults.
simulate() { "$roadfix" simulate "${drive[@]}" "$@" >/dev/null 2>&1; }
messages() { "$roadfix" log cut "$1" --from-s 0.5 --out "$folder/cut.lcm" --overwrite >/dev/null && mv "$folder/cut.lcm" "$2"; }
simulate --overwrite --out "$folder/drive.lcm" && messages "$folder/drive.lcm" "$folder/blind.lcm"
simulate "${eye[@]}" --overwrite --out "$folder/drive.lcm" && messages "$folder/drive.lcm" "$folder/seeing.lcm"
names=$("$roadfix" simulate --list | grep -oE '\b(imu|gnss|wheels|mag|camera)\.[a-z_]+' | sort -u)
[[ $(wc -w <<<"$names") -ge 50 ]] || { echo "only these faults are listed: $names"; exit 1; }
for name in $names; do
  case $name in  # what would be nothing with its default values
    imu.bias) values=:gyro_z_radps=0.1 ;;
    gnss.bias) values=:east_m=5 ;;
    *.drop | *.repeat | *.corrupt) values=:probability=1 ;;
    imu.saturation) values=:accel_mps2=1 ;;
    *) values= ;;
  esac
  fault=(--fault "$name@2+4$values")
  plain=$folder/blind.lcm
  if [[ $name == camera.* ]]; then fault+=("${eye[@]}"); plain=$folder/seeing.lcm; fi
  simulate "${fault[@]}" --overwrite --out "$folder/flag.lcm"
  "$roadfix" simulate "${drive[@]}" "${fault[@]}" --print-config >"$folder/drive.yaml"
  "$roadfix" simulate "$folder/drive.yaml" --seed 3 --threads 1 --overwrite --out "$folder/file.lcm" >/dev/null 2>&1
  cmp "$folder/flag.lcm" "$folder/file.lcm" || { echo "$name: not the same from a file"; exit 1; }
  messages "$folder/flag.lcm" "$folder/faulty.lcm"
  ! cmp -s "$folder/faulty.lcm" "$plain" || { echo "$name: changes nothing"; exit 1; }
done
echo "$(wc -w <<<"$names") faults"
