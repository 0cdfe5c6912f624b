"""ecosystem: Roadfix among other tools. Each part adds its rows to MEASUREMENTS below its functions."""
import os
import shutil

from support import Skipped

LOG_BYTES = 200_000_000

# Prints the median over five times of bytes a second, every field of every message decoded.
READ_ALL = """
import os, statistics, sys, time
import roadfix_log
def read():
    begin = time.perf_counter()
    log = roadfix_log.read(sys.argv[1], ["*"])
    assert not log.damage and not log.unknown and not any(log[name].broken for name in log)
    return time.perf_counter() - begin
read()
print(os.path.getsize(sys.argv[1]) / statistics.median(read() for _ in range(5)) / 1e6)
"""


def python_with_numpy(runs):
    """Debian's Python first, which python3-numpy belongs to."""
    for program in ("/usr/bin/python3", shutil.which("python3")):
        if program and os.path.exists(program):
            try:
                runs.call(program, "-c", "import numpy")
                return program
            except Skipped:
                continue
    raise Skipped("no Python with numpy (Debian: python3-numpy)")


def long_log(runs):
    """The demo drive and what every stage makes of it, one after the other until there are 200 MB."""

    def run():
        runs.work.mkdir(parents=True, exist_ok=True)
        out, whole = runs.work / "ecosystem_demo.lcm", runs.work / "ecosystem_long.lcm"
        demo = runs.root / "logs" / "demo.lcm"
        runs.roadfix("replay", demo, "--stages", "wheel_odometry,gnss_ins_ekf,vo_tracker,imm_fusion", "--config", runs.root / "configs" / "demo",
                     "--out", out)
        both = demo.read_bytes() + out.read_bytes()
        with open(whole, "wb") as file:
            while file.tell() < LOG_BYTES:
                file.write(both)
        return whole

    return runs.once("ecosystem_long", run)


def python_mb_s(runs):
    """A log of 200 MB into arrays by python/roadfix_log, from a warm cache."""
    python = python_with_numpy(runs)
    return float(runs.call("env", f"PYTHONPATH={runs.root / 'python'}", python, "-c", READ_ALL, long_log(runs)))


MEASUREMENTS = {"python_mb_s": python_mb_s}
