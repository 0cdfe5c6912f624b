"""any_machine: what a stranger's machine needs for the two commands and the inner loop. On a machine that does other things too, wall time says little:
the CPU time of all that was run goes to standard error beside it."""
import os
import re
import resource
import shutil
import subprocess
import sys
import time

from support import Skipped

ESTIMATORS = ("inertial", "vehicle", "navigation", "wheel", "slam", "fusion")


def tell(key, text):
    print(f"any_machine.{key}: {text}", file=sys.stderr)


def cpu_s():
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def minutes_of(runs, command, key):
    """What `command` says that it took: on a bare machine where shared/ has one made (root, debootstrap), packages included; otherwise in a clean clone,
    with the packages that are there. Never with a compiler cache."""
    left_s = runs.deadline - time.monotonic()
    if left_s < 60.0:
        raise Skipped("45 minutes are over")
    bare = runs.shared / "tools" / "bare-machine"
    clone = runs.work / "clean-clone"
    begin_s = cpu_s()
    if bare.exists() and os.geteuid() == 0 and shutil.which("debootstrap"):
        words, where, folder = [str(bare), command], "on a bare machine", runs.root
    else:
        shutil.rmtree(clone, ignore_errors=True)
        runs.call("git", "clone", "--quiet", str(runs.root), str(clone))
        words, where, folder = [f"./{command}"], "in a clean clone, packages not counted", clone
    try:
        done = subprocess.run(words, cwd=folder, env={**os.environ, "CCACHE_DISABLE": "1"}, capture_output=True, text=True, timeout=left_s)
    except subprocess.TimeoutExpired:
        raise Skipped(f"{command} did not end within the {left_s / 60.0:.0f} minutes left of 45") from None
    finally:
        shutil.rmtree(clone, ignore_errors=True)
    found = re.search(rf"^{command}: ([0-9.]+) min: (.*)$", done.stdout, re.MULTILINE)
    if not found or (done.returncode != 0 and command == "scripts/demo"):
        raise Skipped(f"{command} ended with {done.returncode} {where}: {(done.stderr or done.stdout).strip().splitlines()[-1:]}")
    tell(key, f"{where}: {found.group(2)}; {(cpu_s() - begin_s) / 60.0:.1f} min of CPU; status {done.returncode}")
    return float(found.group(1))


def loaded_failures(runs):
    """Tests of scripts/test that fail while two busy loops a core run beside them, as many at a time as there."""
    runs.program("roadfix")
    loops = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(2 * (os.cpu_count() or 1))]
    try:
        left_s = runs.deadline - time.monotonic()
        done = subprocess.run(["ctest", "--preset", "release", "-j", str((os.cpu_count() or 1) + 1)], cwd=runs.root, capture_output=True, text=True, timeout=max(1.0, left_s))
    except subprocess.TimeoutExpired:
        raise Skipped("the tests did not end within what is left of 45 minutes") from None
    finally:
        for loop in loops:
            loop.kill()
            loop.wait()
    found = re.search(r"([0-9]+) tests failed out of ([0-9]+)", done.stdout)
    if not found:
        raise Skipped("ctest gave no count of failures: are the tests built (scripts/build release)?")
    for line in done.stdout.split("The following tests FAILED:")[1:]:
        tell("loaded_failures", line.strip())
    return float(found.group(1))


def check_s(runs):
    """scripts/check of an estimator library after a change of its largest .cpp file, everything built before: of ESTIMATORS the slowest."""
    slowest_s = 0.0
    for name in ESTIMATORS:
        source = max((runs.root / "lib" / name).glob("*.cpp"), key=lambda path: path.stat().st_size)
        runs.call(runs.root / "scripts" / "check", name)  # warm
        text = source.read_text()
        begin, begin_s = time.monotonic(), cpu_s()
        try:
            source.write_text(f'{text}static_assert(true, "{time.time_ns()}");\n')  # new tokens, or the compiler cache would answer
            runs.call(runs.root / "scripts" / "check", name)
            took_s = time.monotonic() - begin
        finally:
            source.write_text(text)
        tell("check_s", f"{name}, {source.name} changed: {took_s:.0f} s, {cpu_s() - begin_s:.0f} s of CPU")
        slowest_s = max(slowest_s, took_s)
    return slowest_s


MEASUREMENTS = {
    "demo_min": lambda runs: minutes_of(runs, "scripts/demo", "demo_min"),
    "test_min": lambda runs: minutes_of(runs, "scripts/test", "test_min"),
    "loaded_failures": loaded_failures,
    "check_s": check_s,
}
