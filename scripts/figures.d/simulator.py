"""simulator: how fast drives with known truth are made."""
import re
import statistics

from support import Skipped

REPEATS = 3


def long_city_xrt(runs):
    """Half an hour of city streets without camera, written to a log; seconds of data over wall time, median of three."""
    factors = []
    for _ in range(REPEATS):
        log = runs.folder("long_city") / "drive.lcm"
        text = runs.roadfix("simulate", "long_city", "--seed", 1, "--duration", 1800, "--out", log, "--timing")
        found = re.search(r"([0-9.]+) s simulated and written in ([0-9.]+) s", text)
        if not found:
            raise Skipped("roadfix simulate did not print its time")
        factors.append(float(found.group(1)) / float(found.group(2)))
        log.unlink()
    return statistics.median(factors)


MEASUREMENTS = {"long_city_xrt": long_city_xrt}
