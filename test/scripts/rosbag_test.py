"""roadfix import of ROS bags, as a user calls it. Arguments: repository, roadfix program."""
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

PROGRAM = Path(sys.argv.pop(2)).resolve()
ROOT = Path(sys.argv.pop(1)).resolve()
sys.path.insert(0, str(ROOT / "test" / "support"))

import ros_bags  # noqa: E402

CUTS = 24


class Bags(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.temporary = tempfile.TemporaryDirectory()
        cls.folder = Path(cls.temporary.name)
        cls.stream, cls.expected = ros_bags.messages(ROOT, ROOT / "logs" / "demo.lcm", seconds=6.0)
        cls.bags = ros_bags.write_all(cls.folder, cls.stream)

    @classmethod
    def tearDownClass(cls):
        cls.temporary.cleanup()

    def roadfix(self, bag, *flags):
        self.out = self.folder / "out.lcm"
        self.out.unlink(missing_ok=True)
        command = [PROGRAM, "import", bag, "--out", self.out, "--overwrite", *flags]
        return subprocess.run(list(map(str, command)), capture_output=True, text=True, check=False, timeout=60)

    def imported(self, bag, *flags):
        done = self.roadfix(bag, *flags)
        self.assertEqual(done.returncode, 0, done.stderr)
        return done.stdout

    def refused(self, bag, pattern, *flags):
        done = self.roadfix(bag, *flags)
        self.assertEqual(done.returncode, 2, done.stderr or done.stdout)
        self.assertRegex(done.stderr, pattern)
        self.assertEqual([p.name for p in self.folder.glob("out.lcm*")], [])

    def test_every_value_comes_back_from_every_kind_of_bag(self):
        for name, bag in self.bags.items():
            with self.subTest(name):
                text = self.imported(bag)
                found = ros_bags.found_in(ROOT, self.out)
                equal, total = ros_bags.equal_values(self.expected, found)
                self.assertGreater(total, 5000)
                self.assertEqual(equal, total)
                self.assertEqual({c: len(rows) for c, rows in self.expected.items()}, {c: len(rows) for c, rows in found.items()})
                self.assertIn("imu is /imu/data (sensor_msgs/Imu", text)
                self.assertIn("left out: /chatter (std_msgs/String, 1 messages)", text)

    def test_the_comparison_finds_one_value_that_differs(self):
        self.imported(self.bags["ROS 1"])
        found = ros_bags.found_in(ROOT, self.out)
        found["IMU"][3][2] *= 1.0 + 1e-12
        equal, total = ros_bags.equal_values(self.expected, found)
        self.assertEqual(equal, total - 1)

    def test_transforms_place_the_sensors(self):
        for bag in self.bags.values():
            self.imported(bag, "--vehicle", self.folder / "vehicle")
            text = (self.folder / "vehicle" / "calibration.yaml").read_text()
            self.assertRegex(text, r"lever_arm_body_m: \[0\.5, 0\.25, 1\.1\]")
            self.assertRegex(text, r"lever_arm_body_m: \[-0\.5, 0, -0\.4\]")
            self.assertRegex(text, r"p_m: \[1, 0\.25, 0\.85\]")
            self.assertRegex(text, r"q_wxyz: \[0\.5, -0\.5, 0\.5, -0\.5\]")

    def test_an_imu_upside_down_is_turned_into_the_vehicle_s_axes(self):
        stream, expected = ros_bags.messages(ROOT, ROOT / "logs" / "demo.lcm", seconds=1.0, rotate_imu=True)
        ros_bags.write_ros1(self.folder / "over.bag", stream)
        text = self.imported(self.folder / "over.bag")
        self.assertIn("IMU turned by 180.0 deg", text)
        for row, other in zip(expected["IMU"], ros_bags.found_in(ROOT, self.out)["IMU"], strict=True):
            for a, b in zip(row, other):
                self.assertAlmostEqual(a, b, places=12)

    def test_a_bag_that_is_cut_anywhere_is_an_error_with_its_file_and_leaves_nothing(self):
        for name, bag in self.bags.items():
            path = bag if bag.is_file() else next(p for p in bag.iterdir() if p.name.startswith("drive_0"))
            data = path.read_bytes()
            cut = self.folder / ("cut" + path.suffix)
            for i in range(CUTS):
                length = len(data) * i // CUTS if i > 3 else i * 40
                with self.subTest(name, length=length):
                    cut.write_bytes(data[:length])
                    self.refused(cut, rf"cut\{path.suffix}: (topic .*)?(at offset \d+|sqlite3)")

    def test_a_changed_byte_in_a_chunk_is_found(self):
        for name in ("ROS 1, bz2", "MCAP"):
            bag = self.bags[name]
            path = bag if bag.is_file() else bag / "drive_0.mcap"
            data = bytearray(path.read_bytes())
            data[len(data) // 2] ^= 0x10
            broken = self.folder / ("broken" + path.suffix)
            broken.write_bytes(data)
            self.refused(broken, r"broken.*at offset \d+")

    def test_a_bag_that_lost_messages_contradicts_its_metadata(self):
        folder = self.folder / "short"
        ros_bags.write_sqlite(folder, self.stream[:-10])
        ros_bags.write_metadata(folder, "drive_0.db3", "sqlite3", len(self.stream))
        self.refused(folder, r"metadata.yaml: tells \d+ messages, the files have \d+")

    def test_topics_are_named_by_the_user(self):
        text = self.imported(self.bags["ROS 1"], "--topic", "gnss_velocity=/vehicle/twist")
        self.assertIn("gnss_velocity is /vehicle/twist", text)
        self.refused(self.bags["MCAP"], r"--topic imu=/nope: there is no such topic; there are .*/imu/data", "--topic", "imu=/nope")
        self.refused(self.bags["MCAP"], r"--topic imu=/gps/fix: its type sensor_msgs/NavSatFix cannot be that", "--topic", "imu=/gps/fix")
        self.refused(self.bags["MCAP"], r"--topic imux=/a: must be ROLE=/TOPIC, ROLE one of imu", "--topic", "imux=/a")

    def test_a_bag_without_sensors_says_what_it_has(self):
        ros_bags.write_ros1(self.folder / "none.bag", self.stream[1:2])
        self.refused(self.folder / "none.bag", r"none.bag: holds no sensor that we take: it has /chatter \(std_msgs/String\)")

    def test_bags_of_the_official_writer(self):
        for compression in ("none", "bz2", "lz4"):
            path = self.folder / f"official_{compression}.bag"
            try:
                ros_bags.write_official_ros1(path, self.stream, compression)
            except ImportError as missing:
                self.skipTest(f"python3-rosbag is not installed: {missing}")
            self.imported(path)
            equal, total = ros_bags.equal_values(self.expected, ros_bags.found_in(ROOT, self.out))
            self.assertEqual(equal, total)


if __name__ == "__main__":
    unittest.main()
