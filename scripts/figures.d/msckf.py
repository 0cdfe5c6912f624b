"""msckf: vo_tracker in mode msckf on the drives of ../shared/data, and its filter on simulated drives (tracks without
pixels, build/release/bin/msckf_drives)."""
import bisect
import csv
import json
import math
import resource
import statistics

from support import Skipped, root_mean_square

STAGE = "vo_tracker"
CHANNEL = "POSE_VO"
SEEDS = 5
NEES_SEEDS = 50
UNCALIBRATED = ("malaga07_part1",)  # camera against IMU known to 15 deg and 0.3 s
EARTH_RADIUS_M = 6378137.0
LATENCIES_S = [0.05 * i for i in range(0, 31)]  # by which fixes are older than their stamps


def mode_msckf(vehicle):
    (vehicle / "vo_tracker.yaml").write_text("mode: msckf\n")


def replayed(runs, drive):
    """(rows of the exported poses, CPU seconds of the replay) of a drive of ../shared/data."""

    def run():
        log, vehicle = runs.imported(drive)
        mode_msckf(vehicle)
        if drive in UNCALIBRATED:
            runs.roadfix("calibrate", "camera-imu", log, "--config", vehicle)
        out = runs.folder(drive, "msckf") / "out.lcm"
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        runs.roadfix("replay", log, "--stages", STAGE, "--config", vehicle, "--out", out)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        poses = out.with_suffix(".csv")
        runs.roadfix("export", out, "--channel", CHANNEL, "--format", "csv", "--out", poses)
        with open(poses, newline="") as file:
            rows = list(csv.DictReader(file))
        return rows, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime

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


def euroc(runs):
    rows, cpu_s = replayed(runs, "euroc_v101_first95")
    good = valid(rows)
    if not good:
        raise Skipped("no valid pose on euroc_v101_first95")
    frames = frames_of(runs, "euroc_v101_first95")
    start = min(frames[0], int(rows[0]["utime_us"]))
    return {
        "first": (int(good[0]["utime_us"]) - start) * 1e-6,
        "drift": math.dist(position(good[-1]), position(good[0])),
        "cpu": 1e3 * cpu_s / len(frames),
    }


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
    rows, _ = replayed(runs, drive)
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
