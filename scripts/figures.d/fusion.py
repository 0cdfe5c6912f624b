"""fusion: POSE_FUSED and POSE_LOCAL with the shipped configurations: through outages of simulated drives and of adis_semisim, on the demo drive drawn
(pictures, one eye, 640x192), without GNSS, and with the INS dead. Drawn drives are kept in build/figures/pictures."""
import csv
import json
import math
import shutil
import statistics
import sys
from concurrent.futures import ThreadPoolExecutor

from support import Skipped

CHANNEL = "POSE_FUSED"
BLIND = "wheel_odometry,gnss_ins_ekf,imm_fusion"  # wheels and IMU alone
SEEDS = range(1, 21)
# Where figures.tsv asks for no number of seeds: the median of 20 of these ratios scatters by a third.
MANY_SEEDS = range(1, 201)
LEAST_AVAILABILITY = 0.99
TICK_US = 100_000  # of the errors
LATEST_START_US = 500_000  # after POSE_INS
# The fixes after the tunnel begin 4 m off and come back with 3 s (scenario tunnel_*: gnss.reacquire); they are good once that is
# within three of the sigmas of 0.3 m that they claim. Two more at 5 Hz make three.
THIRD_GOOD_FIX_US = int(3e6 * math.log(4 / (3 * 0.3))) + 400_000
SETTLED_M = 0.3


def stamps(folder, channel):
    with open(folder / "report" / f"{channel}_errors.csv", newline="") as file:
        return [int(row["utime_us"]) for row in csv.DictReader(file)]


def check_available(folder, drive):
    """A channel that is silent where it is hard does not count. Before POSE_INS has found itself nobody knows the place; from
    then on until POSE_LOCAL's end POSE_FUSED must be there."""
    fused, first, last = stamps(folder, CHANNEL), stamps(folder, "POSE_INS")[0], stamps(folder, "POSE_LOCAL")[-1]
    available = len(fused) / ((last - first - LATEST_START_US) / TICK_US + 1)
    if available < LEAST_AVAILABILITY:
        raise Skipped(f"{drive}: available {available:.3f} of the time, 0.99 is asked for")


def two_at_a_time(drive, runs, seeds):
    with ThreadPoolExecutor(2) as pool:
        return list(pool.map(lambda seed: drive(runs, seed), seeds))


def dark_drives(runs):
    """(figures of all channels, folder) on tunnel_dark with many seeds, in their order. POSE_WHEEL has no ENU frame: it takes yaw and position over from
    the reference once, at the last pose before the loss."""
    drives = runs.fleet(BLIND, "tunnel_dark", len(MANY_SEEDS), aligned=(("POSE_WHEEL", "tied"),))
    for seed, (_, folder) in zip(MANY_SEEDS, drives):
        check_available(folder, f"tunnel_dark, seed {seed}")
    return drives


def dark(runs):
    """The figures of the fused channel on those."""
    return runs.once("tunnel_dark", lambda: [channels[CHANNEL] for channels, _ in dark_drives(runs)])


def lit_drive(runs, seed):
    """The figures of all channels on tunnel_lit, the tracker on tracks without pixels (tools/experiments/fusion_tracks.cpp): stereo, with
    the fusion's restarts. POSE_VO and POSE_WHEEL are tied as in dark_drives()."""
    folder = runs.folder("tunnel_lit", seed)
    log, vehicle, out, report = folder / "drive.lcm", folder / "vehicle", folder / "out.lcm", folder / "report"
    runs.roadfix("simulate", "tunnel_lit", "--seed", seed, "--no-camera", "--out", log, "--vehicle", vehicle, "--overwrite")
    runs.call(runs.program("fusion_tracks"), "tunnel_lit", seed, log, vehicle, out)
    runs.roadfix("evaluate", out, "--out", report)
    channels = json.loads((report / "figures.json").read_text())["channels"]
    for channel in ("POSE_VO", "POSE_WHEEL"):
        runs.roadfix("evaluate", out, "--out", report, "--channel", channel, "--align", "tied")
    log.unlink()
    out.unlink()
    check_available(folder, f"tunnel_lit, seed {seed}")
    return channels


def lit(runs):
    """lit_drive() of all seeds."""
    return runs.once("tunnel_lit", lambda: two_at_a_time(lit_drive, runs, SEEDS))


def lit_end_pct(runs):
    each = [outage for channels in lit(runs) for outage in channels[CHANNEL]["outages"]["each"]]
    return statistics.median(100 * o["horizontal_m"] / o["distance_m"] for o in each)


def outages(runs):
    for figures in dark(runs):
        yield from figures["outages"]["each"]


def dark_end_pct(runs):
    return statistics.median(100 * o["horizontal_m"] / o["distance_m"] for o in outages(runs))


def transition_ratio(runs):
    """Largest error within 5 s of loss or return over the error at the outage's end; median of many seeds."""
    return statistics.median(o["transition_peak_m"] / o["horizontal_m"] for o in outages(runs))


def return_settle_s(runs):
    """From the third good fix after an outage until the horizontal error is below 0.3 m; worst is never: the seeds' median."""
    times = []
    for channels, folder in dark_drives(runs):
        for outage in channels[CHANNEL]["outages"]["each"]:
            third = outage["return_us"] + THIRD_GOOD_FIX_US
            path = folder / "report" / f"{CHANNEL}_errors.csv"
            with open(path, newline="") as file:
                rows = [row for row in csv.DictReader(file) if int(row["utime_us"]) >= third]
            near = (row for row in rows if math.hypot(float(row["longitudinal_m"]), float(row["lateral_m"])) < SETTLED_M)
            settled = next(near, None)
            times.append((int(settled["utime_us"]) - third) * 1e-6 if settled else math.inf)
    return statistics.median(times)


def of_seeds(runs):
    """dark() of the 20 seeds that figures.tsv asks for where it asks for a number."""
    return dark(runs)[: len(SEEDS)]


def nees(runs):
    def ratio(honesty):
        return (6 * honesty["pose"]["nees_per_dof"] + 3 * honesty["velocity_mps"]["nees_per_dof"]) / 9

    each = [ratio(figures["honesty"]) for figures in dark(runs)]
    error = statistics.stdev(each) / math.sqrt(len(each))
    print(f"figures: fusion.nees: {statistics.mean(each):.4g} +- {error:.2g} of {len(each)} seeds", file=sys.stderr)
    return statistics.mean(each[: len(SEEDS)])


def within_3sigma(runs):
    return statistics.mean(figures["honesty"]["position_m"]["within_3sigma"] for figures in of_seeds(runs))


def mpa_balanced_pct(runs):
    return statistics.mean(figures["mpa"]["balanced_percent"] for figures in dark(runs))


def adis_wheels_60s_m(runs):
    return runs.windows(CHANNEL, BLIND, "adis_semisim", 60, 300, 180, (0, 30, 60, 90, 120, 150))


DRAWN_SIZE = "640x192"
DRAWN_SEEDS = range(101, 111)
CITY_DURATION_S = 90  # of city_loop drawn, as long as the demo drive
WINDOW_US = 10_000_000
WINDOWS_APART_US = 2_500_000
DEAD = (30, 60)  # s after the log's begin: POSE_INS does not arrive


def drawn(runs, scenario, seed):
    """(log, vehicle folder) of a drive drawn as the demo drive is shipped, with the tracker's settings of configs/demo."""
    folder = runs.folder("pictures") / f"{scenario}_{DRAWN_SIZE}_{seed}"
    log, vehicle = folder / "drive.lcm", folder / "vehicle"
    if not log.exists():
        folder.mkdir(parents=True, exist_ok=True)
        part = folder / "part.lcm"
        extra = () if scenario == "demo" else ("--mono", "--camera-rate-hz", 10, "--duration", CITY_DURATION_S)
        runs.roadfix("simulate", scenario, "--seed", seed, "--picture-size", DRAWN_SIZE, *extra, "--out", part, "--vehicle", vehicle)
        part.rename(log)
    shutil.copy(runs.root / "configs" / "demo" / "vo_tracker.yaml", vehicle)
    return log, vehicle


def shipped_vehicle(vehicle, folder):
    """The vehicle's folder with no tuning but the demo's tracker: another measurement may have left its own beside it."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    for name in ("calibration.yaml", "vo_tracker.yaml"):
        shutil.copy(vehicle / name, folder / name)
    return folder


def horizontal_errors(path, reference):
    """{utime: (east, north, yaw)} of a report's errors, m and rad; `reference` has the truth's yaw."""
    found = {}
    with open(path, newline="") as file:
        for row in csv.DictReader(file):
            utime = int(row["utime_us"])
            if utime not in reference:
                continue
            c, s = math.cos(reference[utime][2]), math.sin(reference[utime][2])
            along, left = float(row["longitudinal_m"]), float(row["lateral_m"])
            found[utime] = (c * along - s * left, s * along + c * left, math.radians(float(row["yaw_deg"])))
    return found


def as_ins(ins, vo, reference, tie_us, times):
    """Squared errors of POSE_VO at `times`, tied at `tie_us` to the pose that POSE_INS has there. `ins`, `vo`: horizontal_errors(), the latter
    tied to the truth: the estimate at the tie moves and turns it."""
    east, north, yaw = ins[tie_us]
    squares = []
    for t in times:
        x, y = reference[t][0] - reference[tie_us][0], reference[t][1] - reference[tie_us][1]
        squares.append((vo[t][0] + east - yaw * y) ** 2 + (vo[t][1] + north + yaw * x) ** 2)
    return squares


def fused_drive(runs, seed):
    """Squared horizontal errors in the tunnel of POSE_FUSED, POSE_INS and POSE_VO: the last tied at the last good fix to the truth, which nobody in
    the car has, and (POSE_VO_AS_INS, no row) to POSE_INS there, which is what POSE_VO could have been used for."""

    def run():
        log, vehicle = drawn(runs, "demo", seed)
        folder = runs.folder("pictures") / f"demo_{DRAWN_SIZE}_{seed}" / "fusion"
        out, report = folder / "out.lcm", folder / "report"
        vehicle = shipped_vehicle(vehicle, folder / "vehicle")
        runs.roadfix("replay", log, "--stages", "wheel_odometry,gnss_ins_ekf,vo_tracker,imm_fusion", "--config", vehicle, "--out", out)
        squares, errors, reference = {}, {}, poses(runs, out, "REFERENCE")
        for channel, align in ((CHANNEL, "none"), ("POSE_INS", "none"), ("POSE_VO", "tied")):
            runs.roadfix("evaluate", out, "--out", report, "--channel", channel, "--align", align)
            (outage,) = json.loads((report / "figures.json").read_text())["channels"][channel]["outages"]["each"]
            with open(report / f"{channel}_errors.csv", newline="") as file:
                rows = [row for row in csv.DictReader(file) if outage["first_withheld_us"] <= int(row["utime_us"]) <= outage["return_us"]]
            squares[channel] = [float(row["longitudinal_m"]) ** 2 + float(row["lateral_m"]) ** 2 for row in rows]
            errors[channel] = horizontal_errors(report / f"{channel}_errors.csv", reference)
            if not rows:
                raise Skipped(f"demo, seed {seed}: no {channel} in the tunnel")
        ins, vo = errors["POSE_INS"], errors["POSE_VO"]
        times = [t for t in sorted(vo) if outage["first_withheld_us"] <= t <= outage["return_us"]]
        tie_us = max(t for t in vo if t in ins and t < outage["first_withheld_us"])
        squares["POSE_VO_AS_INS"] = as_ins(ins, vo, reference, tie_us, times)
        out.unlink()
        return squares

    return runs.once(("fused_drive", seed), run)


def ratio_to_best(drives, vision="POSE_VO"):
    """Root mean square of POSE_FUSED over that of the better of the two others, over all these drives."""
    pooled = {channel: math.sqrt(statistics.mean(s for drive in drives for s in drive[channel])) for channel in drives[0]}
    return pooled[CHANNEL] / min(pooled["POSE_INS"], pooled[vision])


def told(name, ratio):
    """The row's own figure, POSE_VO tied to the truth; the other one goes to stderr."""
    print(f"figures: fusion.{name}: {ratio('POSE_VO_AS_INS'):.4g} with POSE_VO tied to POSE_INS at the last good fix", file=sys.stderr)
    return ratio("POSE_VO")


def vs_best_pictures(runs):
    drives = [fused_drive(runs, seed) for seed in DRAWN_SEEDS]
    return told("vs_best_pictures", lambda vision: ratio_to_best(drives, vision))


def worst_drive_ratio(runs):
    drives = [fused_drive(runs, seed) for seed in DRAWN_SEEDS]
    return told("worst_drive_ratio", lambda vision: max(ratio_to_best([drive], vision) for drive in drives))


def poses(runs, log, channel):
    """{utime: (x, y, yaw, forward, left velocity)} of a channel's usable poses."""
    out = log.with_name("poses.csv")
    runs.roadfix("export", log, "--channel", channel, "--format", "csv", "--out", out)
    found = {}
    with open(out, newline="") as file:
        for row in csv.DictReader(file):
            if row["validity"] == "invalid":
                continue
            w, x, y, z = (float(row[name]) for name in ("qw", "qx", "qy", "qz"))
            yaw = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
            found[int(row["utime_us"])] = (float(row["x_m"]), float(row["y_m"]), yaw, float(row["vel_x_mps"]), float(row["vel_y_mps"]))
    return found


def motion(a, b):
    c, s = math.cos(a[2]), math.sin(a[2])
    return c * (b[0] - a[0]) + s * (b[1] - a[1]), -s * (b[0] - a[0]) + c * (b[1] - a[1])


def window_errors(estimate, reference):
    """(squared errors of the motion over 10 s, every 2.5 s; squared errors of the velocity), at the reference's times."""
    times = sorted(t for t in reference if t in estimate)
    ends, velocities, next_us = [], [], 0
    known = set(times)
    for t in times:
        velocities.append(sum((estimate[t][i] - reference[t][i]) ** 2 for i in (3, 4)))
        if t < next_us or t + WINDOW_US not in known:
            continue
        next_us = t + WINDOWS_APART_US
        (x, y), (x0, y0) = motion(estimate[t], estimate[t + WINDOW_US]), motion(reference[t], reference[t + WINDOW_US])
        ends.append((x - x0) ** 2 + (y - y0) ** 2)
    return ends, velocities


def local_drives(runs):
    """{channel: (squared window errors, squared velocity errors)} pooled over drawn drives without GNSS."""

    def run():
        pooled = {}
        for scenario in ("demo", "city_loop"):
            for seed in DRAWN_SEEDS:
                log, vehicle = drawn(runs, scenario, seed)
                folder = runs.folder("pictures") / f"{scenario}_{DRAWN_SIZE}_{seed}" / "no_gnss"
                blind, out = folder / "blind.lcm", folder / "out.lcm"
                vehicle = shipped_vehicle(vehicle, folder / "vehicle")
                runs.roadfix("log", "filter", log, "--channel", "GNSS", "--invert", "--out", blind, "--overwrite")
                runs.roadfix("replay", blind, "--stages", "wheel_odometry,gnss_ins_ekf,vo_tracker,imm_fusion", "--config", vehicle, "--out", out)
                blind.unlink()
                reference = poses(runs, out, "REFERENCE")
                for channel in ("POSE_LOCAL", "POSE_VO", "POSE_WHEEL", "POSE_INS"):
                    ends, velocities = window_errors(poses(runs, out, channel), reference)
                    for kept, new in zip(pooled.setdefault(channel, ([], [])), (ends, velocities)):
                        kept += new
                out.unlink()
        return pooled

    return runs.once("local_drives", run)


def local_ratio(runs, which):
    """POSE_LOCAL over the best of its inputs; an input that is there for less than half of the time is none."""
    pooled = {channel: squares[which] for channel, squares in local_drives(runs).items()}
    most = len(pooled["POSE_LOCAL"])
    inputs = [statistics.mean(s) for channel, s in pooled.items() if channel != "POSE_LOCAL" and len(s) > most / 2]
    return math.sqrt(statistics.mean(pooled["POSE_LOCAL"]) / min(inputs))


def failover_end_pct(runs):
    """gnss_ins_ekf dies at 30 s of the drawn demo drive, at the tunnel's mouth, and camera and wheels go on: error 30 s later over the distance, median."""
    shares = []
    for seed in DRAWN_SEEDS:
        log, vehicle = drawn(runs, "demo", seed)
        folder = runs.folder("pictures") / f"demo_{DRAWN_SIZE}_{seed}" / "failover"
        estimates, before, after, cut, out = (folder / f"{name}.lcm" for name in ("estimates", "before", "after", "cut", "out"))
        vehicle = shipped_vehicle(vehicle, folder / "vehicle")
        runs.roadfix("replay", log, "--stages", "wheel_odometry,gnss_ins_ekf,vo_tracker", "--config", vehicle, "--out", estimates)
        # The channel goes at DEAD[0] and the log ends at DEAD[1].
        runs.roadfix("log", "cut", estimates, "--to-s", DEAD[0], "--out", before, "--overwrite")
        runs.roadfix("log", "cut", estimates, "--from-s", DEAD[0], "--to-s", DEAD[1], "--out", after, "--overwrite")
        runs.roadfix("log", "filter", after, "--channel", "POSE_INS|INS_STATUS", "--invert", "--out", cut, "--overwrite")
        whole = folder / "whole.lcm"
        whole.write_bytes(before.read_bytes() + cut.read_bytes())
        runs.roadfix("replay", whole, "--stages", "imm_fusion", "--config", vehicle, "--out", out)
        runs.roadfix("evaluate", out, "--out", folder / "report", "--channel", CHANNEL)
        with open(folder / "report" / f"{CHANNEL}_errors.csv", newline="") as file:
            last = list(csv.DictReader(file))[-1]
        reference = poses(runs, out, "REFERENCE")
        begin = min(reference) + DEAD[0] * 1_000_000
        way = [reference[t] for t in sorted(reference) if begin <= t <= int(last["utime_us"])]
        distance = sum(math.dist(a[:2], b[:2]) for a, b in zip(way, way[1:]))
        shares.append(100 * math.hypot(float(last["longitudinal_m"]), float(last["lateral_m"])) / distance)
        for path in (estimates, before, after, cut, whole, out):
            path.unlink()
    return statistics.median(shares)


MEASUREMENTS = {
    "lit_end_pct": lit_end_pct,
    "dark_end_pct": dark_end_pct,
    "transition_ratio": transition_ratio,
    "return_settle_s": return_settle_s,
    "mpa_balanced_pct": mpa_balanced_pct,
    "nees": nees,
    "within_3sigma": within_3sigma,
    "adis_wheels_60s_m": adis_wheels_60s_m,
    "vs_best_pictures": vs_best_pictures,
    "worst_drive_ratio": worst_drive_ratio,
    "local_vs_best": lambda runs: local_ratio(runs, 0),
    "local_velocity_ratio": lambda runs: local_ratio(runs, 1),
    "failover_end_pct": failover_end_pct,
    "step_us": lambda runs: runs.benchmark("fusion_bench", "cpu_per_step_s") * 1e6,
}
