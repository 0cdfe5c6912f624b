"""roadfix import of a KITTI raw recording that an independent writer made of the demo drive. Arguments: repository, roadfix program."""
import re
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

PROGRAM = Path(sys.argv.pop(2)).resolve()
ROOT = Path(sys.argv.pop(1)).resolve()
sys.path.insert(0, str(ROOT / "test" / "support"))

import kitti_raw  # noqa: E402
import lcm_log  # noqa: E402

PLACE, TURN = (1.6, 0.27, 1.55), (0.495617693782899, -0.504344229281273, 0.504344229281273, -0.495617693782899)


class KittiRaw(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.temporary = tempfile.TemporaryDirectory()
        cls.day = Path(cls.temporary.name) / "2011_09_26"
        cls.drive, cls.packets, cls.pictures = kitti_raw.write(ROOT, ROOT / "logs" / "demo.lcm", cls.day, seconds=30)
        kitti_raw.write_calibration(cls.day, PLACE, TURN, (640, 192), (370.25, 370.5, 312.75, 94.25), (-0.28, 0.09, 4e-4, -3e-4, 0.01))

    @classmethod
    def tearDownClass(cls):
        cls.temporary.cleanup()

    def imported(self, *flags):
        out = self.day / "out.lcm"
        command = [PROGRAM, "import", self.drive, "--out", out, "--vehicle", self.day / "vehicle", "--overwrite", *flags]
        done = subprocess.run(list(map(str, command)), capture_output=True, text=True, check=False, timeout=60)
        self.assertEqual(done.returncode, 0, done.stderr)
        types, found = lcm_log.Types(ROOT / "lcmtypes"), {}
        for channel, _, data in lcm_log.events(out):
            found.setdefault(channel, []).append(types.decode(lcm_log.type_of_channel(channel), data))
        return done.stdout, found

    def worst(self, found, turn=lambda q: q):
        """(m, of the quaternion, m/s) by which the reference is off at most, against the first one's place."""
        metres = quaternion = speed = 0.0
        first = self.packets[0][0]["position_m"]
        for (pose, _), other in zip(self.packets, found["REFERENCE"], strict=True):
            self.assertEqual(pose["utime"], other["utime"])
            for i in range(3):
                metres = max(metres, abs(pose["position_m"][i] - first[i] - other["position_m"][i]))
                speed = max(speed, abs(pose["velocity_mps"][i] - other["velocity_mps"][i]))
            sign = 1.0 if sum(a * b for a, b in zip(pose["q_wxyz"], other["q_wxyz"])) > 0 else -1.0
            quaternion = max(quaternion, *(abs(a - sign * b) for a, b in zip(turn(pose["q_wxyz"]), other["q_wxyz"])))
        return metres, quaternion, speed

    def test_what_went_out_comes_in_again(self):
        text, found = self.imported()
        self.assertGreater(len(self.packets), 100)
        metres, quaternion, speed = self.worst(found)
        self.assertLess(metres, 1e-3)  # east, north, up of another anchor, some cm of height away
        self.assertLess(quaternion, 1e-6)
        self.assertLess(speed, 1e-5)
        for (_, imu), other in zip(self.packets, found["IMU"], strict=True):
            self.assertEqual((imu["gyro_radps"], imu["accel_mps2"]), (other["gyro_radps"], other["accel_mps2"]))
        self.assertEqual([(m["utime"], m["data"]) for m in self.pictures], [(m["utime"], m["data"]) for m in found["CAMERA_LEFT"]])
        self.assertNotIn("GNSS", found)
        self.assertIn("image_00: 640 x 192, not rectified", text)
        self.assertNotIn("imu: ", text)

    def test_the_comparison_finds_a_roll_of_the_other_sign(self):
        _, found = self.imported()
        self.assertGreater(self.worst(found, lambda q: [q[0], -q[1], q[2], q[3]])[1], 1e-3)

    def test_the_camera_sits_where_it_was(self):
        self.imported()
        text = (self.day / "vehicle" / "calibration.yaml").read_text()
        numbers = lambda key: [float(v) for v in re.search(rf"{key}: \[(.*?)\]", text).group(1).split(",")]
        for key, want in (("p_m", PLACE), ("q_wxyz", TURN), ("intrinsics_px", (370.25, 370.5, 312.75, 94.25)),
                          ("coefficients", (-0.28, 0.09, 4e-4, -3e-4, 0.01))):
            for a, b in zip(numbers(key), want, strict=True):
                self.assertAlmostEqual(a, b, places=7)

    def test_fixes_of_oxts_are_known_to_be_the_reference(self):
        _, found = self.imported("--gnss-from-oxts", "--gnss-every", "5")
        self.assertEqual(len(found["GNSS"]), (len(self.packets) + 4) // 5)
        self.assertIn("from_fixes: true", found["CONFIG_DRIVE"][0]["config_yaml"])


if __name__ == "__main__":
    unittest.main()
