"""fleet: what roadfix fleet adds to the work of its tasks, and whether engine, order and interruption change anything. On a machine that does other things
too the first two rows say as much of that machine: what was measured goes to standard error beside them."""
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time

from support import Skipped

STAGES = "wheel_odometry,gnss_ins_ekf,imm_fusion"
CORES = 2
LONG_TASKS = 200
LONG_DRIVE_S = 3600  # 10 s of work and more
SHORT_TASKS = 60
SHORT = ("tunnel_dark", "duration_s=60", "camera=none")


def tell(key, text):
    print(f"fleet.{key}: {text}", file=sys.stderr)


def results(run):
    return [json.loads(path.read_text()) for path in sorted((run / "tasks").glob("*/result.json"))]


def words(runs, name, drives, *flags):
    run = runs.work / "fleet" / name
    shutil.rmtree(run, ignore_errors=True)
    return run, [runs.program("roadfix"), "fleet", "run", *drives, "--stages", STAGES, "--keep", "none", "--out", run, *flags]


def efficiency(runs):
    """CPU of the tasks over cores times wall; two cores at most, whatever the machine has."""
    drives = ("long_city", f"duration_s={LONG_DRIVE_S}", "camera=none", f"seeds=1..{LONG_TASKS}")
    run, command = words(runs, "efficiency", drives, "--engine", "local", "--jobs", CORES)
    cores = sorted(os.sched_getaffinity(0))[:CORES]
    begin = time.monotonic()
    runs.call("taskset", "-c", ",".join(map(str, cores)), *command)
    wall_s = time.monotonic() - begin
    costs = [result["cost"] for result in results(run)]
    cpu_s = sum(cost["cpu_s"] for cost in costs)
    hours = sum(cost["drive_s"] for cost in costs) / 3600
    load = os.getloadavg()[1]
    tell("efficiency", f"{len(costs)} tasks, {cpu_s / len(costs):.1f} s of CPU each, {wall_s:.0f} s of wall, {cpu_s / hours:.1f} s of CPU a drive-hour, "
         f"load {load:.1f}")
    if min(cost["wall_s"] for cost in costs) < 10.0:
        raise Skipped("a task took less than 10 s")
    return cpu_s / (len(cores) * wall_s)


def on_slurm(runs, command):
    """Runs it beside a Slurm of its own; its wall time in s."""
    begin_end = 'begin=$(date +%s.%N); "$@" >/dev/null; echo "wall $begin $(date +%s.%N)"'
    text = runs.call(runs.root / "scripts" / "local-slurm", "--cores", CORES, "bash", "-c", begin_end, "bash", *command, "--engine", "slurm", "--wait")
    if "skipped: " in text:
        raise Skipped(text.split("skipped: ")[1].splitlines()[0])
    begin, end = map(float, re.search(r"wall (\S+) (\S+)", text).groups())
    return end - begin


def slurm_overhead_s(runs):
    """An array task's place on a core, from one begin to the next, less what the task itself took."""
    run, command = words(runs, "slurm", (*SHORT, f"seeds=1..{SHORT_TASKS}"))
    wall_s = on_slurm(runs, command)
    itself_s = sum(result["cost"]["wall_s"] for result in results(run)) / SHORT_TASKS
    tell("slurm_overhead_s", f"{SHORT_TASKS} tasks of {itself_s:.2f} s in {wall_s:.1f} s on {CORES} cores")
    return CORES * wall_s / SHORT_TASKS - itself_s


def same_digests(runs):
    drives = ("tunnel_dark", "camera=none", "seeds=1..10")
    lists = {}
    for name, flags in {"local": (), "reversed": ("--reversed",), "parallel": ("--batch", 3)}.items():
        engine = "parallel" if name == "parallel" else "local"
        if engine == "parallel" and not shutil.which("parallel"):
            raise Skipped("GNU parallel is not installed")
        run, command = words(runs, name, drives, *flags)
        runs.call(*command, "--engine", engine)
        lists[name] = [result["figures"]["digests"] for result in results(run)]
    run, command = words(runs, "on_slurm", drives, "--batch", 2, "--reversed")
    on_slurm(runs, command)
    lists["slurm"] = [result["figures"]["digests"] for result in results(run)]
    known = [(drive, channel, digest) for drive, digests in enumerate(lists.pop("local")) for channel, digest in digests.items()]
    equal = [other[drive].get(channel) == digest for other in lists.values() for drive, channel, digest in known]
    tell("same_digests", f"{len(known)} digests of 10 drives, held against {', '.join(lists)}")
    return sum(equal) / len(equal)


def marks(run):
    """Which file each good result is."""
    paths = [path for path in sorted((run / "tasks").glob("*/result.json")) if json.loads(path.read_text())["status"] == "ok"]
    return {path: (path.stat().st_ino, path.stat().st_mtime_ns) for path in paths}


def resume_extra(runs):
    """A run of 40 drives, one of them bad, interrupted when ten have ended; then resumed until nothing is left but the bad one."""
    bad = runs.work / "fleet" / "bad.lcm"
    bad.parent.mkdir(parents=True, exist_ok=True)
    bad.write_text("no log")
    run, command = words(runs, "resume", (bad, *SHORT, "seeds=1..39"), "--engine", "local", "--jobs", CORES)
    process = subprocess.Popen(list(map(str, command)), cwd=runs.root, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    while process.poll() is None and len(list(run.glob("tasks/*/result.json"))) < 10:
        time.sleep(0.02)
    process.send_signal(signal.SIGINT)
    process.wait()
    before = marks(run)
    for _ in range(2):
        subprocess.run([runs.program("roadfix"), "fleet", "resume", run, "--engine", "local"], cwd=runs.root, capture_output=True, check=False)
    after = marks(run)
    tell("resume_extra", f"{len(before)} of 40 had ended well when it was interrupted, {len(after)} after two resumes")
    if not 5 <= len(before) < 39 or len(after) != 39:
        raise Skipped("the interruption did not leave a part, or the resume did not finish it")
    return sum(after[path] != mark for path, mark in before.items())


MEASUREMENTS = {"efficiency": efficiency, "slurm_overhead_s": slurm_overhead_s, "same_digests": same_digests, "resume_extra": resume_extra}
