"""keyframe_tracker: the keyframe tracker on KITTI 00, on Malaga and on simulated tracks.

Run by itself it prints every front end on KITTI 00 (Kim and Kang's (2025) figures 5 to 7 and its table 1 for this clip):
  python3 scripts/figures.d/keyframe_tracker.py
CPU is the process's, all threads, keyframes and bundle adjustment included; decoding the pictures is measured apart.
"""
import re
import statistics
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

from support import Runs, Skipped  # noqa: E402

KITTI = "kitti_odometry_00_first200"
MALAGA = "malaga07_part1"
WEIGHTS = "superpoint_student_mbv1.onnx"
REPEATS = 3


def bench(runs, *flags, repeat=0):
    """The last line of the bench program on KITTI 00 as a dictionary; flags beyond the folder."""

    def run():
        text = runs.call(runs.program("keyframe_tracker_bench"), runs.drive(KITTI), *flags)
        line = text.strip().splitlines()[-1]
        found = dict(re.findall(r"(ate_se3|ate_sim3|cpu|p99|decode|matches|inliers|keyframes|sigma|rss) (\d+\.?\d*)", line))
        valid, frames = re.search(r"valid (\d+)/(\d+)", line).groups()
        return {key: float(value) for key, value in found.items()} | {"valid": int(valid), "frames": int(frames)}

    return runs.once(("bench", flags, repeat), run)


def stereo(runs):
    return bench(runs, "--count", "100")


def mono(runs):
    return bench(runs, "--mono")


def cpu_ms(runs, *flags):
    """Median of several runs: other load on the machine shows in the CPU time too."""
    return statistics.median(bench(runs, *flags, repeat=i)["cpu"] for i in range(REPEATS))


def malaga(runs):
    """Figures of POSE_VO on the drive, mono without aid, after Sim3 and the receiver's latency."""
    return runs.scored("POSE_VO", "vo_tracker", MALAGA, align=("POSE_VO", "sim3"), fit_latency=True)


def malaga_tracked(runs):
    """Share of the time that is scored (5 s after the drive's begin) with a valid pose."""
    return malaga(runs)["availability"]["valid"]


def malaga_shape_pct(runs):
    figures = malaga(runs)
    return 100.0 * figures["ate_rmse_m"] / figures["distance_m"]


def nees_lines(runs):
    def run():
        text = runs.call(runs.program("slam_drives_test"), "the covariance is*")
        return [float(value) for value in re.findall(r"^nees .*: (\d+\.\d+),", text, re.MULTILINE)]

    return runs.once(("nees",), run)


def nees(runs):
    values = nees_lines(runs)
    if not values:
        raise Skipped("slam_drives_test printed no NEES")
    return statistics.mean(values)


MEASUREMENTS = {
    "kitti00_stereo_ate_m": lambda runs: stereo(runs)["ate_se3"],
    "kitti00_stereo_shape_m": lambda runs: stereo(runs)["ate_sim3"],
    "kitti00_stereo_cpu_ms": lambda runs: cpu_ms(runs, "--count", "100"),
    "kitti00_mono_ate_m": lambda runs: mono(runs)["ate_sim3"],
    "kitti00_mono_cpu_ms": lambda runs: cpu_ms(runs, "--mono"),
    "rss_mb": lambda runs: max(stereo(runs)["rss"], mono(runs)["rss"]),
    "malaga_tracked": malaga_tracked,
    "malaga_shape_pct": malaga_shape_pct,
    "nees": nees,
}


def print_table(runs):
    """Every front end, stereo and mono; a front end without its weights is left out."""
    print("| front end | eyes | tracked | matches | inliers | ATE m | sigma m | CPU ms | p99 ms | keyframes | RSS MB |")
    print("|---|---|---|---|---|---|---|---|---|---|---|")
    for kind in ("klt", "orb", "sift", "superpoint"):
        flags = ["--set", f"kind={kind}"]
        if kind == "superpoint":
            weights = runs.shared / "models" / WEIGHTS
            if not weights.exists():
                continue
            flags += ["--weights", str(weights)]
        for eyes, extra, ate in (("stereo", ["--count", "100"], "ate_se3"), ("mono", ["--mono"], "ate_sim3")):
            b = bench(runs, *extra, *flags)
            print(f"| {kind} | {eyes} | {b['valid']}/{b['frames']} | {b['matches']:.3f} | {b['inliers']:.3f} | "
                  f"{b[ate]:.3f} | {b['sigma']:.3f} | {b['cpu']:.1f} | {b['p99']:.1f} | {b['keyframes']:.0f} | {b['rss']:.0f} |", flush=True)


if __name__ == "__main__":
    print_table(Runs(Path(__file__).resolve().parents[2], time.monotonic() + 45 * 60))
