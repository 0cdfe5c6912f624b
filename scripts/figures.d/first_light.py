"""first_light: a real drive in, a scored pose out."""
import re
import statistics

from support import Skipped

STAGES = "gnss_ins_ekf"
REPEATS = 5


def replay_xrt(runs):
    """Seconds of data over seconds of wall time of the whole replay, reading and writing included; median of five."""
    log, vehicle = runs.imported("car_0708")
    factors = []
    for _ in range(REPEATS):
        out = runs.folder("car_0708") / "timing.lcm"
        text = runs.roadfix("replay", log, "--stages", STAGES, "--config", vehicle, "--out", out, "--timing")
        found = re.search(r"of ([0-9.]+) s in ([0-9.]+) s", text)
        if not found:
            raise Skipped("roadfix replay did not print its time")
        factors.append(float(found.group(1)) / float(found.group(2)))
        out.unlink()
    return statistics.median(factors)


def car_h_m(runs):
    return runs.scored("POSE_INS", STAGES, "car_0708")["errors"]["horizontal_m"]["rmse"]


MEASUREMENTS = {"replay_xrt": replay_xrt, "car_h_m": car_h_m}
