#!/usr/bin/env python3
"""How much does what a fault costs hang on the moment at which it comes? One fault at many moments of several drives, each replayed by the navigation filter.

  tools/experiments/fault_moments.py [FAULT ...] [--out FOLDER] [--build FOLDER] [--jobs N]

FAULT: ROAD:FAULT with an @ where the moment goes, such as city_loop:gnss.clock@+2:offset_s=0.4; without one the list below. Prints a line per fault: drives,
the median over them of the largest horizontal error, how many were more than 0.3 and 1 m off, the largest error, and the drive that had it.
"""
import argparse
import json
import statistics
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent
FAULTS = (
    "city_loop:gnss.clock@+2:offset_s=0.4", "city_loop:gnss.clock@+2:offset_s=-0.6", "city_loop:gnss.clock@", "city_loop:gnss.stuck@+20",
    "city_loop:gnss.ramp@+20:east_mps=0.3", "city_loop:gnss.bias@+20:north_m=3", "city_loop:wheels.clock@:offset_s=0.1",
    "highway:wheels.slip@+40:ratio=0.02", "highway:imu.bias@:accel_x_mps2=0.2",
)
DURATION_S, SEEDS = 100, "1..3"
MOMENTS = [40 + 0.7 * k for k in range(29)]  # s, at ten phases of a second


def largest_errors(roadfix, fault, run, jobs):
    """(largest horizontal error in m, words of the drive) of each drive, largest first; infinite where there is no result."""
    road, words = fault.split(":", 1)
    drives = [road, "camera=none", f"duration_s={DURATION_S}", f"seeds={SEEDS}", *(f"fault={words.replace('@', f'@{moment:g}', 1)}" for moment in MOMENTS)]
    done = subprocess.run([str(roadfix), "fleet", "run", *drives, "--stages", "gnss_ins_ekf", "--channel", "POSE_INS", "--keep", "none", "--out", str(run),
                           "--overwrite", *jobs], stdout=subprocess.DEVNULL, check=False)
    if done.returncode not in (0, 1):  # 1: single tasks have failed
        sys.exit(done.returncode)
    errors = []
    for line in (run / "tasks.jsonl").read_text().splitlines():
        task = json.loads(line)
        path = run / "tasks" / f"{task['index']:06}" / "result.json"
        result = json.loads(path.read_text()) if path.exists() else {"status": "missing"}
        error = result["figures"]["channels"]["POSE_INS"]["errors"]["horizontal_m"]["max"] if result["status"] == "ok" else float("inf")
        errors.append((error, " ".join(word for word in task["words"] if word.startswith(("seed", "fault")))))
    return sorted(errors, reverse=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("fault", nargs="*", default=FAULTS, help="ROAD:FAULT with an @ where the moment goes")
    parser.add_argument("--out", type=Path, default=ROOT / "build/fault_moments", help="the runs' folder")
    parser.add_argument("--build", type=Path, default=ROOT / "build/release", help="the build whose bin/roadfix runs")
    parser.add_argument("--jobs", help="as of roadfix fleet")
    arguments = parser.parse_args()
    roadfix = arguments.build / "bin/roadfix"
    if not roadfix.exists():
        sys.exit(f"{roadfix} is missing: scripts/build makes it")
    if wrong := [fault for fault in arguments.fault if fault.count("@") != 1 or ":" not in fault.split("@")[0]]:
        sys.exit(f"{wrong[0]}: not ROAD:FAULT with one @")
    arguments.out.mkdir(parents=True, exist_ok=True)
    print(f"{'fault':<42}{'drives':>7}{'median m':>10}{'> 0.3 m':>9}{'> 1 m':>7}{'largest m':>11}  of")
    for number, fault in enumerate(arguments.fault):
        errors = largest_errors(roadfix, fault, arguments.out / f"{number}", ("--jobs", arguments.jobs) if arguments.jobs else ())
        beyond = [sum(error > limit for error, _ in errors) for limit in (0.3, 1.0)]
        print(f"{fault:<42}{len(errors):>7}{statistics.median(error for error, _ in errors):>10.3f}{beyond[0]:>9}{beyond[1]:>7}{errors[0][0]:>11.2f}  {errors[0][1]}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
