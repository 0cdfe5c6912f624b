"""roadfix export --format mcap on the demo drive. Arguments: repository, roadfix program, folder for npm's packages."""
import json
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

NPM = Path(sys.argv.pop(3)).resolve()
PROGRAM = Path(sys.argv.pop(2)).resolve()
ROOT = Path(sys.argv.pop(1)).resolve()
sys.path.insert(0, str(ROOT / "test" / "support"))

import mcap_check  # noqa: E402

LOG = ROOT / "logs" / "demo.lcm"


def export(log, out, **options):
    command = [PROGRAM, "export", log, "--format", "mcap", "--overwrite", "--out", out]
    return subprocess.run(list(map(str, command)), capture_output=True, check=False, **options)


class Writing(unittest.TestCase):
    def setUp(self):
        self.temporary = tempfile.TemporaryDirectory()
        self.folder = Path(self.temporary.name)

    def tearDown(self):
        self.temporary.cleanup()

    def test_standard_output_gets_the_bytes_of_the_file(self):
        out = self.folder / "demo.mcap"
        done = export(LOG, out)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(done.stdout.decode().strip(), str(out))
        streamed = export(LOG, "-")
        self.assertEqual(streamed.returncode, 0, streamed.stderr)
        self.assertEqual(streamed.stdout, out.read_bytes())

    def test_a_full_disk_is_an_error_and_leaves_nothing(self):
        done = export(LOG, "/dev/full")
        self.assertEqual(done.returncode, 2)
        self.assertIn(b"/dev/full: cannot be written: No space left on device", done.stderr)
        limited = ["bash", "-c", f"ulimit -f 1000; exec {PROGRAM} export {LOG} --format mcap --overwrite --out {self.folder}/a.mcap"]
        done = subprocess.run(limited, capture_output=True, check=False)
        self.assertEqual(done.returncode, 2)
        self.assertIn(b"a.mcap.part: cannot be written", done.stderr)
        self.assertEqual(list(self.folder.iterdir()), [])

    def test_what_is_no_log_of_ours_gives_no_file(self):
        alien = self.folder / "notes.txt"
        alien.write_text("no log")
        done = export(alien, self.folder / "a.mcap")
        self.assertEqual(done.returncode, 2)
        self.assertIn(b"notes.txt", done.stderr)
        self.assertFalse((self.folder / "a.mcap").exists())

    def test_the_log_itself_is_not_replaced(self):
        done = export(LOG, LOG)
        self.assertEqual(done.returncode, 2)
        self.assertIn(b"would replace the input", done.stderr)

    def test_a_damaged_log_goes_out_with_what_is_intact_and_says_what_is_not(self):
        log = self.folder / "cut.lcm"
        log.write_bytes(LOG.read_bytes()[:400_000])
        done = export(log, self.folder / "cut.mcap")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertRegex(done.stderr.decode(), r"bytes at offset \d+ left out")


class OfficialReader(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        try:
            mcap_check.node_modules(NPM)
        except mcap_check.Missing as missing:
            print(f"skipped: {missing}")
            raise unittest.SkipTest(str(missing)) from None
        cls.temporary = tempfile.TemporaryDirectory()
        cls.folder = Path(cls.temporary.name)
        cls.log = cls.folder / "out.lcm"
        stages = "gnss_ins_ekf,imm_fusion"
        done = subprocess.run([PROGRAM, "replay", LOG, "--stages", stages, "--config", ROOT / "configs/demo", "--out", cls.log],
                              capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise RuntimeError(done.stderr)

    @classmethod
    def tearDownClass(cls):
        cls.temporary.cleanup()

    def check(self, log, how):
        out = self.folder / "out.mcap"
        self.assertEqual(export(log, out).returncode, 0)
        topics, facts = mcap_check.official(NPM, out, how)
        same, total = mcap_check.compare(ROOT, log, topics)
        self.assertGreater(total, 1000)
        self.assertEqual(same, total)
        return topics, facts

    def test_every_message_of_the_demo_drive_comes_back(self):
        topics, facts = self.check(LOG, "streamed")
        self.assertTrue(facts["done"])
        for topic in ("/GNSS/location", "/CAMERA_LEFT/image", "/CAMERA_LEFT/calibration", "/REFERENCE/pose", "/tf"):
            self.assertIn(topic, topics)
        self.check(LOG, "indexed")

    def test_every_message_of_a_replay_comes_back_through_the_index(self):
        topics, facts = self.check(self.log, "indexed")
        self.assertEqual(facts["chunks"], facts["indexed"])
        self.assertEqual(int(facts["messages"]), sum(map(len, topics.values())))
        # `enu` is the frame of REFERENCE, which comes first: POSE_INS is drawn there, moved from its own anchor.
        for channel, moved in (("REFERENCE", 0.0), ("POSE_INS", 10.0)):
            shifts = []
            poses = [p for p in (json.loads(m["text"]) for m in topics[f"/{channel}"]) if p["validity"] != 0]
            for pose, drawn in zip(poses, topics[f"/{channel}/pose"], strict=True):
                self.assertEqual(drawn["value"]["frame_id"], "enu")
                place = drawn["value"]["pose"]["position"]
                shifts.append([place.get(axis, 0.0) - value for axis, value in zip("xyz", pose["position_m"])])
            for axis in range(3):
                parts = [shift[axis] for shift in shifts]
                self.assertLess(max(parts) - min(parts), 1e-3)
                self.assertLessEqual(abs(parts[0]), moved)
        self.assertEqual({m["value"]["child_frame_id"] for m in topics["/tf"]} & {"vehicle", "POSE_INS"}, {"vehicle", "POSE_INS"})

    def test_the_comparison_finds_one_value_that_differs(self):
        out = self.folder / "teeth.mcap"
        export(LOG, out)
        topics, _ = mcap_check.official(NPM, out, "streamed")
        message = topics["/IMU"][17]
        value = json.loads(message["text"])
        value["gyro_radps"][1] += 1e-12
        message["text"] = json.dumps(value)
        same, total = mcap_check.compare(ROOT, LOG, topics)
        self.assertEqual(same, total - 1)

    def test_the_reader_refuses_a_file_with_one_wrong_byte(self):
        out = self.folder / "broken.mcap"
        export(LOG, out)
        data = bytearray(out.read_bytes())
        data[len(data) // 2] ^= 1
        out.write_bytes(data)
        with self.assertRaises(RuntimeError):
            mcap_check.official(NPM, out, "streamed")


if __name__ == "__main__":
    unittest.main()
