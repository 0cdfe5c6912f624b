"""Rows of navigation: any subset of sensors, and poor ones. Without an IMU on simulated drives (build/release/bin/navigation_without_imu) and on a
recording; an IMU, a receiver's velocity and a lever arm worse than claimed on changed copies of recordings, under build/figures/copies."""
import csv
import json
import math
import shutil
import statistics

CHANNEL = "POSE_INS"
STAGES = "gnss_ins_ekf"
SEEDS = 10
TURN_ON_RADPS = 0.07
SMOOTHING_S = 1.0
LEVER_WRONG_M = (1.0, 0.0, 0.5)
CAR_60S = (60, 60, 120, (0, 20, 40, 60, 80, 100))
DRAG_OFF = ("duration_s=120", "camera=mono", "camera_rate_hz=10", "picture_size=640x192", "fault=gnss.ramp@60+30:east_mps=0.3")


def copied(runs, drive, name):
    """A copy of a recording's folder, to be changed."""
    folder = runs.folder("copies") / name
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(runs.drive(drive), folder)
    return folder


def changed_csv(path, change):
    """Rewrites a CSV file by change(rows), which may give other columns."""
    with open(path, newline="") as file:
        rows = list(csv.DictReader(file))
    rows = change(rows)
    with open(path, "w", newline="") as file:
        writer = csv.DictWriter(file, rows[0].keys(), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def changed_line(path, old, new):
    text = path.read_text()
    if text.count(old) != 1:
        raise ValueError(f"{path}: {text.count(old)} times {old!r}, not once")
    path.write_text(text.replace(old, new))


def small_cars(runs):
    """City loops without an IMU: one wheel speed and a yaw rate at 5 Hz, a single fix a second with 2 m of white noise and 2 m that last 8 s (each axis)."""

    def run():
        text = runs.call(runs.program("navigation_without_imu"), 1, SEEDS)
        return [json.loads(line) for line in text.splitlines()]

    return runs.once(("navigation_without_imu",), run)


def without_imu_ratio(runs):
    return statistics.mean(d["h_m"] / d["fixes_h_m"] for d in small_cars(runs))


def without_imu_30s(runs):
    return statistics.median(100 * error / way for d in small_cars(runs) for error, way in d["ends"])


def potsdamer(runs):
    return runs.scored(CHANNEL, STAGES, "potsdamer_part1")


def turn_on_ratio(runs):
    """A gyro that is off by TURN_ON_RADPS since turn-on, and a calibration that says so, over the drive as it is."""
    folder = copied(runs, "car_0708", "turn_on")

    def turn(rows):
        for row in rows:
            row["gyro_z_radps"] = f"{float(row['gyro_z_radps']) + TURN_ON_RADPS:.9f}"
        return rows

    (imu,) = folder.glob("imu.csv*")
    if imu.suffix == ".gz":
        runs.call("gunzip", imu)
        imu = imu.with_suffix("")
    changed_csv(imu, turn)
    changed_line(folder / "drive.yaml", "gyro_bias_std_radps: 3.5e-3", f"gyro_bias_std_radps: {TURN_ON_RADPS}")
    with_bias, as_it_is = (runs.windows(CHANNEL, STAGES, drive, *CAR_60S) for drive in (str(folder), "car_0708"))
    return with_bias / as_it_is


def smoothed_velocity_ratio(runs):
    """GNSS velocities through a first-order low pass, over none."""

    def smooth(rows):
        names, before = ("vel_e_mps", "vel_n_mps", "vel_u_mps"), None
        for row in rows:
            t = int(row["utime_us"]) * 1e-6
            value = [float(row[name]) for name in names]
            if before is not None:
                gain = 1 - math.exp(-(t - before[0]) / SMOOTHING_S)
                value = [old + gain * (new - old) for old, new in zip(before[1], value)]
            before = (t, value)
            row.update({name: f"{v:.6f}" for name, v in zip(names, value)})
        return rows

    def drop(rows):
        return [{key: value for key, value in row.items() if "vel" not in key} for row in rows]

    errors = []
    for name, change in (("smoothed", smooth), ("no_velocity", drop)):
        folder = copied(runs, "car_0708", name)
        changed_csv(folder / "gnss.csv", change)
        errors.append(runs.scored(CHANNEL, STAGES, str(folder))["errors"]["horizontal_m"]["rmse"])
    return errors[0] / errors[1]


def sparse_fixes_valid(runs):
    """The receiver gives four fixes a second; one in twenty is kept."""
    return runs.scored(CHANNEL, STAGES, "car_0708", "gnss_every=20", "score_skip_s=60")["availability"]["valid"]


def late_return_s(runs):
    """From the third fix after an outage until the error is below a metre: of all outages of all phases the 95th percentile."""
    length, first, every, phases = 30, 60, 90, (0, 15, 30, 45, 60, 75)
    words = ("gnss_every=4", f"cut_gnss_s={length}", f"every_s={every}", f"after_s={first}", f"phase_s={','.join(map(str, phases))}")
    times = []
    for channels, folder in runs.recorded(STAGES, "car_0708", *words):
        with open(folder / "report" / f"{CHANNEL}_errors.csv", newline="") as file:
            rows = [(int(row["utime_us"]), math.hypot(float(row["longitudinal_m"]), float(row["lateral_m"]))) for row in csv.DictReader(file)]
        for outage in channels[CHANNEL]["outages"]["each"]:
            third = outage["return_us"] + 2_000_000
            times.append(next(((t - third) * 1e-6 for t, error in rows if t >= third and error < 1.0), math.inf))
    return sorted(times)[math.ceil(0.95 * len(times)) - 1]


def lever_wrong_3sigma(runs):
    folder = copied(runs, "adis_semisim", "lever_wrong")
    wrong = [round(true + off, 3) for true, off in zip((-0.073, -0.302, -0.087), LEVER_WRONG_M)]
    changed_line(folder / "drive.yaml", "lever_arm_body_m: [-0.073, -0.302, -0.087]", f"lever_arm_body_m: {wrong}")
    return runs.scored(CHANNEL, STAGES, str(folder))["honesty"]["position_m"]["within_3sigma"]


def drag_off_m(runs):
    """The largest horizontal error of all drives, one eye and wheels beside the receiver that drifts off."""
    return max(channels[CHANNEL]["errors"]["horizontal_m"]["max"] for channels, _ in runs.fleet(f"vo_tracker,{STAGES}", "city_loop", SEEDS, *DRAG_OFF))


MEASUREMENTS = {
    "no_imu_h_ratio": without_imu_ratio,
    "no_imu_30s_pct": without_imu_30s,
    "potsdamer_h_m": lambda runs: potsdamer(runs)["errors"]["horizontal_m"]["rmse"],
    "potsdamer_within_3sigma": lambda runs: potsdamer(runs)["honesty"]["position_m"]["within_3sigma"],
    "turn_on_bias_ratio": turn_on_ratio,
    "smoothed_velocity_ratio": smoothed_velocity_ratio,
    "sparse_fixes_valid": sparse_fixes_valid,
    "lever_wrong_3sigma": lever_wrong_3sigma,
    "late_return_s": late_return_s,
    "drag_off_m": drag_off_m,
}
