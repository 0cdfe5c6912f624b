#!/usr/bin/env bash
# lcm-spy with our plugins under Xvfb, in a network namespace of its own, on the demo drive and its replay: spy_windows.sh BIN JAR CONFIG LOG
set -euo pipefail
bin=$1; jar=$2; config=$3; log=$4
here=$(cd "$(dirname "$0")" && pwd)
for program in java javac Xvfb lcm-logplayer; do command -v $program >/dev/null || { echo "skipped: no $program"; exit 0; }; done
for needed in /usr/share/java/lcm.jar /usr/share/java/jchart2d.jar "$jar"; do [[ -f $needed ]] || { echo "skipped: no $needed"; exit 0; }; done
[[ -n $(find -L "$(dirname "$(readlink -f "$(command -v java)")")/.." -name libawt_xawt.so -print -quit) ]] || { echo "skipped: only a headless Java"; exit 0; }
if [[ -z ${ROADFIX_IN_NAMESPACE:-} ]]; then
  unshare -n true 2>/dev/null || { echo "skipped: no right to make a network namespace"; exit 0; }
  exec env ROADFIX_IN_NAMESPACE=1 unshare -n "$0" "$@"
fi
ip link set lo up && ip route add 224.0.0.0/4 dev lo
folder=$(mktemp -d)
trap 'kill $(jobs -p) 2>/dev/null || true; rm -rf "$folder"' EXIT
"$bin/roadfix" replay "$log" --stages wheel_odometry,gnss_ins_ekf,vo_tracker,imm_fusion --config "$config" --out "$folder/out.lcm" >/dev/null
"$bin/monitor" --config "$config" --plain --no-dashboard --log-in "$log" --log-in "$folder/out.lcm" --log-out "$folder/health.lcm" >/dev/null
mkfifo "$folder/display"
Xvfb -displayfd 3 -screen 0 1280x1024x24 -nolisten tcp 3>"$folder/display" 2>/dev/null &
read -r -t 20 number <"$folder/display" || { echo "Xvfb does not start"; exit 1; }
url='udpm://239.255.76.67:7667?ttl=0'
for part in "$log" "$folder/out.lcm" "$folder/health.lcm"; do lcm-logplayer --lcm-url="$url" "$part" >/dev/null 2>&1 & done
DISPLAY=:$number timeout 100 java -Djava.net.preferIPv4Stack=true -Droadfix.lcm_url="$url" \
  -cp "/usr/share/java/lcm.jar:/usr/share/java/jchart2d.jar:$jar" "$here/SpyWindows.java" "$url" "$folder" 2>"$folder/errors" && status=0 || status=$?
[[ -z ${SPY_PICTURES:-} ]] || cp "$folder"/*.png "$SPY_PICTURES"
[[ $status == 0 ]] || { tail -5 "$folder/errors"; exit "$status"; }
