"""papers: the experiment of Ock et al. (2020) by `roadfix paper b` on rendered drives: camera, wheels, IMU and magnetometer, no receiver."""
import csv

from support import Skipped, root_mean_square

SEEDS = range(1, 6)
DARK_FROM_S, DARK_S, AFTER_S = 30, 8, 20
LOCAL, WHEELS, VISION = "default, Mahalanobis", "wheels and IMU", "vision alone"


def table(path):
    """Rows of a CSV file by their first column, each a dictionary by the columns' names."""
    with open(path, newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    first = next(iter(rows[0])) if rows else ""
    return {row[first]: row for row in rows}


def experiment(runs, scenario, seed, *words):
    """The folder that `roadfix paper b` made of a simulated drive with one camera."""

    def run():
        folder = runs.folder("papers", scenario, seed)
        drive, vehicle = folder / "drive.lcm", folder / "vehicle"
        runs.roadfix("simulate", scenario, "--seed", seed, "--mono", "--picture-size", "640x192", *words, "--out", drive, "--vehicle", vehicle, "--overwrite")
        runs.roadfix("paper", "b", drive, "--config", vehicle, "--out", folder / "b", "--overwrite")
        drive.unlink()
        return folder / "b"

    return runs.once(("paper b", scenario, seed, words), run)


def number(row, column):
    if row is None or not row[column]:
        raise Skipped(f"no pose for {column}")
    return float(row[column])


def b_dark_m(runs):
    """Their setting, walking pace among things to see (right_angles), darkness of 8 s from 30 s on, while it moves: POSE_LOCAL's horizontal error 20 s after
    the light, tied where all have their first pose. No receiver shows the wheels' scale, known to 1 %: over 450 m of a city it alone makes 4 m."""
    at = DARK_FROM_S + DARK_S + AFTER_S
    words = ("--duration", at + 3, "--fault", f"camera.dark@{DARK_FROM_S}+{DARK_S}")
    return max(number(table(experiment(runs, "right_angles", seed, *words) / "errors_by_time.csv").get(str(at)), f"{LOCAL} m") for seed in SEEDS)


def b_corridor_ratio(runs):
    """RMS over the seeds of POSE_LOCAL's error at the end over the smaller of that of the wheels and that of vision alone."""
    rows = [table(experiment(runs, "corridor", seed) / "table_accuracy.csv") for seed in SEEDS]
    end = {name: root_mean_square(number(row[name], "end m") for row in rows) for name in (LOCAL, WHEELS)}
    seen = [row[VISION]["end m"] for row in rows]
    if all(seen):  # a vision that was lost in some drive has no error there, and is not the better one
        end[VISION] = root_mean_square(map(float, seen))
    return end[LOCAL] / min(end.get(name, float("inf")) for name in (WHEELS, VISION))


MEASUREMENTS = {"b_dark_m": b_dark_m, "b_corridor_ratio": b_corridor_ratio}
