"""Tests of scripts/figures, scripts/readme-tables and scripts/drift, run by CTest with the repository's root as argument."""
import importlib.machinery
import importlib.util
import math
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

ROOT = Path(sys.argv.pop(1)).resolve()
sys.dont_write_bytecode = True


def load(name):
    loader = importlib.machinery.SourceFileLoader(name.replace("-", "_"), str(ROOT / "scripts" / name))
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader(loader.name, loader))
    loader.exec_module(module)
    return module


class Reach(unittest.TestCase):
    def test_the_three_forms(self):
        reached = load("figures").reached
        self.assertTrue(reached(3.0, "<=3"))
        self.assertFalse(reached(3.01, "<=3"))
        self.assertTrue(reached(0.99, ">=0.99"))
        self.assertFalse(reached(0.989, ">=0.99"))
        self.assertTrue(reached(1.0, "0.84..1.18"))
        self.assertFalse(reached(0.83, "0.84..1.18"))
        self.assertFalse(reached(1.19, "0.84..1.18"))

    def test_nan_reaches_nothing(self):
        reached = load("figures").reached
        for reach in ("<=3", ">=3", "0.8..1.2"):
            self.assertFalse(reached(float("nan"), reach))


class Drift(unittest.TestCase):
    REFERENCE = {0: ([0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]), 50: ([40.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0])}

    def test_what_is_lost_is_told_by_its_name(self):
        half = math.radians(1.0) / 2.0
        estimate = dict(self.REFERENCE)
        estimate[50] = ([40.5, -0.2, 0.0], [0.0, 0.0, math.sin(half), math.cos(half)])
        roll, pitch, yaw, across, along = load("drift").lost(estimate, self.REFERENCE, 0, 50)
        self.assertAlmostEqual(yaw, 1.0, places=4)
        self.assertAlmostEqual(across, -0.2)
        self.assertAlmostEqual(along, 0.5)
        self.assertAlmostEqual(abs(roll) + abs(pitch), 0.0)

    def test_the_frame_does_not_matter(self):
        turn = ([3.0, 4.0, 0.0], [0.0, 0.0, math.sin(0.3), math.cos(0.3)])
        drift = load("drift")
        moved = {k: ([a + b for a, b in zip(turn[0], drift.rotated(turn[1], p))], drift.product(turn[1], q))
                 for k, (p, q) in self.REFERENCE.items()}
        for value in drift.lost(moved, self.REFERENCE, 0, 50):
            self.assertAlmostEqual(value, 0.0)

    def test_a_slow_vehicle_is_left_out(self):
        reference = {0: self.REFERENCE[0], 50: ([10.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0])}
        self.assertIsNone(load("drift").lost(reference, reference, 0, 50))


class Measurements(unittest.TestCase):
    def test_every_measurement_is_a_row(self):
        table = ROOT / ".." / "shared" / "figures.tsv"
        if not table.exists():
            self.skipTest("../shared/figures.tsv is not here")
        figures = load("figures")
        ids = {row["id"] for row in figures.read_rows(table)}
        for path in (ROOT / "scripts" / "figures.d").glob("*.py"):
            if path.stem in ("browser", "live_stack", "navigation_sensors", "support"):
                continue
            for key in figures.load_measurements(path.stem):
                self.assertIn(f"{path.stem}.{key}", ids)


class Test(unittest.TestCase):
    def run_with(self, *flags):
        return subprocess.run([ROOT / "scripts" / "test", *flags], text=True, capture_output=True, check=False)

    def test_help_installs_and_builds_nothing(self):
        done = self.run_with("--help")
        self.assertEqual(done.returncode, 0)
        self.assertIn("--fuzz[=SECONDS]", done.stdout)

    def test_no_number_of_seconds(self):
        for seconds in ("", "abc", "0", "-3"):
            done = self.run_with(f"--fuzz={seconds}")
            self.assertEqual(done.returncode, 2)
            self.assertIn(f"'{seconds}'", done.stderr)


class ReadmeTables(unittest.TestCase):
    def run_on(self, text, measured, *flags):
        with tempfile.TemporaryDirectory() as folder:
            readme = Path(folder) / "README.md"
            readme.write_text(text)
            command = [sys.executable, ROOT / "scripts" / "readme-tables", "--readme", readme, *flags]
            done = subprocess.run(command, input=measured, text=True, capture_output=True, check=False)
            return readme.read_text(), done

    TEXT = (
        f"before\n<!-- figures all -->\n|{' figure | measured (wanted) |' * 4}\n|{'---|' * 8}\n"
        "| `first_light.car_h_m` | 0.2 m (<=0.15) | `gnss_ins.cost_us` | 2 us (<=10) | `gnss_ins.nees` | **0.7 ratio (0.8..1.3)** | `simulator.xrt` | 9 x (>=2) |\n"
        "<!-- end -->\nafter\n"
    )
    ROW = "first_light.car_h_m\t0.1\tm\t<=0.15\tyes\n"

    def test_a_measured_figure_replaces_its_own_and_no_other(self):
        text, _ = self.run_on(self.TEXT, self.ROW)
        self.assertEqual(text, self.TEXT.replace("0.2 m", "0.1 m"))

    def test_a_new_figure_stands_with_its_name_and_a_miss_in_bold(self):
        text, _ = self.run_on(self.TEXT, "first_light.xrt\t100\tx\t>=200\tno\n")
        self.assertIn("| `first_light.car_h_m` | 0.2 m (<=0.15) | `first_light.xrt` | **100 x (>=200)** | `gnss_ins.cost_us` | 2 us (<=10) | `gnss_ins.nees` |", text)
        self.assertIn("| `simulator.xrt` | 9 x (>=2) | | | | | | |\n", text)

    def test_a_skipped_figure_keeps_no_old_value(self):
        text, _ = self.run_on(self.TEXT, "gnss_ins.nees\t-\tratio\t0.8..1.3\tskipped\n")
        self.assertIn("| `gnss_ins.nees` | skipped (0.8..1.3) |", text)

    def test_without_rows_the_old_table_stays(self):
        text, _ = self.run_on(self.TEXT, "")
        self.assertEqual(text, self.TEXT)

    def test_check_changes_nothing_and_says_so(self):
        text, done = self.run_on(self.TEXT, self.ROW, "--check")
        self.assertEqual(text, self.TEXT)
        self.assertEqual(done.returncode, 1)

    def test_a_missing_marker_is_named(self):
        _, done = self.run_on("nothing\n", self.ROW)
        self.assertIn("no marker for figures", done.stderr)


if __name__ == "__main__":
    unittest.main()
