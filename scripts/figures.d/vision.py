"""vision: the keyframe tracker on drawn drives (tools/experiments/vision_drives.cpp)."""
import re
import sys

from support import Skipped

SEEDS = ("101", "110")


def yaw_bias_deg(runs):
    """Size of the mean over ten demo drives, 640x192, one eye, of the yaw lost in the tunnel; the library's tracker with the wheels'
    lengths. Its standard error goes to standard error."""
    text = runs.call(runs.program("vision_drives"), "demo", *SEEDS, "--from", "31", "--to", "59.5")
    found = re.search(r"mean of 10: yaw ([-+0-9.]+) \+- ([0-9.]+) deg", text)
    if not found:
        raise Skipped("not all of the ten drives have poses")
    print(f"vision.yaw_bias_deg: {found.group(1)} +- {found.group(2)}", file=sys.stderr)
    return abs(float(found.group(1)))


MEASUREMENTS = {"yaw_bias_deg": yaw_bias_deg}
