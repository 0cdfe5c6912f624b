"""roadfix paper on the first 20 s of the demo drive, as a user calls it. Arguments: repository, roadfix program."""
import csv
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

PROGRAM = Path(sys.argv.pop(2)).resolve()
ROOT = Path(sys.argv.pop(1)).resolve()
VEHICLE = ROOT / "configs/demo"


def roadfix(*arguments):
    return subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, text=True, check=False, timeout=600)


def rows_of(path):
    with open(path, newline="") as file:
        return {row[0]: row[1:] for row in csv.reader(file)}


class Paper(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.temporary = tempfile.TemporaryDirectory()
        cls.folder = Path(cls.temporary.name)
        cls.drive = cls.folder / "drive.lcm"
        done = roadfix("log", "cut", ROOT / "logs/demo.lcm", "--to-s", "20", "--out", cls.drive)
        if done.returncode != 0:
            raise RuntimeError(done.stderr)

    @classmethod
    def tearDownClass(cls):
        cls.temporary.cleanup()

    def run_paper(self, letter, *flags):
        """Standard output and the folder; what every experiment leaves is checked here."""
        out = self.folder / letter
        words = ("paper", letter, self.drive, "--config", VEHICLE, "--out", out, *flags)
        done = roadfix(*words)
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        self.assertEqual(done.stdout.splitlines()[-1], str(out / "paper.html"))
        page = (out / "paper.html").read_text()
        for fetching in ("<link", "src=", "@import", "fetch(", "https://", "@DATA@"):
            self.assertNotIn(fetching, page)
        again = roadfix(*words)
        self.assertEqual(again.returncode, 2)
        self.assertIn("paper.html: is there already; --overwrite replaces it", again.stderr)
        return done.stdout, out

    def test_a(self):
        text, out = self.run_paper("a", "--front-end", "klt,orb")
        rows = rows_of(out / "table_1.csv")
        self.assertEqual(list(rows), ["odometry", *(f"{before}{name}{after}" for name in ("KLT", "ORB")
                                                    for before, after in (("", ""), ("EKF ", ", literal"), ("EKF ", ", motion model")))])
        for name in ("KLT", "ORB"):
            raw, literal, motion = (float(rows[row][0]) for row in (name, f"EKF {name}, literal", f"EKF {name}, motion model"))
            self.assertAlmostEqual(literal, raw, 6)  # taken literally it is the identity
            self.assertNotAlmostEqual(motion, raw, 5)
            self.assertGreater(float(rows[f"EKF {name}, literal"][2]), 0.7)  # trace
            self.assertLess(float(rows[f"EKF {name}, literal"][3]), 5.0)  # s until it settles
        done = roadfix("paper", "a", self.drive, "--config", VEHICLE, "--front-end", "klt", "--with-wheels", "--out", self.folder / "lengths")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("vision with the wheels' lengths", done.stdout)
        self.assertNotEqual(rows_of(self.folder / "lengths/table_1.csv")["KLT"][0], rows["KLT"][0])
        # What is left out is as if the drive did not have it.
        without = self.folder / "without.lcm"
        self.assertEqual(roadfix("log", "filter", self.drive, "--channel", "WHEELS", "--invert", "--out", without).returncode, 0)
        done = roadfix("paper", "a", without, "--config", VEHICLE, "--front-end", "klt", "--out", self.folder / "without")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(rows_of(self.folder / "without/table_1.csv")["KLT"], rows["KLT"])
        self.assertEqual(len(rows_of(out / "sensitivity.csv")), 26)
        self.assertIn("SuperPoint 2.911", text)
        done = roadfix("paper", "a", self.drive, "--config", VEHICLE, "--front-end", "superpoint", "--out", self.folder / "learned")
        self.assertEqual(done.returncode, 2)
        self.assertRegex(done.stderr, r"^roadfix paper a: superpoint needs a network: --network-model, or network_model in vo_tracker\.yaml\n$")

    def test_b(self):
        text, out = self.run_paper("b", "--least-turn-deg", "15")
        rows = rows_of(out / "table_accuracy.csv")
        self.assertEqual(list(rows), ["estimate", "vision alone", "wheels and IMU", "modified, (14), (15)", "default, Mahalanobis"])
        for name in list(rows)[1:]:
            self.assertIn(name, text)
            self.assertLess(float(rows[name][0]), 5.0, name)  # 250 m
        seconds = rows_of(out / "errors_by_time.csv")
        self.assertGreater(len(seconds), 15)
        self.assertNotIn("errors_by_time", text)
        self.assertEqual(len(rows_of(out / "figure_8.csv")), 2)  # one turn of 28 deg
        # A threshold of nothing refuses every picture: the scheme is the wheels.
        done = roadfix("paper", "b", self.drive, "--config", VEHICLE, "--out", out, "--overwrite", "--threshold", "0")
        self.assertEqual(done.returncode, 0, done.stderr)
        strict = rows_of(out / "table_accuracy.csv")
        self.assertEqual(strict["modified, (14), (15)"][2], strict["wheels and IMU"][2])
        self.assertNotEqual(rows["modified, (14), (15)"][2], rows["wheels and IMU"][2])
        self.assertGreater(int(strict["modified, (14), (15)"][7]), 0)

    def test_c(self):
        text, out = self.run_paper("c")
        accuracy, transitions = rows_of(out / "table_1.csv"), rows_of(out / "table_2.csv")
        self.assertEqual(len(accuracy), 12)
        self.assertEqual(len(transitions), 10)
        self.assertIn("no GNSS outage", text)
        self.assertEqual(transitions["literal"][0], "")
        self.assertEqual(transitions["literal, one model"][3], "")
        self.assertNotEqual(accuracy["fusion, literal"], accuracy["fusion, literal, fixed R"])
        slowless = self.folder / "slowless"
        done = roadfix("paper", "c", self.drive, "--config", VEHICLE, "--out", slowless, "--remove-slow-s", "5")
        self.assertEqual(done.returncode, 0, done.stderr)
        rows = rows_of(slowless / "table_1.csv")
        self.assertLess(float(rows.pop("VIO, similarity, slower than 5 s removed")[0]), float(rows["VIO, similarity"][0]))
        self.assertEqual(rows, accuracy)
        alone = self.folder / "alone"
        done = roadfix("paper", "c", self.drive, "--config", VEHICLE, "--out", alone, "--independent")
        self.assertEqual(done.returncode, 0, done.stderr)
        rows = rows_of(alone / "table_1.csv")
        self.assertNotEqual(rows["GNSS/INS"], accuracy["GNSS/INS"])
        self.assertNotEqual(rows["VIO, similarity"], accuracy["VIO, similarity"])
        # Of poses that are recorded the same tables come out.
        poses = self.folder / "poses.lcm"
        stages = "gnss_ins_ekf,vo_tracker,wheel_odometry"
        self.assertEqual(roadfix("replay", self.drive, "--stages", stages, "--config", VEHICLE, "--out", poses).returncode, 0)
        again = roadfix("paper", "c", poses, "--config", VEHICLE, "--out", self.folder / "recorded")
        self.assertEqual(again.returncode, 0, again.stderr)
        self.assertEqual(rows_of(self.folder / "recorded/table_1.csv"), accuracy)

    def test_a_channel_that_is_missing_is_named(self):
        blind = self.folder / "blind.lcm"
        self.assertEqual(roadfix("log", "filter", self.drive, "--channel", "CAMERA.*", "--invert", "--out", blind).returncode, 0)
        for letter in "abc":
            done = roadfix("paper", letter, blind, "--config", VEHICLE, "--out", self.folder / "blind")
            self.assertEqual(done.returncode, 2)
            self.assertRegex(done.stderr, rf"^roadfix paper {letter}: .*blind\.lcm: no messages on channel CAMERA_LEFT, which .*\(there are .*GNSS.*\)\n$")
            self.assertFalse((self.folder / "blind").exists())


if __name__ == "__main__":
    unittest.main()
