#!/usr/bin/env bash
# Three stages on real UDP in a network namespace of their own, recorded by lcm-logger and by our recorder (split every
# 4 s), then both recordings are verified: nothing may differ. In ip_loss the stages live in a second namespace, behind a
# link that drops 0.1 % of the packets.
#   live.sh BIN clean|starved|killed|silent_clock|late_recording|ip_loss
set -euo pipefail
bin=$1; trouble=$2
if [[ -z ${ROADFIX_IN_NAMESPACE:-} ]]; then
  command -v lcm-logger >/dev/null || { echo "skipped: no lcm-logger"; exit 0; }
  [[ $trouble != ip_loss ]] || command -v nft >/dev/null || { echo "skipped: no nft"; exit 0; }
  unshare -n true 2>/dev/null || { echo "skipped: no right to make a network namespace"; exit 0; }
  exec env ROADFIX_IN_NAMESPACE=1 unshare -n "$0" "$@"
fi
folder=$(mktemp -d); trap 'kill $(jobs -p) 2>/dev/null || true; rm -rf "$folder"' EXIT
url='udpm://239.255.76.67:7667?ttl=0'
there=()  # runs a command where the stages are
if [[ $trouble == ip_loss ]]; then
  url='udpm://239.255.76.67:7667?ttl=1'
  unshare -n sleep 100 & other=$!
  sleep 0.3
  there=(nsenter -t "$other" -n)
  ip link add here type veth peer name there 2>/dev/null || { echo "skipped: the kernel gives no veth link"; exit 0; }
  ip link set there netns "$other"
  ip addr add 10.9.0.1/24 dev here && ip link set here up && ip route add 224.0.0.0/4 dev here
  "${there[@]}" bash -c 'ip addr add 10.9.0.2/24 dev there && ip link set lo up && ip link set there up && ip route add 224.0.0.0/4 dev there'
  rules='add table ip loss; add chain ip loss in { type filter hook input priority 0; }
    add rule ip loss in iif there udp dport 7667 numgen random mod 1000 == 0 counter drop'
  "${there[@]}" nft "$rules" 2>/dev/null || { echo "skipped: the kernel refuses nft's rules"; exit 0; }
  sleep 1
else
  ip link set lo up && ip route add 224.0.0.0/4 dev lo
fi
starved_url=$url; [[ $trouble == starved ]] && starved_url+='&recv_buf_size=2500'
declare -A stage
start() { "${there[@]}" "$bin/chain_process" --config "/$1" --bus "${2:-$url}" 2>>"$folder/stages.err" & stage[$1]=$!; }

mkdir "$folder/vehicle"
printf 'split_time_s: 4\nmin_free_gib: 0\n' >"$folder/vehicle/recorder.yaml"
record() {
  lcm-logger --lcm-url="$url&recv_buf_size=4194304" -q "$folder/logger.lcm" >/dev/null 2>&1 & logger=$!
  "$bin/recorder" --config "$folder/vehicle" --folder "$folder/ours" --bus "$url" >/dev/null 2>>"$folder/stages.err" & recorder=$!
}
[[ $trouble == late_recording ]] || record
for name in odometry fusion; do start $name; done
start filter "$starved_url"
source "$(dirname "$0")/listeners.sh"
case $trouble in
  ip_loss) await_listeners 2; sleep 3 ;;  # the stages listen in the other namespace
  late_recording) await_listeners 3 ;;
  *) await_listeners 5 ;;
esac
player=("$bin/play_drive" "$url")
case $trouble in
  silent_clock) player+=(14 IMU 5 8) ;;
  killed | starved) player+=(16) ;;
  late_recording) player+=(19) ;;
  *) player+=(12) ;;
esac
"${player[@]}" & player=$!
case $trouble in
  starved) for _ in 1 2 3; do sleep 3; kill -STOP "${stage[filter]}"; sleep 1; kill -CONT "${stage[filter]}"; done ;;
  killed) sleep 6.3; kill -KILL "${stage[filter]}"; wait "${stage[filter]}" 2>/dev/null || true; sleep 1.5; start filter ;;
  late_recording) sleep 3; record ;;
esac
wait $player
sleep 0.5
for pid in "${stage[@]}"; do kill -INT "$pid"; done
for pid in "${stage[@]}"; do wait "$pid" || { echo "a stage ended with $?"; cat "$folder/stages.err"; exit 1; }; done
sleep 0.5; kill -INT $logger; kill -TERM $recorder; wait $logger || true
wait $recorder || { echo "the recorder ended with $?"; cat "$folder/stages.err"; exit 1; }
grep -v 'bytes; large messages may be lost\|receive buffer\|LCM' "$folder/stages.err" || true
fail() { echo "live $trouble: $*"; exit 1; }
[[ $(ls "$folder"/ours/*.lcm | wc -l) -ge 3 ]] || fail 'the recorder did not split its log'
for recording in logger ours; do
  logs=("$folder"/$recording*.lcm); [[ $recording == logger ]] || logs=("$folder"/ours/*.lcm)
  echo "-- recorded by $recording: ${#logs[@]} files"
  "$bin/verify_chain" "${logs[@]}" | tee "$folder/verdict" || true
  read -r _ identical _ differing _ unverifiable < <(tail -n 1 "$folder/verdict")
  [[ $differing -eq 0 ]] || fail 'something differs'
  # On a busy machine lcm-logger itself loses messages; without that, and from the beginning, everything can be verified.
  grep -q 'lost by the logger' "$folder/verdict" && lost=yes || lost=no
  [[ $identical -gt 1500 || ( $lost == yes && $recording == logger ) ]] || fail 'too little was verified'
  [[ $unverifiable -eq 0 || $lost == yes || $trouble == late_recording ]] || fail 'unverifiable, but the logger lost nothing'
done
if [[ $trouble == ip_loss ]]; then
  echo "dropped on the way: $("${there[@]}" nft list chain ip loss in | grep -o 'packets [0-9]*')"
elif [[ $trouble == silent_clock ]]; then
  grep -q '^filter: [1-9][0-9]* heartbeats without a clock' "$folder/verdict" || fail 'nobody said that the clock was silent'
elif [[ $trouble == starved ]]; then
  grep -q '^filter: [1-9][0-9]* datagrams dropped by the kernel' "$folder/verdict" || fail 'nobody said what the kernel dropped'
elif [[ $trouble == clean ]]; then
  ! grep -q 'without a clock' "$folder/verdict" || fail 'the clock was called silent'
fi
