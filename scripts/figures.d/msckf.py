"""msckf: vo_tracker in mode filter (the navigation filter without GNSS) on the drives of ../shared/data, and its filter on simulated drives (tracks without
pixels, build/release/bin/msckf_drives). CPU: build/release/bin/msckf_cost."""
import bisect
import csv
import json
import math
import shutil
import statistics

from support import Skipped, root_mean_square

STAGE = "vo_tracker"
CHANNEL = "POSE_VO"
SEEDS = 5
NEES_SEEDS = 50
UNCALIBRATED = ("malaga07_part1",)  # camera against IMU known to 15 deg and 0.3 s
EARTH_RADIUS_M = 6378137.0
LATENCIES_S = [0.05 * i for i in range(0, 31)]  # by which fixes are older than their stamps


def mode_filter(imported, vehicle):
    """The imported vehicle's folder stays as it is: others use it."""
    shutil.copytree(imported, vehicle, dirs_exist_ok=True)
    (vehicle / "vo_tracker.yaml").write_text("mode: filter\n")


def replayed(runs, drive):
    """(rows of the exported poses, log, vehicle) of a drive of ../shared/data."""

    def run():
        log, imported = runs.imported(drive)
        vehicle = runs.folder(drive, "msckf") / "vehicle"
        mode_filter(imported, vehicle)
        if drive in UNCALIBRATED:
            runs.roadfix("calibrate", "camera-imu", log, "--config", vehicle)
        out = runs.folder(drive, "msckf") / "out.lcm"
        runs.roadfix("replay", log, "--stages", STAGE, "--config", vehicle, "--out", out)
        poses = out.with_suffix(".csv")
        runs.roadfix("export", out, "--channel", CHANNEL, "--format", "csv", "--out", poses)
        with open(poses, newline="") as file:
            rows = list(csv.DictReader(file))
        return rows, log, vehicle

    return runs.once(("msckf", drive), run)


def valid(rows):
    return [row for row in rows if row["validity"] != "invalid"]


def position(row):
    return [float(row[key]) for key in ("x_m", "y_m", "z_m")]


def frames_of(runs, drive):
    folder = runs.drive(drive)
    listing = folder / "mav0" / "cam0" / "data.csv"
    with open(listing if listing.exists() else folder / "frames_left.csv") as file:
        stamps = [line.split(",")[0] for line in file if line[:1].isdigit()]
    return [int(s) // 1000 if len(s) > 16 else int(s) for s in stamps]


def truth_of(runs, drive):
    """(times us, positions, quaternions w first) of a EuRoC recording's motion capture."""
    with open(runs.drive(drive) / "mav0" / "state_groundtruth_estimate0" / "data.csv") as file:
        rows = [line.split(",") for line in file if line[:1].isdigit()]
    numbers = [[float(x) for x in row[1:8]] for row in rows]
    return [int(row[0]) // 1000 for row in rows], [n[:3] for n in numbers], [n[3:] for n in numbers]


def at(times, values, t):
    """Linear interpolation; t within times."""
    i = max(1, bisect.bisect_left(times, t))
    share = (t - times[i - 1]) / (times[i] - times[i - 1])
    return [a + share * (b - a) for a, b in zip(values[i - 1], values[i])]


def yaw_between(q, p):
    """Angle about the vertical of q p^-1."""
    w = sum(a * b for a, b in zip(q, p))
    z = -q[0] * p[3] + q[3] * p[0] - q[1] * p[2] + q[2] * p[1]
    return 2 * math.atan2(z, w)


def drift_from_truth(rows, truth):
    """How far the way from the first pose to the last one with truth is from the true one, m. The recording is picked
    up in its last second, after its last picture: the length of that way alone says nothing."""
    times, positions, attitudes = truth
    rows = [row for row in rows if times[0] <= int(row["utime_us"]) <= times[-1]]
    first, last = rows[0], rows[-1]
    begin, end = (int(row["utime_us"]) for row in (first, last))
    yaw = yaw_between([float(first[k]) for k in ("qw", "qx", "qy", "qz")], at(times, attitudes, begin))
    x, y, z = (b - a for a, b in zip(at(times, positions, begin), at(times, positions, end)))
    true_way = [math.cos(yaw) * x - math.sin(yaw) * y, math.sin(yaw) * x + math.cos(yaw) * y, z]
    return math.dist([b - a for a, b in zip(position(first), position(last))], true_way)


def cost_ms(runs, log, vehicle):
    """CPU of the stage per picture, pictures opened before; median of five runs."""
    program = runs.program("msckf_cost")
    return statistics.median(json.loads(runs.call(program, log, vehicle))["cpu_ms"] for _ in range(5))


def euroc(runs):
    drive = "euroc_v101_first95"

    def run():
        rows, log, vehicle = replayed(runs, drive)
        good = valid(rows)
        if not good:
            raise Skipped(f"no valid pose on {drive}")
        frames = frames_of(runs, drive)
        start = min(frames[0], int(rows[0]["utime_us"]))
        return {
            "first": (int(good[0]["utime_us"]) - start) * 1e-6,
            "drift": drift_from_truth(good, truth_of(runs, drive)),
            "cpu": cost_ms(runs, log, vehicle),
        }

    return runs.once(("euroc",), run)


def fixes_of(runs, drive):
    """(time s, east m, north m) of the GNSS fixes, about the first one."""
    with open(runs.drive(drive) / "gnss.csv", newline="") as file:
        rows = [(int(r["utime_us"]), float(r["lat_deg"]), float(r["lon_deg"])) for r in csv.DictReader(file)]
    _, lat0, lon0 = rows[0]
    north = EARTH_RADIUS_M * math.pi / 180
    east = north * math.cos(math.radians(lat0))
    return [(t * 1e-6, east * (lon - lon0), north * (lat - lat0)) for t, lat, lon in rows]


def between(rows, t, keys):
    """Linear interpolation of exported poses at time t, s; nothing outside of them."""
    times = rows["t"]
    i = bisect.bisect_left(times, t)
    if i == 0 or i == len(times) or times[i] - times[i - 1] > 0.5:
        return None
    share = (t - times[i - 1]) / (times[i] - times[i - 1])
    return [rows[k][i - 1] + share * (rows[k][i] - rows[k][i - 1]) for k in keys]


def aligned_rmse(pairs):
    """Root mean square of the distances after the best rotation and translation in the plane."""
    n = len(pairs)
    means = [sum(p[i] for p in pairs) / n for i in range(4)]
    centred = [[p[i] - means[i] for i in range(4)] for p in pairs]
    dot = sum(a * c + b * d for a, b, c, d in centred)
    cross = sum(a * d - b * c for a, b, c, d in centred)
    cos, sin = dot / math.hypot(dot, cross), cross / math.hypot(dot, cross)
    return root_mean_square(
        math.hypot(cos * a - sin * b - c, sin * a + cos * b - d) for a, b, c, d in centred
    )


def malaga(runs):
    drive = "malaga07_part1"
    rows, _, _ = replayed(runs, drive)
    good = valid(rows)
    if len(good) < 0.8 * len(rows):
        raise Skipped(f"{drive}: {len(good)} of {len(rows)} poses are valid")
    columns = {
        "t": [int(r["utime_us"]) * 1e-6 for r in good],
        "x": [float(r["x_m"]) for r in good],
        "y": [float(r["y_m"]) for r in good],
        "v": [math.hypot(float(r["vel_x_mps"]), float(r["vel_y_mps"])) for r in good],
    }
    fixes = fixes_of(runs, drive)

    def pairs(latency):
        seen = ((between(columns, t - latency, ("x", "y")), e, n) for t, e, n in fixes)
        return [(xy[0], xy[1], e, n) for xy, e, n in seen if xy]

    latency = min(LATENCIES_S, key=lambda delay: aligned_rmse(pairs(delay)))
    path = sum(math.dist(a[1:], b[1:]) for a, b in zip(fixes, fixes[1:]))
    speeds = []
    for i in range(len(fixes)):
        if not 1 < i < len(fixes) - 2:
            continue
        before, after = fixes[i - 2], fixes[i + 1]  # 3 s apart
        middle = 0.5 * (before[0] + after[0]) - latency
        speed = math.dist(before[1:], after[1:]) / (after[0] - before[0])
        own = between(columns, middle, ("v",))
        if own:
            speeds.append(own[0] - speed)
    return {
        "pct": 100 * aligned_rmse(pairs(latency)) / path,
        "speed": root_mean_square(speeds),
        "speed_max": max(abs(s) for s in speeds),
    }


def drives(runs, name, last, *flags):
    """The lines of msckf_drives for seeds 1 to last."""

    def run():
        text = runs.call(runs.program("msckf_drives"), name, 1, last, *flags)
        return [json.loads(line) for line in text.splitlines()]

    return runs.once(("msckf_drives", name, last, flags), run)


def median(runs, key, name, *flags):
    return statistics.median(drive[key] for drive in drives(runs, name, SEEDS, *flags))


MEASUREMENTS = {
    "euroc_first_pose_s": lambda runs: euroc(runs)["first"],
    "euroc_drift_m": lambda runs: euroc(runs)["drift"],
    "euroc_cpu_ms": lambda runs: euroc(runs)["cpu"],
    "malaga_pct": lambda runs: malaga(runs)["pct"],
    "malaga_speed_mps": lambda runs: malaga(runs)["speed"],
    "malaga_speed_max_mps": lambda runs: malaga(runs)["speed_max"],
    "city_drift_pct": lambda runs: median(runs, "drift_pct", "city"),
    "city_wheels_drift_pct": lambda runs: median(runs, "drift_pct", "city", "--wheels"),
    "turn_scale_pct": lambda runs: median(runs, "scale_pct", "turn"),
    "turn_scale_wheels_pct": lambda runs: median(runs, "scale_pct", "turn", "--wheels"),
    "nees": lambda runs: statistics.mean(drive["nees"] for drive in drives(runs, "short", NEES_SEEDS)),
}
