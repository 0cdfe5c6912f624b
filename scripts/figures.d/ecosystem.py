"""ecosystem: Roadfix among other tools. Each part adds its rows to MEASUREMENTS below its functions."""
import os
import resource
import subprocess
import sys

from support import Skipped

PYTHON_BYTES = 200_000_000
MCAP_BYTES = 1_000_000_000

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


def long_log(runs, size):
    """The demo drive and what every stage makes of it, one after the other until there are so many bytes."""

    def run():
        runs.work.mkdir(parents=True, exist_ok=True)
        out, whole = runs.work / "ecosystem_demo.lcm", runs.work / f"ecosystem_{size}.lcm"
        demo = runs.root / "logs" / "demo.lcm"
        runs.roadfix("replay", demo, "--stages", "wheel_odometry,gnss_ins_ekf,vo_tracker,imm_fusion", "--config", runs.root / "configs" / "demo",
                     "--out", out)
        both = demo.read_bytes() + out.read_bytes()
        with open(whole, "wb") as file:
            while file.tell() < size:
                file.write(both)
        return whole

    return runs.once(("ecosystem", size), run)


def python_mb_s(runs):
    """A log of 200 MB into arrays by python/roadfix_log, from a warm cache."""
    return float(runs.python(READ_ALL, long_log(runs, PYTHON_BYTES)))


def test_support(runs):
    """The modules of test/support, which the tests use too."""
    folder = str(runs.root / "test" / "support")
    if folder not in sys.path:
        sys.path.insert(0, folder)


def mcap_read(runs):
    """Messages of the demo log that the official reader gives back, by its index, with equal values."""
    test_support(runs)
    import mcap_check
    log, out = runs.root / "logs" / "demo.lcm", runs.folder("mcap") / "demo.mcap"
    runs.roadfix("export", log, "--format", "mcap", "--out", out)
    try:
        topics, _ = mcap_check.official(runs.root / "build" / "npm", out, "indexed")
    except mcap_check.Missing as missing:
        raise Skipped(str(missing)) from None
    same, total = mcap_check.compare(runs.root, log, topics)
    return same / total


def mcap_mb_s(runs):
    """A log of 1 GB with all stages' outputs to MCAP, which goes to /dev/null: bytes read over CPU time."""
    log = long_log(runs, MCAP_BYTES)
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    with open(os.devnull, "wb") as nothing:
        command = [str(runs.program("roadfix")), "export", str(log), "--format", "mcap", "--out", "-"]
        done = subprocess.run(command, stdout=nothing, check=False)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    size = log.stat().st_size
    log.unlink()
    if done.returncode != 0:
        raise Skipped(f"roadfix export ended with {done.returncode}")
    return size / 1e6 / (after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)


def rosbag_values(runs):
    """The demo drive's sensor messages to ROS 1 (plain and bz2), rosbag2 sqlite3 and MCAP bags and back in by import."""
    test_support(runs)
    import ros_bags
    folder = runs.folder("rosbag")
    stream, expected = ros_bags.messages(runs.root, runs.root / "logs" / "demo.lcm")
    equal, total = 0, 0
    for bag in ros_bags.write_all(folder, stream).values():
        log = folder / "back.lcm"
        log.unlink(missing_ok=True)
        runs.roadfix("import", bag, "--out", log)
        one, every = ros_bags.equal_values(expected, ros_bags.found_in(runs.root, log))
        equal, total = equal + one, total + every
    return equal / total


MEASUREMENTS = {"python_mb_s": python_mb_s, "mcap_read": mcap_read, "mcap_mb_s": mcap_mb_s, "rosbag_values": rosbag_values}
