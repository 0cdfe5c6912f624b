#!/usr/bin/env python3
"""Is the navigation filter as good as it claims in cars that nobody chose? Simulated drives whose sensors are drawn at random, each told honestly.

  tools/experiments/random_cars.py [--cars N] [--first K] [--out FOLDER] [--jobs N]

Draws for each car the road, grade, rate and mounting of the imu, the receiver's kind, rate, noise, multipath, lever arm and latencies, and the wheels'
layout, signs, rate, scale, noise and steps; simulates, replays and scores it on roadfix fleet. Prints medians over the cars, the share of positions within
three sigma by kinds of car, and the cars that claim too much. Multipath is what no receiver tells: its share of the claimed sigma is a column.
"""
import argparse
import json
import random
import re
import statistics
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent
ROADFIX = ROOT / "build/release/bin/roadfix"
STAGES = "wheel_odometry,gnss_ins_ekf,imm_fusion"
ROADS = {"city_loop": 160, "highway": 150, "car_park": 150, "cold_start_moving": 120}  # s
RECEIVERS = {"rtk_fixed": (0.01, 0.03), "rtk_float": (0.1, 0.5), "single": (0.7, 3.0)}  # m, horizontal sigma


def draw(seed):
    """A scenario as YAML, and its kind by column."""
    dice = random.Random(seed)

    def between(least, most):
        return least * (most / least) ** dice.random()

    road = dice.choice(list(ROADS))
    receiver = dice.choice(["rtk_fixed", "rtk_float", "single", "single"])
    sigma = between(*RECEIVERS[receiver])
    multipath = dice.choice([0.0, 0.5, 1.0])
    mounting = dice.choice([0.0, 0.005, 0.02, 0.05])
    rate, late = dice.choice([1, 1, 5, 10]), dice.choice([0.0, 0.0, 0.1, 0.3])
    layout, step = dice.choice(["none", "one_speed", "four_speeds", "four_speeds"]), dice.choice([0.0, 0.0, 0.06, 0.28])
    lines = [
        f"scenario: {road}", f"name: car_{seed}", f"duration_s: {ROADS[road]}",
        "imu:", f"  rate_hz: {dice.choice([50, 100, 200])}",
        f"  gyro_noise_radps_per_rthz: {between(5e-5, 1e-3):.3g}", f"  accel_noise_mps2_per_rthz: {between(5e-4, 1e-2):.3g}",
        f"  gyro_bias_std_radps: {between(3e-4, 0.07):.3g}", f"  accel_bias_std_mps2: {between(0.01, 0.3):.3g}",
        f"  gyro_scale_std: {between(5e-4, 5e-3):.3g}", f"  accel_scale_std: {between(5e-4, 5e-3):.3g}",
        f"  mounting_std_rad: [{mounting}, {mounting}, {mounting}]",
        f"  position_m: [{dice.uniform(-0.5, 1.5):.2f}, {dice.uniform(-0.5, 0.5):.2f}, {dice.uniform(0, 1):.2f}]",
        "gnss:", f"  rate_hz: {rate}", f"  fix_type: {receiver}", f"  sigma_horizontal_m: {sigma:.3g}", f"  sigma_up_m: {2 * sigma:.3g}",
        f"  multipath_sigma_m: {multipath * sigma:.3g}", f"  multipath_correlation_s: {between(5, 60):.3g}",
        f"  sigma_velocity_mps: {between(0.03, 0.3):.3g}",
        f"  lever_arm_m: [{dice.uniform(-1.5, 1.5):.2f}, {dice.uniform(-0.5, 0.5):.2f}, {dice.uniform(0.5, 1.8):.2f}]",
        f"  lever_arm_std_m: {dice.choice([0.0, 0.02, 0.1])}",
        f"  position_latency_s: {dice.choice([0.0, 0.0, 0.05, 0.15])}", f"  velocity_latency_s: {late}",
        "wheels:", f"  layout: {layout}", f"  signs: {dice.choice(['signed', 'gear', 'unsigned'])}", f"  rate_hz: {dice.choice([10, 20, 50, 100])}",
        f"  speed_scale_std: {between(0.002, 0.03):.3g}", f"  speed_noise_mps: {between(0.01, 0.1):.3g}", f"  resolution_mps: {step}",
        "mag:", "  rate_hz: 0",
    ]  # fmt: skip
    kind = {"road": road, "receiver": receiver, "multipath": multipath, "mounting_rad": mounting, "gnss_hz": rate, "velocity_late_s": late,
            "wheels": layout, "step_mps": step if layout != "none" else 0.0}  # fmt: skip
    return "\n".join(lines) + "\n", kind


def run(folder, cars, jobs):
    drives = []
    for seed in cars:
        (folder / f"car_{seed}.yaml").write_text(draw(seed)[0])
        drives += [str(folder / f"car_{seed}.yaml"), f"seeds={seed}", "camera=none"]
    words = [ROADFIX, "fleet", "run", *drives, "--stages", STAGES, "--channel", "POSE_INS", "--keep", "none", "--engine", "local", "--out", folder / "run", "--overwrite"]
    done = subprocess.run([*map(str, words), *(["--jobs", str(jobs)] if jobs else [])], check=False)
    if done.returncode == 2:
        sys.exit(2)


def results(folder):
    found = []
    for path in sorted((folder / "run" / "tasks").glob("*/result.json")):
        result = json.loads(path.read_text())
        channel = result.get("figures", {}).get("channels", {}).get("POSE_INS", {})
        if result["status"] != "ok" or not channel.get("scored"):
            print(f"no pose: {result['name']}", file=sys.stderr)
            continue
        seed = int(re.search(r"car_(\d+)", result["figures"]["drive"]["name"]).group(1))
        honest, errors = channel["honesty"], channel["errors"]["horizontal_m"]
        found.append({"seed": seed, **draw(seed)[1], "nees": honest["position_m"]["nees_per_dof"], "within": honest["position_m"]["within_3sigma"],
                      "attitude_nees": honest["attitude_deg"]["nees_per_dof"], "attitude_within": honest["attitude_deg"]["within_3sigma"],
                      "rmse_m": errors["rmse"], "most_m": errors["max"]})  # fmt: skip
    return found


def report(found):
    def line(name, some):
        print(f"{name:28} {len(some):4} {statistics.median(r['nees'] for r in some):6.2f} {statistics.mean(r['nees'] for r in some):6.2f} "
              f"{statistics.mean(r['within'] for r in some):8.3f}")  # fmt: skip

    print(f"{'cars':33} NEES/3: median, mean, within 3 sigma")
    line("all", found)
    for column in draw(0)[1]:
        for value in sorted({r[column] for r in found}):
            line(f"{column} {value}", [r for r in found if r[column] == value])
    print(f"attitude: NEES/3 {statistics.median(r['attitude_nees'] for r in found):.2f} median, within 3 sigma {statistics.mean(r['attitude_within'] for r in found):.3f}")
    print("claim too much:")
    for r in sorted(found, key=lambda r: -r["nees"])[:12]:
        kind = " ".join(f"{column} {r[column]}" for column in draw(0)[1])
        print(f"  car_{r['seed']}: NEES {r['nees']:.1f}, {r['rmse_m']:.3f} m RMS, {r['most_m']:.2f} m at most; {kind}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cars", type=int, default=100, metavar="N", help="how many")
    parser.add_argument("--first", type=int, default=1, metavar="K", help="seed of the first")
    parser.add_argument("--out", type=Path, default=ROOT / "out" / "random_cars", metavar="FOLDER", help="what is made (default: out/random_cars)")
    parser.add_argument("--jobs", type=int, metavar="N", help="drives at a time (default: one a core)")
    arguments = parser.parse_args()
    if not ROADFIX.exists():
        sys.exit(f"{ROADFIX} is missing: scripts/build release")
    arguments.out.mkdir(parents=True, exist_ok=True)
    run(arguments.out, range(arguments.first, arguments.first + arguments.cars), arguments.jobs)
    found = results(arguments.out)
    if not found:
        sys.exit("no car has a pose")
    report(found)


if __name__ == "__main__":
    main()
