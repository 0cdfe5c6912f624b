"""gnss_ins: the GNSS/INS EKF on the drives of ../shared/data and on simulated ones."""
import csv
import statistics

from support import Skipped

STAGES = "gnss_ins_ekf"
CHANNEL = "POSE_INS"
NO_WHEELS = ("without=wheels",)
ADIS_PHASES = (0, 30, 60, 90, 120, 150)
YAW_STARTS_S = (100, 260, 420, 580, 740, 900, 1060, 1220)
YAW_AFTER_S = 60.0
NEES_SEEDS = 50


def adis(runs, *words):
    return runs.scored(CHANNEL, STAGES, "adis_semisim", *words)


def adis_window(length, *words):
    return lambda runs: runs.windows(CHANNEL, STAGES, "adis_semisim", length, 300, 180, ADIS_PHASES, *words)


def car_window(length, every, phases):
    return lambda runs: runs.windows(CHANNEL, STAGES, "car_0708", length, 60, every, phases)


def spikes(runs):
    words = ("spike_m=20", "every_fix=90", "azimuth_seed=1")
    return adis(runs, *words, *NO_WHEELS)["errors"]["horizontal_m"]["rmse"]


def biased(runs, *words):
    """Five fixes 15 m off after each 30 s window; the outages themselves count as well."""
    cut = ("cut_gnss_s=30", "every_s=180", "after_s=300", "phase_s=0")
    bias = ("bias_m=15", "fixes=5", "azimuth_seed=1")
    return adis(runs, *cut, *bias, *words)["errors"]["horizontal_m"]


def moving_starts(runs):
    """Start times, s after the first fix, at which the car moves: the next time above 5 m/s from each listed one."""
    with open(runs.drive("adis_semisim") / "wheels.csv", newline="") as file:
        rows = [(int(row["utime_us"]), abs(float(row["speed_mps"]))) for row in csv.DictReader(file)]
    first = rows[0][0]
    for start in YAW_STARTS_S:
        yield next(round((t - first) * 1e-6, 1) for t, v in rows if t >= first + start * 1e6 and v > 5.0)


def yaw_unknown_deg(runs):
    """Yaw error 60 s of driving after a start in motion, heading unknown; the worst of eight starts."""
    worst = 0.0
    for start in moving_starts(runs):
        words = (f"start_after_s={start}", f"score_skip_s={YAW_AFTER_S}", *NO_WHEELS)
        ((_, folder),) = runs.recorded(STAGES, "adis_semisim", *words)
        with open(folder / "report" / f"{CHANNEL}_errors.csv", newline="") as file:
            row = next(csv.DictReader(file), None)
        if row is None:
            raise Skipped(f"no pose is scored after a start at {start} s")
        worst = max(worst, abs(float(row["yaw_deg"])))
    return worst


def car_1hz(runs):
    return runs.scored(CHANNEL, STAGES, "car_0708", "gnss_every=4")


def nees(runs):
    """NEES per degree of freedom of pose and velocity, mean over 50 simulated drives of two minutes."""
    ratios = []
    for channels, _ in runs.fleet(STAGES, "city_loop", NEES_SEEDS, "duration_s=120"):
        honesty = channels[CHANNEL]["honesty"]
        ratios.append((6 * honesty["pose"]["nees_per_dof"] + 3 * honesty["velocity_mps"]["nees_per_dof"]) / 9)
    return statistics.mean(ratios)


MEASUREMENTS = {
    "adis_h_m": lambda runs: adis(runs, *NO_WHEELS)["errors"]["horizontal_m"]["rmse"],
    "adis_yaw_deg": lambda runs: adis(runs, *NO_WHEELS)["errors"]["yaw_deg"]["rmse"],
    "adis_wheels_h_m": lambda runs: adis(runs)["errors"]["horizontal_m"]["rmse"],
    "adis_wheels_yaw_deg": lambda runs: adis(runs)["errors"]["yaw_deg"]["rmse"],
    "adis_imu_60s_m": adis_window(60, *NO_WHEELS),
    "adis_wheels_30s_m": adis_window(30),
    "adis_wheels_60s_m": adis_window(60),
    "adis_spikes_h_m": spikes,
    "adis_biased_h_m": lambda runs: biased(runs)["rmse"],
    "adis_biased_max_m": lambda runs: biased(runs)["max"],
    "adis_biased_imu_h_m": lambda runs: biased(runs, *NO_WHEELS)["rmse"],
    "adis_yaw_unknown_deg": yaw_unknown_deg,
    "car_15s_m": car_window(15, 60, (0, 10, 20, 30, 40, 50)),
    "car_30s_m": car_window(30, 90, (0, 15, 30, 45, 60, 75)),
    "car_60s_m": car_window(60, 120, (0, 20, 40, 60, 80, 100)),
    "nees": nees,
    "cost_us": lambda runs: runs.benchmark("gnss_ins_bench", "cpu_per_imu_sample_s") * 1e6,
    "car_1hz_h_m": lambda runs: car_1hz(runs)["errors"]["horizontal_m"]["rmse"],
    "car_within_3sigma": lambda runs: car_1hz(runs)["honesty"]["position_m"]["within_3sigma"],
}
