"""navigation: the one filter. Its camera on simulated drives (tracks without pixels, build/release/bin/navigation_tracks) and on drawn ones, whose logs
are kept in build/figures/pictures: drawing a drive takes a minute."""
import csv
import json
import math
import re
import shutil
import statistics

import navigation_sensors
from support import Skipped, root_mean_square

SEEDS = 20
SCENARIO = "tunnel_lit"
CHANNEL = "POSE_INS"
DRAWN = {"640x192": range(101, 111), "1241x376": range(101, 106)}  # as shipped, and the size of KITTI's pictures
BLIND = "navigation: {sources: {camera: false}}\n"
LIBRARIES = ("inertial", "vehicle", "navigation", "wheel", "slam", "fusion")


def drives(runs, *flags):
    """The lines of navigation_tracks, one a seed."""

    def run():
        text = runs.call(runs.program("navigation_tracks"), SCENARIO, 1, SEEDS, *flags)
        return [json.loads(line) for line in text.splitlines()]

    return runs.once(("navigation_tracks", flags), run)


def tracks_lit(runs):
    """Horizontal error 50 to 60 s after the loss, pooled, with two eyes over without a camera."""
    pooled = [root_mean_square(d["h_last_m"] for d in drives(runs, "--eyes", eyes)) for eyes in (2, 0)]
    return pooled[0] / pooled[1]


def no_wheels(runs):
    return statistics.median(100 * d["h_end_m"] / d["way_m"] for d in drives(runs, "--eyes", 1, "--no-wheels"))


def drawn(runs, size, seed):
    """(log, vehicle folder) of the demo drive drawn at this size, with the tracker's settings of configs/demo."""
    folder = runs.folder("pictures") / f"demo_{size}_{seed}"
    log, vehicle = folder / "drive.lcm", folder / "vehicle"
    if not log.exists():
        folder.mkdir(parents=True, exist_ok=True)
        part = folder / "part.lcm"
        runs.roadfix("simulate", "demo", "--seed", seed, "--picture-size", size, "--out", part, "--vehicle", vehicle)
        part.rename(log)
    shutil.copy(runs.root / "configs" / "demo" / "vo_tracker.yaml", vehicle)
    return log, vehicle


def horizontal(row):
    return math.hypot(float(row["longitudinal_m"]), float(row["lateral_m"]))


def drive(runs, size, seed, camera):
    """(errors of the whole drive, those in the tunnel) of POSE_INS on one drawn drive, with or without the camera."""

    def run():
        log, vehicle = drawn(runs, size, seed)
        (vehicle / "gnss_ins_ekf.yaml").write_text("" if camera else BLIND)
        folder = runs.folder("pictures") / f"demo_{size}_{seed}" / ("camera" if camera else "blind")
        folder.mkdir(exist_ok=True)
        out, report = folder / "out.lcm", folder / "report"
        runs.roadfix("replay", log, "--stages", "vo_tracker,gnss_ins_ekf" if camera else "gnss_ins_ekf", "--config", vehicle, "--out", out)
        runs.roadfix("evaluate", out, "--out", report, "--channel", CHANNEL)
        out.unlink()
        (outage,) = json.loads((report / "figures.json").read_text())["channels"][CHANNEL]["outages"]["each"]
        with open(report / f"{CHANNEL}_errors.csv", newline="") as file:
            rows = list(csv.DictReader(file))
        tunnel = [row for row in rows if outage["first_withheld_us"] <= int(row["utime_us"]) <= outage["return_us"]]
        if not tunnel:
            raise Skipped(f"demo at {size}, seed {seed}: no pose in the tunnel")
        return rows, tunnel

    return runs.once(("drawn", size, seed, camera), run)


def tunnels_ratio(runs, size):
    """Horizontal RMSE of the tunnels, pooled, with the camera over without."""
    pooled = [root_mean_square(horizontal(row) for seed in DRAWN[size] for row in drive(runs, size, seed, camera)[1]) for camera in (True, False)]
    return pooled[0] / pooled[1]


def worst_drive(runs):
    def whole(size, seed, camera):
        return root_mean_square(map(horizontal, drive(runs, size, seed, camera)[0]))

    return max(whole(size, seed, True) / whole(size, seed, False) for size, seeds in DRAWN.items() for seed in seeds)


def nees_pictures(runs):
    """Mean normalised squares of place (east and north) and of yaw in the tunnel: of the two the one that is farther from one."""
    size = "640x192"
    rows = [row for seed in DRAWN[size] for row in drive(runs, size, seed, True)[1]]

    def square(row, name):
        return (float(row[name]) / float(row["std_" + name])) ** 2

    place = statistics.mean(0.5 * (square(row, "longitudinal_m") + square(row, "lateral_m")) for row in rows)
    yaw = statistics.mean(square(row, "yaw_deg") for row in rows)
    return max((place, yaw), key=lambda nees: abs(math.log(nees)))


def frame_ms(runs):
    return statistics.median(d["frame_ms"] for d in drives(runs, "--eyes", 2))


def tunables(runs):
    """Configuration keys (a visitor's number, integer, boolean, choice, text or vector) and named constants with a value of their own; indices of
    states and sizes of arrays (int kName at namespace scope in a header) are none."""
    keys = re.compile(r'\bv\.(?:number|integer|boolean|choice|text|vector|numbers)\(\s*"')
    constants = re.compile(r"^\s*(?:static |inline )*constexpr (?!std::array|char|auto k\w+ = \[)[\w:<>, ]+ (k[A-Z]\w*) ?[={(]", re.M)
    more = re.compile(r", (k[A-Z]\w*) = ")
    total = 0
    for library in LIBRARIES:
        for path in sorted((runs.root / "lib" / library).rglob("*")):
            if path.suffix not in (".h", ".cpp"):
                continue
            text = path.read_text()
            total += len(keys.findall(text))
            for line in text.splitlines():
                if path.suffix == ".h" and re.match(r"inline constexpr int k", line):
                    continue
                if constants.match(line):
                    total += 1 + len(more.findall(line.split("//")[0]))
    return total


def malaga(runs):
    """Nine windows of 20 s without fixes, from second 14 on, against the fixes, the receiver's constant latency fitted."""
    cut = ("cut_gnss_s=20", "every_s=100", "after_s=14", f"phase_s={','.join(str(i) for i in range(9))}")
    ends = []
    for channels, _ in runs.recorded("vo_tracker,gnss_ins_ekf", "malaga07_part1", *cut, fit_latency=True):
        outages = channels[CHANNEL]["outages"]
        if outages["missing"]:
            raise Skipped("an outage ends without an estimate")
        ends += [outage["horizontal_m"] for outage in outages["each"]]
    return root_mean_square(ends)


FIRST_VALID = """
import math, sys
import roadfix_log
pose = roadfix_log.read(sys.argv[1], [sys.argv[2]])[sys.argv[2]]
valid = pose.utime[pose.validity == pose.constants["VALIDITY_VALID"]]
print((valid[0] - pose.utime[0]) * 1e-6 if len(valid) else math.inf)
"""


def first_valid_s(runs, log, vehicle, out, stages):
    """From the log's first pose, whose car moves already, to the first valid one, in enu or in a local frame."""
    runs.roadfix("replay", log, "--stages", stages, "--config", vehicle, "--out", out)
    first = float(runs.python(FIRST_VALID, out, CHANNEL))
    out.unlink()
    return first


def start_s(runs):
    """Both cars move from the first sample on. The second has no camera: it knows its heading before pictures could help."""
    folder = runs.folder("navigation_start")
    log, vehicle = runs.imported("malaga07_part1")
    runs.roadfix("simulate", "cold_start_moving", "--no-camera", "--out", folder / "drive.lcm", "--vehicle", folder / "vehicle", "--overwrite")
    malaga = first_valid_s(runs, log, vehicle, folder / "malaga.lcm", "vo_tracker,gnss_ins_ekf")
    return max(malaga, first_valid_s(runs, folder / "drive.lcm", folder / "vehicle", folder / "cold.lcm", "gnss_ins_ekf"))


MEASUREMENTS = {
    "demo_vs_ins": lambda runs: tunnels_ratio(runs, "640x192"),
    "demo_large_vs_ins": lambda runs: tunnels_ratio(runs, "1241x376"),
    "worst_drive_ratio": worst_drive,
    "tracks_lit_vs_ins": tracks_lit,
    "no_wheels_end_pct": no_wheels,
    "malaga_20s_m": malaga,
    "start_s": start_s,
    "nees_pictures": nees_pictures,
    "frame_ms": frame_ms,
    "tunables": tunables,
    **navigation_sensors.MEASUREMENTS,
}
