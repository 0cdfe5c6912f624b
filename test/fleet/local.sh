#!/usr/bin/env bash
# roadfix fleet on this machine: tasks that die, hang, are stopped; disks that are full; inputs, configurations and storage that change. Whatever happens
# costs the task it happens to, is said in its result, and resume runs what is left and nothing else.
#   local.sh ROADFIX troubles|interrupted|full|keyed|storage|report|compare [DEMO_LOG DEMO_CONFIG]
set -euo pipefail
roadfix=$1; what=$2
if [[ $what == full && -z ${ROADFIX_IN_NAMESPACE:-} ]]; then
  unshare -m true 2>/dev/null || { echo "skipped: no right to make namespaces"; exit 0; }
  exec env ROADFIX_IN_NAMESPACE=1 unshare -m "$0" "$@"
fi
source "$(dirname "$0")/common.sh"
trap 'kill -KILL $(jobs -p) 2>/dev/null || true; wait 2>/dev/null; umount "$folder/disk" 2>/dev/null || true; rm -rf "$folder"' EXIT
run=$folder/run
short=(standing camera=none duration_s=5)
# Long enough to be met at work, and no longer than it is let.
long=(city_loop camera=none duration_s=86000)

case $what in
troubles)
  # One is killed, one is stopped for good, one has a log that is none; the others end well.
  echo 'no log' >"$folder/bad.lcm"
  "$roadfix" fleet run "${long[@]}" seeds=1..2 "${short[@]}" seeds=1..3 "$folder/bad.lcm" --stages gnss_ins_ekf --out "$run" --jobs 3 --time-limit-s 6 \
    >"$folder/out" 2>&1 & fleet=$!
  waits_for '[[ -n $(worker_of "$run" 0 2>/dev/null) && -n $(worker_of "$run" 1 2>/dev/null) ]]'
  kill -KILL "$(worker_of "$run" 0)"
  kill -STOP "$(worker_of "$run" 1)"
  status=0; wait $fleet || status=$?
  [[ $status -eq 1 ]] || fail "ended with $status, not with 1"
  [[ $(states "$run") == '3 done, 3 failed, 0 missing' ]] || fail "$(states "$run")"
  grep -q 'killed by signal 9' "$(result "$run" 0)" || fail "the killed task does not say so"
  grep -q 'killed at its time limit of 6 s' "$(result "$run" 1)" || fail "the hung task does not say so"
  grep -q 'bad.lcm: .*no LCM log' "$(result "$run" 5)" || fail "the log that is none is not named: $(cat "$(result "$run" 5)")"
  grep -q 'resume' "$folder/out" || fail 'the way on is not said'
  no_scratch_left
  # A worker and its parent killed leave no result; status tells who it was.
  "$roadfix" fleet run "${long[@]}" seeds=1 --stages gnss_ins_ekf --out "$folder/gone" >/dev/null 2>&1 & fleet=$!
  waits_for '[[ -n $(worker_of "$folder/gone" 0 2>/dev/null) ]]'
  worker=$(worker_of "$folder/gone" 0)
  kill -KILL "$(ps -o ppid= -p "$worker" | tr -d ' ')"
  waits_for "! kill -0 $worker 2>/dev/null"
  wait $fleet || true
  told "$folder/gone" 'ended without a word, killed perhaps: .*process' || fail 'the lost task is not told'
  ;;
interrupted)
  # Ctrl-C: what has ended stays, what was at work leaves nothing, resume runs the rest.
  "$roadfix" fleet run "${short[@]}" seeds=1..2 "${long[@]}" seeds=1..4 "${short[@]}" seeds=11..14 --stages gnss_ins_ekf --out "$run" --jobs 2 \
    >"$folder/out" 2>&1 & fleet=$!
  waits_for '[[ -n $(worker_of "$run" 2 2>/dev/null) && -n $(worker_of "$run" 3 2>/dev/null) ]]'
  # A second one on the same run is kept out.
  "$roadfix" fleet resume "$run" >"$folder/second" 2>&1 && fail 'two at one run'
  grep -q 'another roadfix fleet is at it: .*process' "$folder/second" || fail "$(cat "$folder/second")"
  kill -INT $fleet
  status=0; wait $fleet || status=$?
  [[ $status -eq 130 ]] || fail "ended with $status, not with 130"
  [[ $(states "$run") == '2 done, 0 failed, 8 missing' ]] || fail "$(states "$run")"
  no_scratch_left
  sed -i 's/duration_s=86000/duration_s=5/g' "$run/tasks.jsonl"    # so that the rest is short
  before=$(stat -c %Y.%i "$(result "$run" 0)" "$(result "$run" 1)")
  "$roadfix" fleet resume "$run" --jobs 2 >"$folder/out" 2>&1 || fail "resume: $(cat "$folder/out")"
  [[ $(states "$run") == '10 done, 0 failed, 0 missing' ]] || fail "$(states "$run")"
  [[ $before == $(stat -c %Y.%i "$(result "$run" 0)" "$(result "$run" 1)") ]] || fail 'what had ended well was run again'
  "$roadfix" fleet resume "$run" >/dev/null
  [[ $(cat "$run"/jobs/*.list | wc -l) -eq 18 ]] || fail 'a resume of a whole run ran something'
  # Killed itself, its tasks do not go on.
  "$roadfix" fleet run "${long[@]}" seeds=1 --stages gnss_ins_ekf --out "$folder/killed" >/dev/null 2>&1 & fleet=$!
  waits_for '[[ -n $(worker_of "$folder/killed" 0 2>/dev/null) ]]'
  worker=$(worker_of "$folder/killed" 0)
  kill -KILL $fleet
  waits_for "! kill -0 $worker 2>/dev/null"
  ;;
full)
  # A disk that fills up: said, stopped, resumed once there is room. What had ended is whole.
  mkdir "$folder/disk"
  mount -t tmpfs -o size=60m none "$folder/disk" 2>/dev/null || { echo "skipped: no right to mount a small disk"; exit 0; }
  run=$folder/disk/run
  status=0
  "$roadfix" fleet run "${short[@]}" seeds=1..40 --stages gnss_ins_ekf --keep report,outputs --out "$run" --jobs 1 --min-free-mb 61 >"$folder/out" 2>&1 || status=$?
  [[ $status -eq 1 ]] || fail "ended with $status, not with 1"
  grep -q 'stopped: the disk is full; nothing that was done is lost' "$folder/out" || fail "$(cat "$folder/out")"
  grep -qE "disk full: $run has [0-9]+ MB left, a task begins with 61" "$folder/out" || fail "$(cat "$folder/out")"
  done_before=$(states "$run" | sed 's/ done.*//')
  [[ $done_before -ge 2 && $done_before -lt 40 ]] || fail "$done_before had ended"
  # Full to the last byte in the middle of a task: its scratch folder is on the small disk, and its drive has 140 MB.
  status=0
  "$roadfix" fleet run city_loop camera=none duration_s=6000 seeds=1..2 --stages gnss_ins_ekf --out "$folder/other" --scratch "$folder/disk" --min-free-mb 1 --jobs 1 \
    >"$folder/out" 2>&1 || status=$?
  grep -q 'No space left on device' "$folder/out" || fail "$(cat "$folder/out")"
  # What the first task had written is removed before the second is asked for room, so that the second may begin, and fail as well.
  [[ $(states "$folder/other") =~ ^0\ done,\ (1\ failed,\ 1\ missing|2\ failed,\ 0\ missing)$ ]] || fail "$(states "$folder/other")"
  [[ $(states "$run" | sed 's/ done.*//') -eq $done_before ]] || fail 'results were lost'
  mount -o remount,size=400m "$folder/disk"
  sed -i 's/"min_free_mb": 61/"min_free_mb": 1/' "$run/fleet.json"
  "$roadfix" fleet resume "$run" >"$folder/out" 2>&1 || fail "resume: $(cat "$folder/out")"
  [[ $(states "$run") == '40 done, 0 failed, 0 missing' ]] || fail "$(states "$run")"
  ;;
keyed)
  # Another configuration or input is another result; a file that was only touched is not.
  log=$3; config=$4
  cp "$log" "$folder/one.lcm"; "$roadfix" log cut "$log" --to-s 20 --out "$folder/two.lcm" >/dev/null
  cp -r "$config" "$folder/vehicle"
  "$roadfix" fleet run "$folder/one.lcm" "$folder/two.lcm" --stages wheel_odometry --config "$folder/vehicle" --out "$run" >/dev/null 2>&1 || fail 'run'
  attempts() { for i in 0 1; do field "$(result "$run" $i)" attempt; done | tr '\n' ' '; }
  [[ $(attempts) == '1 1 ' ]] || fail "attempts $(attempts)"
  touch "$folder/one.lcm"; "$roadfix" fleet resume "$run" >/dev/null
  [[ $(attempts) == '1 1 ' ]] || fail 'a touched input was run again'
  first=$(digests "$run")
  "$roadfix" log cut "$log" --to-s 15 --overwrite --out "$folder/two.lcm" >/dev/null
  told "$run" 'two.lcm\): of another input' || fail 'the other input is not told'
  "$roadfix" fleet resume "$run" >/dev/null 2>&1
  [[ $(attempts) == '1 2 ' ]] || fail "another input: attempts $(attempts)"
  sed -i 's/^\( *gyro_noise_radps_per_rthz: \).*/\11.1e-4/' "$folder/vehicle/calibration.yaml"
  # A worker that finds another configuration than was planned refuses.
  rm "$(result "$run" 0)"
  "$roadfix" fleet task "$run" 0 >/dev/null 2>&1 && fail 'another configuration was taken for the planned one'
  grep -q 'vehicle: has changed since the run was planned' "$(result "$run" 0)" || fail "$(cat "$(result "$run" 0)")"
  "$roadfix" fleet resume "$run" >/dev/null 2>&1
  [[ $(field "$(result "$run" 1)" attempt) -eq 3 ]] || fail 'another configuration was not run again'
  [[ $(states "$run") == '2 done, 0 failed, 0 missing' && $first != "$(digests "$run")" ]] || fail 'the configuration does not show in the digests'
  # The build: what another program made is not this one's.
  sed -i 's/"build":"[0-9a-f]*"/"build":"0123456789abcdef"/' "$(result "$run" 0)"
  told "$run" 'of build 0123456789abcdef, now ' || fail 'the other build is not told'
  sed -i 's/"build": "[0-9a-f]*"/"build": "0123456789abcdef"/' "$run/fleet.json"
  rm "$(result "$run" 1)"; "$roadfix" fleet task "$run" 1 >/dev/null 2>&1 && fail 'two builds in one run'
  grep -q 'the run is of build 0123456789abcdef' "$(result "$run" 1)" || fail "$(cat "$(result "$run" 1)")"
  "$roadfix" fleet resume "$run" >/dev/null 2>&1 || fail 'resume with this build'
  ;;
storage)
  # Storage that is mounted elsewhere on the workers, and logs staged in: the same digests.
  log=$3; config=$4
  mkdir -p "$folder/a/drives"; cp "$log" "$folder/a/drives/demo.lcm"; cp -r "$config" "$folder/a/car"
  flags=(--stages wheel_odometry,gnss_ins_ekf --config car --keep none)
  "$roadfix" fleet run drives --root "$folder/a" "${flags[@]}" --out "$run" >/dev/null 2>&1 || fail 'run'
  mv "$folder/a" "$folder/b"
  cp -r "$run" "$folder/moved"; rm -r "$folder/moved/tasks"
  "$roadfix" fleet resume "$folder/moved" >/dev/null 2>&1 && fail 'the drives are not where the plan says'
  ROADFIX_FLEET_ROOT=$folder/b "$roadfix" fleet resume "$folder/moved" >"$folder/out" 2>&1 || fail "elsewhere: $(cat "$folder/out")"
  [[ -n $(digests "$run") && $(digests "$run") == "$(digests "$folder/moved")" ]] || fail 'other digests elsewhere'
  "$roadfix" fleet run drives --root "$folder/b" "${flags[@]}" --stage-in --out "$folder/staged" >/dev/null 2>&1 || fail 'staged in'
  [[ $(digests "$run") == "$(digests "$folder/staged")" ]] || fail 'other digests where the log was staged in'
  # Without a configuration the log's own calibration is used.
  "$roadfix" fleet run drives --root "$folder/b" --stages wheel_odometry,gnss_ins_ekf --out "$folder/own" >/dev/null 2>&1 || fail 'own calibration'
  no_scratch_left
  ;;
report)
  # The page holds everything and fetches nothing; what is pooled is the sum of the drives.
  drives=(tunnel_dark camera=none seeds=1..3)
  flags=(--stages wheel_odometry,gnss_ins_ekf,integrity)
  echo 'no log' >"$folder/bad.lcm"
  "$roadfix" fleet run "${drives[@]}" "$folder/bad.lcm" "${flags[@]}" --out "$run" >/dev/null 2>&1 && fail 'a bad log ends well'
  "$roadfix" fleet report "$run" >"$folder/out" || fail 'report'
  [[ $(tail -1 "$folder/out") == "$run/report.html" && $(wc -l <"$run/results.jsonl") -eq 4 ]] || fail "$(cat "$folder/out")"
  if grep -nE '<link|src=|@import|fetch\(|https?://' "$run/report.html" | grep -v www.w3.org; then fail 'the page fetches something'; fi
  python3 - "$run" <<'CHECK' || fail 'the page does not hold what the drives say'
import json, re, sys
from pathlib import Path
run = Path(sys.argv[1])
page = (run / "report.html").read_text()
data = json.loads(re.search(r'id="data">(.*?)</script>', page, re.S).group(1))
results = [json.loads(line) for line in (run / "results.jsonl").read_text().splitlines()]
well = [r["figures"] for r in results if r["status"] == "ok"]
assert len(well) == 3 and [t["status"] for t in data["tasks"]] == ["ok"] * 3 + ["failed"], data["tasks"]
assert "bad.lcm" in data["tasks"][3]["reason"]
for task in data["tasks"][:3]:
    assert (run / task["page"]).is_file(), task
for name, channel in data["channels"].items():
    counts = [f["bounds"][name] for f in well]
    sigma = channel["bounds"][-1]
    assert sigma["samples"] == sum(c["samples"] for c in counts) == sum(cell[2] for cell in sigma["cells"]) > 1000
    assert sigma["exceeded"] == sum(c["exceeded"] for c in counts)
    levels = channel["bounds"][:-1]
    assert len(levels) == (6 if name == "POSE_INS" else 0), name
    for level in levels:
        assert level["samples"] == sum(f["channels"][name]["protection"]["samples"] for f in well) == sum(cell[2] for cell in level["cells"]) > 1000
    ends = [o["horizontal_m"] for f in well for o in f["channels"][name]["outages"]["each"]]
    assert channel["outages_m"] == ends and len(ends) == 3, name
CHECK
  ;;
compare)
  # 200 drives: two runs of one build are no regression at no tolerance at all; one planted in a single drive is found and named.
  drives=(turn camera=none duration_s=20)
  flags=(--stages gnss_ins_ekf --keep none --batch 20)
  "$roadfix" fleet run "${drives[@]}" seeds=1..200 "${flags[@]}" --out "$run" >/dev/null || fail 'run'
  "$roadfix" fleet run "${drives[@]}" seeds=1..200 "${flags[@]}" --out "$folder/again" --reversed >/dev/null || fail 'again'
  "$roadfix" fleet compare "$run" "$folder/again" --tolerance 0 --mean-tolerance 0 >"$folder/out" || fail "$(cat "$folder/out")"
  grep -q '^200 drives in both, 200 with the same bits$' "$folder/out" || fail "$(cat "$folder/out")"
  "$roadfix" fleet run "${drives[@]}" seeds=1..136,138..200 "${drives[@]}" seed=137 fault=gnss.bias@12+8:east_m=0.2 "${flags[@]}" --out "$folder/planted" \
    >/dev/null || fail 'planted'
  sed -i 's/ fault=gnss.bias[^"]*"/"/' "$folder/planted/tasks.jsonl"    # the name of the drive that it is to be compared with
  status=0; "$roadfix" fleet compare "$run" "$folder/planted" >"$folder/out" || status=$?
  [[ $status -eq 1 ]] || fail "a planted regression: status $status"
  grep -q '^200 drives in both, 199 with the same bits$' "$folder/out" || fail "$(cat "$folder/out")"
  grep -qE '^ .* seed=137$' "$folder/out" && grep -q 'REGRESSION: 1 drives worse' "$folder/out" || fail "$(cat "$folder/out")"
  ;;
esac
echo "$what: as wanted"
