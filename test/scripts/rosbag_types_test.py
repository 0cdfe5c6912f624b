"""roadfix import of message types that receivers and cameras of ROS publish, of every kind of bag and every packing of chunks.
Arguments: repository, roadfix program."""
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

PROGRAM = Path(sys.argv.pop(2)).resolve()
ROOT = Path(sys.argv.pop(1)).resolve()
sys.path.insert(0, str(ROOT / "test" / "support"))

import lcm_log  # noqa: E402
import ros_bags  # noqa: E402
import ros_types  # noqa: E402

START = 1_700_000_000_000_000_000  # ns
SINGLE, DIFFERENTIAL, RTK_FLOAT, RTK_FIXED = 1, 2, 3, 4


def times(count, step_ns=200_000_000):
    return [START + i * step_ns for i in range(count)]


def head(t, frame="base_link"):
    return {"stamp": t, "frame_id": frame}


class Types(unittest.TestCase):
    def setUp(self):
        self.temporary = tempfile.TemporaryDirectory()
        self.folder = Path(self.temporary.name)
        self.addCleanup(self.temporary.cleanup)

    def roadfix(self, bag, *flags):
        out = self.folder / "out.lcm"
        out.unlink(missing_ok=True)
        command = [PROGRAM, "import", bag, "--out", out, "--vehicle", self.folder / "vehicle", "--overwrite", *flags]
        done = subprocess.run(list(map(str, command)), capture_output=True, text=True, check=False, timeout=60)
        return done, out

    def imported(self, bag, *flags):
        """(what import said, channel -> messages)"""
        done, out = self.roadfix(bag, *flags)
        self.assertEqual(done.returncode, 0, done.stderr)
        types, found = lcm_log.Types(ROOT / "lcmtypes"), {}
        for channel, _, data in lcm_log.events(out):
            if channel != "CONFIG_DRIVE":
                found.setdefault(channel, []).append(types.decode(lcm_log.type_of_channel(channel), data))
        return done.stdout, found

    def bags(self, stream):
        """Of a stream whose types may differ between ROS 1 and 2: name -> bag."""
        old = [(topic, kind.replace("gps_msgs", "gps_common"), t, value) for topic, kind, t, value in stream]
        ros_bags.write_ros1(self.folder / "a.bag", old)
        ros_bags.write_sqlite(self.folder / "sqlite", stream)
        ros_bags.write_mcap(self.folder / "mcap", stream)
        return {"ROS 1": self.folder / "a.bag", "sqlite3 without definitions": self.folder / "sqlite", "MCAP": self.folder / "mcap"}

    def test_gps_fix_of_gpsd(self):
        values = [{"header": head(t), "status": {"status": status, "satellites_used": 9, "satellite_used_prn": [3, 4]}, "latitude": 48.5,
                   "longitude": -11.25, "altitude": 530.5, "track": 90.0, "speed": 10.0, "climb": 0.5, "pdop": 1.5, "err_speed": 0.4,
                   "position_covariance": [4.0, 0, 0, 0, 1.0, 0, 0, 0, 9.0], "position_covariance_type": 3}
                  for t, status in zip(times(6), (0, 1, 18, 19, 20, -1))]
        for name, bag in self.bags([("/gps", "gps_msgs/GPSFix", v["header"]["stamp"], v) for v in values]).items():
            with self.subTest(name):
                text, found = self.imported(bag)
                fixes = found["GNSS"]
                self.assertEqual([m["fix_type"] for m in fixes], [SINGLE, DIFFERENTIAL, DIFFERENTIAL, RTK_FIXED, RTK_FLOAT])
                first = fixes[0]
                self.assertEqual((first["utime"], first["lat_deg"], first["lon_deg"], first["height_m"]), (START // 1000, 48.5, -11.25, 530.5))
                self.assertEqual([first["cov_enu_m2"][i][i] for i in range(3)], [4.0, 1.0, 9.0])
                for got, want in zip(first["velocity_enu_mps"], (10.0, 0.0, 0.5)):  # track 90 deg is east
                    self.assertAlmostEqual(got, want, places=12)
                self.assertAlmostEqual(first["cov_velocity_enu_m2ps2"][0][0], 0.04)  # 0.4 m/s at 95 %
                self.assertIn("/gps: 1 messages of 6 without a value that counts left out", text)

    def test_gps_raw_of_mavros(self):
        values = [{"header": head(t), "fix_type": kind, "lat": 485000000, "lon": -112500000, "alt": 480250, "satellites_visible": 14,
                   "alt_ellipsoid": 530500 if kind != 3 else 0, "h_acc": 1414, "v_acc": 3000, "vel": 1000, "cog": 9000}
                  for t, kind in zip(times(5), (3, 4, 5, 6, 1))]
        for name, bag in self.bags([("/mavros/gpsstatus/gps1/raw", "mavros_msgs/GPSRAW", v["header"]["stamp"], v) for v in values]).items():
            with self.subTest(name):
                _, found = self.imported(bag)
                fixes = found["GNSS"]
                self.assertEqual([m["fix_type"] for m in fixes], [SINGLE, DIFFERENTIAL, RTK_FLOAT, RTK_FIXED])
                self.assertAlmostEqual(fixes[1]["lat_deg"], 48.5, places=12)
                self.assertAlmostEqual(fixes[1]["lon_deg"], -11.25, places=12)
                self.assertAlmostEqual(fixes[1]["height_m"], 530.5)   # above the ellipsoid where it is told
                self.assertAlmostEqual(fixes[0]["height_m"], 480.25)  # else above the sea
                self.assertAlmostEqual(fixes[1]["cov_enu_m2"][0][0], 1.0, places=3)
                self.assertAlmostEqual(fixes[1]["cov_enu_m2"][2][2], 9.0)
                self.assertFalse(fixes[1]["has_velocity"])

    def test_nav_pvt_of_ublox(self):
        values = [ros_types.both_names({
            "fix_type": 3, "flags": flags, "num_sv": 17, "lat": 485000000, "lon": -112500000, "height": 530500, "h_msl": 480250,
            "h_acc": 1414, "v_acc": 3000, "vel_n": -2000, "vel_e": 10000, "vel_d": 500, "s_acc": 200, "p_dop": 150})
            for flags in (1, 3, 65, 129, 0)]
        for name, bag in self.bags([("/ublox/navpvt", "ublox_msgs/NavPVT", t, v) for t, v in zip(times(5), values)]).items():
            with self.subTest(name):
                text, found = self.imported(bag)
                fixes = found["GNSS"]
                self.assertEqual([m["fix_type"] for m in fixes], [SINGLE, DIFFERENTIAL, RTK_FLOAT, RTK_FIXED])
                self.assertEqual(fixes[0]["velocity_enu_mps"], [10.0, -2.0, -0.5])
                self.assertAlmostEqual(fixes[0]["cov_velocity_enu_m2ps2"][2][2], 0.04)
                self.assertAlmostEqual(fixes[0]["height_m"], 530.5)
                self.assertEqual(fixes[1]["utime"], times(5)[1] // 1000)
                self.assertIn("5 messages without a stamp have the time of recording", text)

    def test_odometry_is_wheels_and_reference(self):
        stream = []
        for i, t in enumerate(times(10)):
            twist = {"twist": {"linear": {"x": 5.0, "y": 0.1}, "angular": {"z": 0.25}}}
            pose = {"pose": {"position": ros_bags.xyz((1.0 * i, 2.0, 3.0)), "orientation": dict(zip("xyzw", (0, 0, 0.6, 0.8)))}}
            for topic in ("/wheel/odometry", "/ground_truth"):
                stream.append((topic, "nav_msgs/Odometry", t, {"header": head(t, "odom"), "child_frame_id": "base_link", "pose": pose,
                                                               "twist": twist}))
            stream.append(("/imu", "sensor_msgs/Imu", t, {"header": head(t), "linear_acceleration": {"z": 9.8}}))
        for name, bag in self.bags(stream).items():
            with self.subTest(name):
                text, found = self.imported(bag)
                self.assertIn("wheels is /wheel/odometry", text)
                self.assertIn("reference is /ground_truth", text)
                self.assertEqual([(m["speed_mps"][0], m["yaw_rate_radps"]) for m in found["WHEELS"]], [(5.0, 0.25)] * 10)
                self.assertEqual(found["REFERENCE"][3]["position_m"], [3.0, 2.0, 3.0])
                for got, want in zip(found["REFERENCE"][3]["q_wxyz"], (0.8, 0.0, 0.0, 0.6)):
                    self.assertAlmostEqual(got, want, places=12)

    def pictures(self, left, right, info=True):
        """Two cameras with their CameraInfo; `left` and `right` are Images without header."""
        k = [500.0, 0, 320.5, 0, 501.0, 240.5, 0, 0, 1]
        stream = []
        for t in times(3):
            for side, picture in (("left", left), ("right", right)):
                stream.append((f"/camera/{side}/image_raw", "sensor_msgs/Image", t, {"header": head(t, f"camera_{side}"), **picture}))
                if info:
                    model, d = ("plumb_bob", [-0.3, 0.1, 0.001, 0.002, 0.0]) if side == "left" else ("equidistant", [0.1, 0.2, 0.3, 0.4])
                    stream.append((f"/camera/{side}/camera_info", "sensor_msgs/CameraInfo", t, {
                        "header": head(t), "height": picture["height"], "width": picture["width"], "distortion_model": model,
                        "D": d, "d": d, "K": k, "k": k}))
        return stream

    def test_raw_pictures_and_their_lenses(self):
        gray = bytes(range(12)) + bytes(4)  # 4 x 3 pixels in rows of 4 and, below, 5 bytes
        padded = b"".join(gray[4 * y:4 * y + 4] + b"\xee" for y in range(3))
        colour = bytes(range(100, 136))  # 4 x 3 of red, green, blue
        left = {"height": 3, "width": 4, "encoding": "mono8", "step": 5, "data": padded}
        right = {"height": 3, "width": 4, "encoding": "rgb8", "step": 12, "data": colour}
        for name, bag in self.bags(self.pictures(left, right)).items():
            with self.subTest(name):
                _, found = self.imported(bag)
                self.assertEqual(ros_types.png_pixels(bytes(found["CAMERA_LEFT"][1]["data"])), (4, 3, 1, gray[:12]))
                self.assertEqual(ros_types.png_pixels(bytes(found["CAMERA_RIGHT"][2]["data"])), (4, 3, 3, colour))
                text = (self.folder / "vehicle" / "calibration.yaml").read_text()
                self.assertEqual(text.count("intrinsics_px: [500, 501, 320.5, 240.5]"), 2)
                self.assertRegex(text, r"model: radtan\s+coefficients: \[-0.3, 0.1, 0.001, 0.002, 0\]")
                self.assertRegex(text, r"model: equidistant\s+coefficients: \[0.1, 0.2, 0.3, 0.4\]")
                self.assertIn("model: fisheye", text)

    def test_pictures_that_cannot_be_are_told(self):
        good = {"height": 1, "width": 4, "encoding": "mono8", "step": 4, "data": b"abcd"}
        deep = {"height": 1, "width": 2, "encoding": "16UC1", "step": 4, "data": b"abcd"}
        ros_bags.write_ros1(self.folder / "deep.bag", self.pictures(good, deep, info=False))
        text, found = self.imported(self.folder / "deep.bag")
        self.assertIn("left out: /camera/right/image_raw: pictures of encoding '16UC1'", text)
        self.assertNotIn("CAMERA_RIGHT", found)
        self.assertIn("/camera/left/image_raw: no CameraInfo", text)
        for change in ({"step": 3}, {"height": 2}, {"width": 40000, "step": 40000}):
            ros_bags.write_ros1(self.folder / "bad.bag", self.pictures({**good, **change}, good, info=False))
            done, out = self.roadfix(self.folder / "bad.bag")
            self.assertEqual(done.returncode, 2)
            self.assertRegex(done.stderr, r"bad.bag: topic /camera/left/image_raw: picture 1: .* do not fit into 4 bytes")
            self.assertFalse(out.exists())

    def test_chunks_of_every_packing(self):
        stream, expected = ros_bags.messages(ROOT, ROOT / "logs" / "demo.lcm", seconds=3.0)
        bags = []
        for compression in ("lz4", "zstd"):
            ros_bags.write_mcap(self.folder / compression, stream, compression)
            bags.append(self.folder / compression)
        ros_bags.write_ros1(self.folder / "lz4.bag", stream, "lz4")
        bags.append(self.folder / "lz4.bag")
        for bag in bags:
            with self.subTest(bag.name):
                self.imported(bag)
                equal, total = ros_bags.equal_values(expected, ros_bags.found_in(ROOT, self.folder / "out.lcm"))
                self.assertGreater(total, 2000)
                self.assertEqual(equal, total)
                path = bag if bag.is_file() else bag / "drive_0.mcap"
                data = path.read_bytes()
                for length in (len(data) // 3, len(data) // 2, len(data) - 100):
                    broken = self.folder / ("broken" + path.suffix)
                    broken.write_bytes(data[:length])
                    done, out = self.roadfix(broken)
                    self.assertEqual(done.returncode, 2, done.stdout)
                    self.assertRegex(done.stderr, r"broken.*at offset \d+")
                    self.assertFalse(out.exists())
                if path.suffix != ".mcap":
                    continue  # nothing but a checksum tells a changed byte, and ROS 1 has none
                changed = bytearray(data)
                changed[len(data) // 2] ^= 0x20
                broken.write_bytes(changed)
                done, out = self.roadfix(broken)
                self.assertEqual(done.returncode, 2, done.stdout)
                self.assertRegex(done.stderr, r"broken.*at offset \d+")
                self.assertFalse(out.exists())


if __name__ == "__main__":
    unittest.main()
