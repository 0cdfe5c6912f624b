# For the tests of roadfix fleet: sourced, with $roadfix set. Makes $folder, which is gone afterwards.
folder=$(mktemp -d)
export TMPDIR=$folder/scratch ROADFIX_FLEET_ENGINE=local
mkdir "$TMPDIR"
fail() { echo "fleet: $*"; [[ -z ${run:-} || ! -d $run ]] || "$roadfix" fleet status "$run" || true; exit 1; }
field() { sed -n "s/.*\"$2\":\"\{0,1\}\([^\",}]*\).*/\1/p" "$1" | head -1; }        # field FILE KEY: its first value
result() { echo "$1/tasks/$(printf %06d "$2")/result.json"; }                       # result RUN INDEX
states() { { "$roadfix" fleet status "$1" || true; } | sed -n "1s/.* tasks: //p"; }          # "8 done, 0 failed, 0 missing"
told() { { "$roadfix" fleet status "$1" || true; } | grep -qE "$2"; }                       # told RUN REGEX
digests() { sed 's/.*"digests":{\([^}]*\)}.*/\1/' "$1"/tasks/*/result.json; }       # of all tasks, in their order
waits_for() { for _ in $(seq 600); do eval "$1" && return 0; sleep 0.05; done; [[ -z ${LOCAL_SLURM:-} ]] || { squeue -l; grep -vi debug "$LOCAL_SLURM/slurmctld.log" | tail -n 15; }; fail "waited in vain for: $1"; }
worker_of() { pgrep -P "$(sed 's/.*process \([0-9]*\),.*/\1/' "$1/tasks/$(printf %06d "$2")/lock")"; }  # worker_of RUN INDEX
no_scratch_left() { waits_for '[[ -z $(ls -A "$TMPDIR") ]]'; }
