"""roadfix replay, evaluate and export on the demo drive, as a user calls them. Arguments: repository, roadfix program."""
import csv
import json
import math
import subprocess
import sys
import tempfile
import unittest
from xml.etree import ElementTree
from pathlib import Path

PROGRAM = Path(sys.argv.pop(2)).resolve()
ROOT = Path(sys.argv.pop(1)).resolve()


def roadfix(*arguments):
    return subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, text=True, check=False)


class Evaluate(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.temporary = tempfile.TemporaryDirectory()
        cls.folder = Path(cls.temporary.name)
        cls.log = cls.folder / "out.lcm"
        done = roadfix("replay", ROOT / "logs/demo.lcm", "--stages", "gnss_ins_ekf", "--config", ROOT / "configs/demo",
                       "--out", cls.log)
        if done.returncode != 0:
            raise RuntimeError(done.stderr)

    @classmethod
    def tearDownClass(cls):
        cls.temporary.cleanup()

    def export(self, channel, form):
        path = self.folder / f"{channel}.{form}"
        done = roadfix("export", self.log, "--channel", channel, "--format", form, "--out", path, "--overwrite")
        self.assertEqual(done.returncode, 0, done.stderr)
        return path.read_text()

    def test_the_last_line_is_the_path_of_a_page_that_fetches_nothing(self):
        done = roadfix("evaluate", self.log, "--out", self.folder / "report", "--json", self.folder / "copy.json")
        self.assertEqual(done.returncode, 0, done.stderr)
        page = Path(done.stdout.splitlines()[-1])
        self.assertTrue(page.is_file())
        text = page.read_text()
        for fetching in ("<link", "src=", "@import", "fetch(", "https://"):
            self.assertNotIn(fetching, text)
        figures = json.loads((self.folder / "copy.json").read_text())
        self.assertEqual(figures, json.loads((page.parent / "figures.json").read_text()))
        self.assertGreater(figures["channels"]["POSE_INS"]["scored"], 100)

    def test_the_reference_against_itself_is_exact(self):
        done = roadfix("evaluate", self.log, "--channel", "REFERENCE", "--out", self.folder / "self", "--json",
                       self.folder / "self.json")
        self.assertEqual(done.returncode, 0, done.stderr)
        errors = json.loads((self.folder / "self.json").read_text())["channels"]["REFERENCE"]["errors"]
        self.assertLess(errors["norm_m"]["max"], 1e-9)

    def test_another_log_may_hold_the_reference(self):
        outs = []
        for flags in ((), ("--reference", ROOT / "logs/demo.lcm")):
            done = roadfix("evaluate", self.log, "--out", self.folder / "either", "--overwrite", *flags)
            self.assertEqual(done.returncode, 0, done.stderr)
            outs.append((self.folder / "either" / "figures.json").read_text())
        self.assertEqual(*outs)

    def test_all_formats_tell_the_same_poses(self):
        rows = list(csv.DictReader(self.export("POSE_INS", "csv").splitlines()))
        usable = [row for row in rows if row["validity"] != "invalid"]
        tum = [list(map(float, line.split())) for line in self.export("POSE_INS", "tum").splitlines()]
        kitti = self.export("POSE_INS", "kitti").splitlines()
        path = json.loads(self.export("POSE_INS", "geojson"))["geometry"]["coordinates"]
        self.assertGreater(len(usable), 100)
        self.assertEqual({len(usable), len(tum), len(kitti), len(path)}, {len(usable)})
        for row, pose, point in list(zip(usable, tum, path))[::50]:
            self.assertAlmostEqual(int(row["utime_us"]) * 1e-6, pose[0], places=5)
            for name, value in zip(("x_m", "y_m", "z_m", "qx", "qy", "qz", "qw"), pose[1:]):
                self.assertAlmostEqual(float(row[name]), value, places=8)
            self.assertAlmostEqual(math.hypot(*pose[4:]), 1.0, places=9)
            self.assertAlmostEqual(float(row["lon_deg"]), point[0], places=8)
            self.assertAlmostEqual(float(row["lat_deg"]), point[1], places=8)

    def test_maps_are_xml_with_every_usable_pose(self):
        rows = list(csv.DictReader(self.export("POSE_INS", "csv").splitlines()))
        usable = [row for row in rows if row["validity"] != "invalid"]
        gpx = ElementTree.fromstring(self.export("POSE_INS", "gpx"))
        points = list(gpx.iter("{http://www.topografix.com/GPX/1/1}trkpt"))
        self.assertEqual(len(points), len(usable))
        for row, point in list(zip(usable, points))[::50]:
            self.assertAlmostEqual(float(row["lat_deg"]), float(point.get("lat")), places=8)
            self.assertAlmostEqual(float(row["lon_deg"]), float(point.get("lon")), places=8)
        kml = ElementTree.fromstring(self.export("POSE_INS", "kml"))
        styles = {style.text for style in kml.iter("{http://www.opengis.net/kml/2.2}styleUrl")}
        self.assertEqual(styles, {"#valid", "#coasting"})  # the demo drive goes through a tunnel

    def test_what_is_wrong_is_named_and_ends_with_2(self):
        for words, said in (
            (("evaluate", self.log, "--channel", "POSE_NONE"), "POSE_NONE"),
            (("evaluate", self.folder / "absent.lcm"), "absent.lcm"),
            (("evaluate", ROOT / "logs/demo.lcm"), "POSE_"),
            (("export", self.log, "--channel", "POSE_NONE", "--out", self.folder / "x"), "POSE_NONE"),
            (("export", self.log, "--format", "svg", "--out", self.folder / "x"), "svg"),
        ):
            done = roadfix(*words)
            self.assertEqual(done.returncode, 2, words)
            self.assertIn(said, done.stderr)


if __name__ == "__main__":
    unittest.main()
