"""simulator: how fast drives with known truth are made. On a machine that does other things too, wall time says little: the CPU
time that `--timing` prints goes to standard error beside it."""
import re
import statistics
import sys

from support import Skipped

REPEATS = 3


def long_city_xrt(runs):
    """Half an hour of city streets without camera, written to a log; seconds of data over wall time, median of three."""
    factors = []
    for _ in range(REPEATS):
        log = runs.folder("long_city") / "drive.lcm"
        text = runs.roadfix("simulate", "long_city", "--seed", 1, "--duration", 1800, "--out", log, "--timing")
        found = re.search(r"([0-9.]+) s simulated and written in ([0-9.]+) s: .* ([0-9.]+) s of CPU", text)
        if not found:
            raise Skipped("roadfix simulate did not print its time")
        print(f"simulator.long_city_xrt: {found.group(3)} s of CPU, {float(found.group(1)) / float(found.group(3)):.0f} x "
              "on a core of its own", file=sys.stderr)
        factors.append(float(found.group(1)) / float(found.group(2)))
        log.unlink()
    return statistics.median(factors)


def stereo_fps(runs):
    """Stereo pairs of 1241x376 a second, drawn, exposed, written as JPEG into a log; 2 threads, 20 s of city_loop from a
    cold start (the world and its trees are in the time), median of three."""
    rates = []
    for _ in range(REPEATS):
        log = runs.folder("stereo") / "drive.lcm"
        text = runs.roadfix("simulate", "city_loop", "--seed", 1, "--duration", 20, "--stereo", "--camera-rate-hz", 10,
                            "--picture-size", "1241x376", "--threads", 2, "--out", log, "--timing")
        found = re.search(r"([0-9]+) exposures: ([0-9.]+) a second, ([0-9.]+) s of CPU each", text)
        if not found:
            raise Skipped("roadfix simulate did not print its time")
        print(f"simulator.stereo_fps: {found.group(3)} s of CPU a pair, {2.0 / float(found.group(3)):.1f} a second on two cores "
              "of its own", file=sys.stderr)
        rates.append(float(found.group(2)))
        log.unlink()
    return statistics.median(rates)


MEASUREMENTS = {"long_city_xrt": long_city_xrt, "stereo_fps": stereo_fps}
