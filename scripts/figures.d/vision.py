"""vision: the keyframe tracker on drawn drives: POSE_VO of the shipped demo log with each front end, and the library's tracker on drives drawn anew
(tools/experiments/vision_drives.cpp)."""
import json
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
    "worst_frontend_demo_m": lambda runs: max(front_end(runs, kind)[0] for kind in FRONT_ENDS),
    "worst_frontend_within_3sigma": lambda runs: min(front_end(runs, kind)[1] for kind in FRONT_ENDS),
}
