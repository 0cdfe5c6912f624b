#!/usr/bin/env bash
# Three engines, one list of digests: local, GNU parallel and Slurm, in batches and in two orders. `skipped` names the engines that are not installed.
#   engines.sh ROADFIX parallel|interrupted|slurm
set -euo pipefail
roadfix=$(realpath "$1"); what=$2; here=$(dirname "$(realpath "$0")")
[[ $what == slurm ]] || command -v parallel >/dev/null || { echo 'skipped: GNU parallel is not installed'; exit 0; }
if [[ $what == slurm && -z ${LOCAL_SLURM:-} ]]; then exec "$here/../../scripts/local-slurm" --cores 2 "$here/engines.sh" "$roadfix" slurm; fi
source "$here/common.sh"
trap 'kill -KILL $(jobs -p) 2>/dev/null || true; wait 2>/dev/null; rm -rf "$folder"' EXIT
run=$folder/run
drives=(turn camera=none duration_s=30 seeds=1..7)
long=(city_loop camera=none duration_s=86000)
flags=(--stages wheel_odometry,gnss_ins_ekf,imm_fusion --keep none)
"$roadfix" fleet run "${drives[@]}" "${flags[@]}" --out "$folder/local" >/dev/null
[[ $(digests "$folder/local" | sort -u | wc -l) -eq 7 ]] || fail 'seven drives, and not seven lists of digests'

case $what in
parallel)
  export ROADFIX_FLEET_ENGINE=parallel
  "$roadfix" fleet run "${drives[@]}" "${flags[@]}" --out "$run" --batch 3 --reversed >"$folder/out" 2>&1 || fail "$(cat "$folder/out")"
  [[ $(digests "$run") == "$(digests "$folder/local")" ]] || fail 'other digests with GNU parallel'
  [[ $(cat "$run/jobs/0001.list") == $'6 5 4\n3 2 1\n0' ]] || fail "batches $(cat "$run/jobs/0001.list")"
  ;;
interrupted)
  export ROADFIX_FLEET_ENGINE=parallel
  "$roadfix" fleet run "${drives[@]}" "${long[@]}" seeds=1..3 "${flags[@]}" --out "$run" --jobs 2 >"$folder/out" 2>&1 & fleet=$!
  waits_for '[[ -n $(worker_of "$run" 7 2>/dev/null) && -n $(worker_of "$run" 8 2>/dev/null) ]]'
  kill -INT $fleet
  status=0; wait $fleet || status=$?
  [[ $status -eq 130 ]] || fail "ended with $status, not with 130: $(cat "$folder/out")"
  [[ $(states "$run") == '7 done, 0 failed, 3 missing' ]] || fail "$(states "$run")"
  no_scratch_left
  ;;
slurm)
  export ROADFIX_FLEET_ENGINE=slurm
  # An array of batches, in the partition that was asked for.
  "$roadfix" fleet run "${drives[@]}" "${flags[@]}" --out "$run" --batch 2 --wait --partition other --account ours --sbatch-option=--comment=hello >"$folder/out" 2>&1 || fail "$(cat "$folder/out")"
  [[ $(digests "$run") == "$(digests "$folder/local")" ]] || fail 'other digests with Slurm'
  id=$(cat "$run/jobs/slurm_jobs.txt")
  scontrol show job "${id}_3" >"$folder/job"
  for words in 'Partition=other' 'Account=ours' 'Comment=hello' 'Requeue=1' 'ArrayTaskId=3' 'TimeLimit=02:05:00'; do grep -q "$words" "$folder/job" || fail "no $words: $(cat "$folder/job")"; done
  "$roadfix" fleet run "${drives[@]}" "${flags[@]}" --out "$folder/no" --partition none >"$folder/out" 2>&1 && fail 'a partition that is none'
  grep -q 'sbatch: .*invalid partition' "$folder/out" || fail "$(cat "$folder/out")"

  # Detached; a worker is killed: its task alone fails and says so. While Slurm is at it there is no second one.
  run=$folder/troubles
  "$roadfix" fleet run "${long[@]}" seeds=1..2 "${drives[@]}" "${flags[@]}" --out "$run" >"$folder/out" 2>&1 || fail "$(cat "$folder/out")"
  grep -q '9 tasks handed over' "$folder/out" || fail "$(cat "$folder/out")"
  waits_for '[[ -n $(worker_of "$run" 0 2>/dev/null) && -n $(worker_of "$run" 1 2>/dev/null) ]]'
  "$roadfix" fleet resume "$run" >"$folder/out" 2>&1 && fail 'resumed what Slurm is at'
  grep -q "Slurm has not ended job $(cat "$run/jobs/slurm_jobs.txt") yet" "$folder/out" || fail "$(cat "$folder/out")"
  kill -KILL "$(worker_of "$run" 0)"
  waits_for '[[ -s $(result "$run" 0) ]]'
  grep -q 'killed by signal 9' "$(result "$run" 0)" || fail 'the killed task does not say so'
  waits_for '! squeue --noheader --array --format=%i | grep -q "_0 *$"'
  # The daemon dies with its step: Slurm sees the node go, requeues what ran on it, and begins again when it is back.
  kill -KILL "$(cat "$LOCAL_SLURM/slurmd.pid")"; pkill -KILL slurmstepd || true; kill -KILL "$(worker_of "$run" 1)"
  sleep 1
  # The controller is stopped too; it finds its queue again.
  controller=$(cat "$LOCAL_SLURM/slurmctld.pid"); kill "$controller"; waits_for '! kill -0 $controller 2>/dev/null'
  "$LOCAL_SLURM/slurmctld.sh"; "$LOCAL_SLURM/slurmd.sh"
  sed -i 's/duration_s=86000/duration_s=30/g' "$run/tasks.jsonl"   # so that the rest is short
  # Slurm holds what it requeues for two minutes: not here.
  waits_for '[[ $(squeue --noheader --array --format=%r 2>/dev/null | sort -u) == BeginTime ]]'
  for job in $(squeue --noheader --array --format=%i); do scontrol update "jobid=$job" starttime=now; done
  waits_for '[[ -z $(squeue --noheader 2>&1) ]]'
  [[ $(states "$run") == '8 done, 1 failed, 0 missing' ]] || fail "after the daemons came back: $(states "$run")"
  mapfile -t whole < <(grep -l '"status":"ok"' "$run"/tasks/*/result.json)
  before=$(stat -c %Y.%i "${whole[@]}")
  "$roadfix" fleet resume "$run" --wait >"$folder/out" 2>&1 || fail "resume: $(cat "$folder/out")"
  [[ $(states "$run") == '9 done, 0 failed, 0 missing' ]] || fail "$(states "$run")"
  [[ $(stat -c %Y.%i "${whole[@]}") == "$before" ]] || fail 'what had ended well was run again'
  # Ctrl-C of one that waits ends the jobs too.
  run=$folder/interrupted
  "$roadfix" fleet run "${long[@]}" seeds=1..4 "${flags[@]}" --out "$run" --wait >"$folder/out" 2>&1 & fleet=$!
  waits_for '[[ -n $(worker_of "$run" 0 2>/dev/null) ]]'
  kill -INT $fleet
  status=0; wait $fleet || status=$?
  [[ $status -eq 130 && -z $(squeue --noheader) ]] || fail "ended with $status: $(cat "$folder/out"; squeue)"
  [[ $(states "$run") == '0 done, 0 failed, 4 missing' ]] || fail "$(states "$run")"
  no_scratch_left
  ;;
esac
echo "$what: as wanted"
