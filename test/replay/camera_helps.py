#!/usr/bin/env python3
"""The camera in gnss_ins_ekf's navigation filter on the pictures of logs/demo.lcm: in the tunnel it helps or does nothing, and where it goes dark in the
tunnel, its stamps are 0.1 s late or its mounting is told wrong by two degrees it is never more than 5 % worse than without. vo_tracker follows the pictures
once.

  camera_helps.py ROADFIX VEHICLE_FOLDER LOG
"""
import csv
import json
import math
import shutil
import struct
import subprocess
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "support"))
import lcm_log  # noqa: E402

DEFAULT = ""
BLIND = "navigation: {sources: {camera: false}}\n"
DARK_AFTER_US = 35_000_000  # five seconds of tunnel
TURN = [math.cos(math.radians(1)), 0.0, 0.0, math.sin(math.radians(1))]  # half of two degrees, about the vertical


def product(a, b):
    w, x, y, z = a
    W, X, Y, Z = b
    return [w * W - x * X - y * Y - z * Z, w * X + x * W + y * Z - z * Y, w * Y - x * Z + y * W + z * X, w * Z + x * Y - y * X + z * W]


def changed(text, key, change):
    """The calibration with the last line of this key changed: the camera's stands behind the others'."""
    lines = text.splitlines()
    at = max(i for i, line in enumerate(lines) if line.strip().startswith(key + ":"))
    indent = lines[at][: len(lines[at]) - len(lines[at].lstrip())]
    lines[at] = change(lines[at].split(":", 1)[1].strip(), indent)
    return "\n".join(lines) + "\n"


def turned(text):
    def change(value, indent):
        q = product(TURN, json.loads(value))
        return f"{indent}q_wxyz: {q}"

    return changed(text, "q_wxyz", change)


def late(text):
    return changed(text, "time_offset_std_s", lambda value, indent: f"{indent}time_offset_s: 0.1\n{indent}time_offset_std_s: {value}")


def rms(values):
    values = list(values)
    return math.sqrt(sum(v * v for v in values) / len(values))


def write(path, events):
    """A log of (channel, timestamp, data), in the order of time."""
    with open(path, "wb") as file:
        for number, (channel, timestamp, data) in enumerate(sorted(events, key=lambda event: event[1])):
            name = channel.encode()
            file.write(struct.pack(">IqqII", lcm_log.MAGIC, number, timestamp, len(name), len(data)) + name + data)


class Car:
    def __init__(self, roadfix, vehicle, log, folder):
        self.roadfix, self.vehicle, self.folder = roadfix, Path(vehicle), Path(folder)
        self.log, self.dark = self.folder / "tracks.lcm", self.folder / "dark.lcm"
        out = self.folder / "followed.lcm"
        self.run("replay", log, "--stages", "vo_tracker", "--config", vehicle, "--out", out)
        sensors = [event for event in lcm_log.events(log) if not event[0].startswith("CAMERA_")]
        tracks = [event for event in lcm_log.events(out) if event[0] == "VO_FEATURES"]
        dark_from = min(timestamp for _, timestamp, _ in tracks) + DARK_AFTER_US
        write(self.log, sensors + tracks)
        write(self.dark, sensors + [event for event in tracks if event[1] < dark_from])

    def run(self, *words):
        subprocess.run([self.roadfix, *map(str, words)], check=True, stdout=subprocess.DEVNULL)

    def tunnel(self, name, config, change=lambda text: text, log=None):
        """Horizontal RMSE of POSE_INS without fixes, m."""
        vehicle, out, report = self.folder / name, self.folder / f"{name}_out.lcm", self.folder / f"{name}_report"
        shutil.copytree(self.vehicle, vehicle)
        calibration = vehicle / "calibration.yaml"
        calibration.write_text(change(calibration.read_text()))
        (vehicle / "gnss_ins_ekf.yaml").write_text(config)
        self.run("replay", log or self.log, "--stages", "gnss_ins_ekf", "--config", vehicle, "--out", out)
        self.run("evaluate", out, "--out", report, "--channel", "POSE_INS")
        (outage,) = json.loads((report / "figures.json").read_text())["channels"]["POSE_INS"]["outages"]["each"]
        with open(report / "POSE_INS_errors.csv", newline="") as file:
            rows = [r for r in csv.DictReader(file) if outage["first_withheld_us"] <= int(r["utime_us"]) <= outage["return_us"]]
        value = rms(math.hypot(float(r["longitudinal_m"]), float(r["lateral_m"])) for r in rows)
        print(f"{name}: {value:.3f} m in the tunnel")
        return value


def main(roadfix, vehicle, log):
    with tempfile.TemporaryDirectory() as folder:
        car = Car(roadfix, vehicle, log, folder)
        without = car.tunnel("without", BLIND)
        checks = {
            "the camera helps or does nothing": car.tunnel("with", DEFAULT) <= without,
            "it goes dark in the tunnel": car.tunnel("dark", DEFAULT, log=car.dark) <= 1.05 * without,
            "0.1 s late": car.tunnel("late", DEFAULT, late) <= 1.05 * without,
            "turned by two degrees": car.tunnel("turned", DEFAULT, turned) <= 1.05 * without,
            # The comparison can fail: called exact, a mounting that is not is believed.
            "turned, called exact": car.tunnel("exact", "navigation: {camera: {turn_floor_rad: 0}}\n", turned) > 1.05 * without,
        }
    failed = [name for name, holds in checks.items() if not holds]
    print(f"failed: {', '.join(failed)}" if failed else "all hold")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
