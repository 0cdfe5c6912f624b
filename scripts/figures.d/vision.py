"""vision: the keyframe tracker on drawn drives: POSE_VO of the shipped demo log with each front end, and the library's tracker on drives drawn anew
(tools/experiments/vision_drives.cpp)."""
import json
import math
import re
import shutil
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


CITY_SEEDS = ("101", "103")
CITY_S = "90"  # of city_loop drawn as the demo drive is, and as long


def relative_nees(runs):
    """{(length, "place" or "turn"): NEES of relative poses} over the ten demo drives and three of city_loop, one eye, 640x192, pooled by their windows."""
    lens = ("--set", "focal_std=0.001", "--set", "radial_std=0.002")  # as in configs/demo
    drives = (("demo", *SEEDS, *lens), ("city_loop", *CITY_SEEDS, *lens, "--size", "640x192", "--rate", "10", "--duration", CITY_S))
    sums = {}
    for words in drives:
        text = runs.call(runs.program("vision_drives"), *words)
        for length, place, turn, count in re.findall(r"NEES over (5 s|30 s): place ([0-9.]+) turn ([0-9.]+) \((\d+) windows\)", text):
            for what, value in (("place", place), ("turn", turn)):
                total, weight = sums.get((length, what), (0.0, 0))
                sums[length, what] = total + float(value) * int(count), weight + int(count)
    return {key: total / weight for key, (total, weight) in sums.items()}


def nees_pictures(runs):
    """Of rotation and translation over 5 and over 30 s the one that is farthest from one."""
    nees = relative_nees(runs)
    print("vision.nees_pictures:", ", ".join(f"{what} over {length} {value:.2f}" for (length, what), value in nees.items()), file=sys.stderr)
    return max(nees.values(), key=lambda value: abs(math.log(value)))


def highway_5hz_tracked(runs):
    """Share of the pictures, the first included, with a pose."""
    text = runs.call(runs.program("vision_drives"), "highway", "101", "103", "--size", "1241x376", "--rate", "5")
    return float(re.search(r"tracked ([0-9.]+)", text).group(1))


def second_lap_ratio(runs):
    """Horizontal RMSE on the second lap, three drives pooled, aligned in yaw and place over the whole drive: loops closed over not. Tied at the
    first pose: to standard error."""
    text = runs.call(runs.program("vision_drives"), "city_loop", "101", "103", "--size", "640x192", "--rate", "10", "--laps")
    found = re.search(r"pooled: second laps: open (\S+) m, closed (\S+) m; tied at the first pose: open (\S+) m, closed (\S+) m", text)
    if not found:
        raise Skipped("no drive comes back")
    open_m, closed_m, tied_open_m, tied_closed_m = map(float, found.groups())
    print(f"vision.second_lap_ratio, tied at the first pose: {tied_closed_m / tied_open_m:.3f} ({tied_open_m} m, {tied_closed_m} m)", file=sys.stderr)
    return closed_m / open_m


FRONT_ENDS = ("klt", "orb", "sift", "superpoint")
WEIGHTS = "superpoint_student_mbv1.onnx"


def front_end(runs, kind):
    """Figures of POSE_VO on logs/demo.lcm with configs/demo and this front end."""

    def run():
        folder = runs.folder("front_end", kind)
        vehicle, out, report = folder / "vehicle", folder / "out.lcm", folder / "report"
        shutil.rmtree(vehicle, ignore_errors=True)
        shutil.copytree(runs.root / "configs" / "demo", vehicle)
        tuning = (vehicle / "vo_tracker.yaml").read_text() + f"  front_end: {{kind: {kind}}}\n"
        if kind == "superpoint":
            weights = runs.shared / "models" / WEIGHTS
            if not weights.exists():
                raise Skipped(f"../shared/models/{WEIGHTS} is not here")
            tuning += f"network_model: {weights.resolve()}\n"
        (vehicle / "vo_tracker.yaml").write_text(tuning)
        runs.roadfix("replay", runs.root / "logs" / "demo.lcm", "--stages", "wheel_odometry,gnss_ins_ekf,vo_tracker", "--config", vehicle, "--out", out)
        runs.roadfix("evaluate", out, "--out", report, "--channel", "POSE_VO")
        out.unlink()
        figures = json.loads((report / "figures.json").read_text())["channels"]["POSE_VO"]
        horizontal_m, within = figures["errors"]["horizontal_m"]["rmse"], figures["honesty"]["position_m"]["within_3sigma"]
        print(f"vision: {kind} {horizontal_m:.3f} m, within 3 sigma {within:.4f}", file=sys.stderr)
        return horizontal_m, within

    return runs.once(("front_end", kind), run)


MEASUREMENTS = {
    "yaw_bias_deg": yaw_bias_deg,
    "nees_pictures": nees_pictures,
    "highway_5hz_tracked": highway_5hz_tracked,
    "second_lap_ratio": second_lap_ratio,
    "worst_frontend_demo_m": lambda runs: max(front_end(runs, kind)[0] for kind in FRONT_ENDS),
    "worst_frontend_within_3sigma": lambda runs: min(front_end(runs, kind)[1] for kind in FRONT_ENDS),
}
