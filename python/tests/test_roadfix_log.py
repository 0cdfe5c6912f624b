"""roadfix_log against logs written here, field by field, and against broken ones. Arguments: repository [roadfix program]."""
import json
import struct
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

PROGRAM = Path(sys.argv.pop(2)).resolve() if len(sys.argv) > 2 else None
ROOT = Path(sys.argv.pop(1)).resolve()
sys.dont_write_bytecode = True
sys.path.insert(0, str(ROOT / "python"))
try:
    import numpy as np
except ImportError:
    print("skipped: no numpy (Debian: python3-numpy)")
    sys.exit(0)
import roadfix_log  # noqa: E402
from roadfix_log.schema import Schema, SchemaError, from_folder  # noqa: E402

TYPES = """package t;
struct point_t { double xy[2]; string label; }
""", """package t;
struct all_t {
  int64_t utime; int8_t small; int16_t mid; boolean flag;   // a comment; with = signs [3]
  const int8_t RED = 1, BLUE = -2;
  float matrix[2][3];
  string name;
  int32_t count; int16_t other;
  double rows[count][3];
  byte data[count];
  string words[count];
  point_t points[other];
  point_t one;
}
"""


def text(value):
    data = value.encode()
    return struct.pack(">i", len(data) + 1) + data + b"\0"


def point(x, y, label):
    return struct.pack(">2d", x, y) + text(label)


def message(print_, k, words, points):
    """An all_t as LCM writes it: big-endian, in the order of its fields."""
    out = struct.pack(">Qqbh?", print_, 1000 + k, -k, 300 + k, k % 2 == 0)
    out += struct.pack(">6f", *(k + i for i in range(6))) + text(f"name {k % 3}")
    out += struct.pack(">ih", len(words), len(points))
    out += struct.pack(f">{3 * len(words)}d", *(k * 100 + i for i in range(3 * len(words))))
    out += bytes(range(len(words))) + b"".join(map(text, words))
    return out + b"".join(point(*p) for p in points) + point(-1.5, k, "äö")


def event(channel, data, number=0, stamp=5):
    name = channel.encode()
    return struct.pack(">IqqII", 0xEDA1DA01, number, stamp, len(name), len(data)) + name + data


class Case(unittest.TestCase):
    def setUp(self):
        temporary = tempfile.TemporaryDirectory()
        self.addCleanup(temporary.cleanup)
        self.folder = Path(temporary.name)
        self.schema = Schema([("point_t", TYPES[0]), ("all_t", TYPES[1])])
        self.print = self.schema.fingerprint("all_t")

    def log(self, *parts, **arguments):
        path = self.folder / "a.lcm"
        path.write_bytes(b"".join(parts))
        return roadfix_log.read(path, types=self.schema, **arguments)

    def many(self, count=50):
        """Messages of several layouts, interleaved; what went into each."""
        rows = []
        for k in range(count):
            words = [f"w{k}{'x' * (i % 2)}" for i in range(k % 4)]
            points = [(k, i, "p" * i) for i in range(k % 3)]
            rows.append((words, points, message(self.print, k, words, points)))
        return rows


class Fields(Case):
    def test_every_kind_of_field_comes_back(self):
        rows = self.many()
        log = self.log(*(event("ALL", data, k, k * 7) for k, (_, _, data) in enumerate(rows)))
        channel = log["ALL"]
        n = np.arange(len(rows))
        self.assertEqual((channel.type, channel.messages, channel.broken), ("all_t", len(rows), []))
        np.testing.assert_array_equal(channel.log_utime, n * 7)
        np.testing.assert_array_equal(channel.utime, 1000 + n)
        np.testing.assert_array_equal(channel.small, (-n).astype(np.int8))
        np.testing.assert_array_equal(channel.mid, 300 + n)
        np.testing.assert_array_equal(channel.flag, n % 2 == 0)
        np.testing.assert_array_equal(channel.matrix, n[:, None, None] + np.arange(6).reshape(2, 3))
        self.assertEqual(list(channel["name"]), [f"name {k % 3}" for k in n])
        self.assertEqual(channel.constants, {"RED": 1, "BLUE": -2})
        self.assertTrue(channel.utime.dtype.isnative)
        for k, (words, points, _) in enumerate(rows):
            np.testing.assert_array_equal(channel.rows[k], k * 100 + np.arange(3 * len(words)).reshape(-1, 3))
            np.testing.assert_array_equal(channel.data[k], np.arange(len(words)))
            self.assertEqual(list(channel.words[k]), words)
            self.assertEqual(channel["points.xy"][k].tolist(), [[p[0], p[1]] for p in points])
            self.assertEqual(list(channel["points.label"][k]), [p[2] for p in points])
        self.assertEqual(set(channel["one.label"]), {"äö"})
        np.testing.assert_array_equal(channel["one.xy"], np.column_stack([np.full(len(n), -1.5), n]))

    def test_rows_of_one_length_stack_and_others_do_not(self):
        rows = [message(self.print, k, ["a", "b"], []) for k in range(3)]
        self.assertEqual(self.log(*(event("A", r) for r in rows))["A"].rows.stack().shape, (3, 2, 3))
        rows.append(message(self.print, 3, ["a"], []))
        with self.assertRaisesRegex(ValueError, "1 to 2 elements"):
            self.log(*(event("A", r) for r in rows))["A"].rows.stack()

    def test_empty_arrays_of_structs(self):
        channel = self.log(event("A", message(self.print, 0, [], [])))["A"]
        self.assertEqual((len(channel["points.xy"]), len(channel["points.xy"][0])), (1, 0))

    def test_names_of_what_is_not_there_list_what_is(self):
        log = self.log(event("ALL", message(self.print, 0, [], [])))
        with self.assertRaisesRegex(KeyError, "no channel 'POSE'; there are ALL"):
            _ = log["POSE"]
        with self.assertRaisesRegex(KeyError, "no channel 'P.*there are ALL"):
            self.log(event("ALL", message(self.print, 0, [], [])), channels="P*")
        with self.assertRaisesRegex(KeyError, "no field 'x'; it has utime, small"):
            _ = log["ALL"]["x"]


class Broken(Case):
    def test_every_cut_gives_whole_messages_and_says_where_it_ends(self):
        parts = [event("ALL", data, k) for k, (_, _, data) in enumerate(self.many(6))]
        whole, ends = b"".join(parts), np.cumsum([len(p) for p in parts])
        for cut in range(1, len(whole)):
            intact = int(np.searchsorted(ends, cut, side="right"))
            if intact == 0:
                with self.assertRaisesRegex(roadfix_log.LogError, "a.lcm: byte 0"):
                    self.log(whole[:cut])
                continue
            log = self.log(whole[:cut])
            self.assertEqual(log["ALL"].messages, intact)
            begin = int(ends[intact - 1])
            self.assertEqual([(d.offset, d.bytes) for d in log.damage], [(begin, cut - begin)] if cut > begin else [])

    def test_a_flipped_byte_costs_one_message_at_most_and_never_raises(self):
        rows = self.many(4)
        parts = [event("ALL", data, k) for k, (_, _, data) in enumerate(rows)]
        whole = b"".join(parts)
        for at in range(len(whole)):
            log = self.log(whole[:at] + bytes([whole[at] ^ 0x81]) + whole[at + 1:])
            told = sum(len(log[c].broken) for c in log) + len(log.damage) + len(log.unknown)
            got = sum(log[c].messages for c in log)
            self.assertGreaterEqual(got, 3)
            self.assertTrue(got == 4 or told, f"byte {at}: {got} messages and nothing told")

    def test_hostile_counts_are_told_with_the_offset(self):
        good = message(self.print, 0, ["a"], [])
        at = 8 + 8 + 1 + 2 + 1 + 24 + len(text("name 0"))
        first = event("ALL", good)
        for count in (-1, 2, 1 << 30, -(1 << 31)):
            bad = good[:at] + struct.pack(">i", count) + good[at + 4:]
            channel = self.log(first, event("ALL", bad), first)["ALL"]
            self.assertEqual((channel.messages, [o for o, _ in channel.broken]), (2, [len(first)]))

    def test_a_zero_inside_of_a_string_is_broken_like_in_the_bus(self):
        good = message(self.print, 0, [], [])
        channel = self.log(event("A", good), event("A", good.replace(b"name 0", b"na\0e 0")))["A"]
        self.assertEqual([why for _, why in channel.broken], ["a string's closing zero is not at its end"])

    def test_a_magic_inside_of_data_is_data(self):
        inner = event("INNER", message(self.print, 1, [], []))
        schema = Schema([("raw_t", "struct raw_t { int32_t n; byte data[n]; }")])
        data = struct.pack(">Qi", schema.fingerprint("raw_t"), len(inner)) + inner
        path = self.folder / "b.lcm"
        path.write_bytes(event("RAW", data) * 3)
        log = roadfix_log.read(path, types=schema)
        self.assertEqual((list(log), log["RAW"].messages, log.damage), (["RAW"], 3, []))
        self.assertEqual(bytes(log["RAW"].data[1]), inner)

    def test_garbage_between_events_is_stepped_over(self):
        good = event("ALL", message(self.print, 0, ["a"], []))
        log = self.log(b"xyz", good, b"\xed\xa1\xda\x01" * 9, good, b"\xed")
        self.assertEqual(log["ALL"].messages, 2)
        self.assertEqual([(d.offset, d.bytes) for d in log.damage], [(0, 3), (3 + len(good), 36), (39 + 2 * len(good), 1)])

    def test_what_is_no_log_says_so(self):
        for data in (b"", b"x", b"\xed\xa1\xda\x01", bytes(5000)):
            with self.assertRaisesRegex(roadfix_log.LogError, "a.lcm: byte 0: holds no LCM event"):
                self.log(data)

    def test_unknown_types_are_told_and_the_rest_is_read(self):
        log = self.log(event("ALIEN", struct.pack(">Qq", 0x1122334455667788, 1)), event("SHORT", b"abc"),
                       event("ALL", message(self.print, 0, [], [])))
        self.assertEqual((list(log), log.unknown["ALIEN"]), (["ALL"], 0x1122334455667788))
        with self.assertRaisesRegex(roadfix_log.LogError, "ALIEN: no type has the fingerprint 1122334455667788"):
            _ = log["ALIEN"]


class Types(Case):
    def test_fingerprints_are_those_of_the_repository(self):
        schema = from_folder(ROOT / "lcmtypes")
        wanted = dict(line.split() for line in (ROOT / "lcmtypes/FINGERPRINTS.txt").read_text().splitlines())
        self.assertEqual({name: f"{schema.fingerprint(name):016x}" for name in schema.structs}, wanted)

    def test_a_changed_field_changes_the_fingerprint(self):
        changed = Schema([("point_t", TYPES[0]), ("all_t", TYPES[1].replace("mid", "mad"))])
        self.assertNotEqual(changed.fingerprint("all_t"), self.print)

    def test_broken_types_name_type_and_word(self):
        for body, wanted in (("int32_t a", "expected ';'|ends where"), ("double x[n];", "'n' is no earlier"), ("", "without fields"),
                             ("const int8_t A = b;", "no number"), ("int8_t a; } struct b_t {", "one struct a file")):
            with self.assertRaisesRegex(SchemaError, f"type w: .*({wanted})"):
                Schema([("w", "struct w_t { " + body + " }")])
        with self.assertRaisesRegex(SchemaError, "other_t: unknown"):
            Schema([("w", "struct w_t { other_t a; }")])
        with self.assertRaisesRegex(SchemaError, "contains itself"):
            Schema([("w", "struct w_t { w_t a; }")])

    def test_the_recorders_sidecar_is_asked_first(self):
        (self.folder / "drive_0001.lcm").write_bytes(event("ALL", message(self.print, 0, [], [])))
        types = [{"name": "point_t", "text": TYPES[0]}, {"name": "all_t", "text": TYPES[1]}]
        with self.assertRaisesRegex(roadfix_log.LogError, "no type has"):
            _ = roadfix_log.read(self.folder / "drive_0001.lcm")["ALL"]
        (self.folder / "drive.json").write_text(json.dumps({"types": types}))
        self.assertEqual(roadfix_log.read(self.folder / "drive_0001.lcm")["ALL"].messages, 1)


class Demo(unittest.TestCase):
    def test_the_demo_drive_as_lcm_itself_would_read_it(self):
        path = ROOT / "logs/demo.lcm"
        data = path.read_bytes()
        log = roadfix_log.read(path)
        self.assertEqual((log.damage, log.unknown), ([], {}))
        imu, at, k = log["IMU"], 0, 0
        while at < len(data):
            _, _, stamp, name, size = struct.unpack_from(">IqqII", data, at)
            begin = at + 28 + name
            if data[at + 28:begin] == b"IMU":
                utime, run, seq = struct.unpack_from(">3q", data, begin + 8)
                self.assertEqual((imu.utime[k], imu.run[k], imu.seq[k], imu.log_utime[k]), (utime, run, seq, stamp))
                k += 1
            at = begin + size
        self.assertEqual(imu.messages, k)
        picture = log["CAMERA_LEFT"]
        self.assertEqual(bytes(picture.data[0][:2]), b"\xff\xd8")
        np.testing.assert_array_equal(picture.data.lengths, picture.size_bytes)

    def test_poses_that_the_program_exports_are_the_same(self):
        if PROGRAM is None:
            self.skipTest("no program given")
        with tempfile.TemporaryDirectory() as folder:
            out = Path(folder) / "poses.csv"
            done = subprocess.run([PROGRAM, "export", ROOT / "logs/demo.lcm", "--channel", "REFERENCE", "--format", "tum", "--out", out],
                                  capture_output=True, text=True, check=False)
            self.assertEqual(done.returncode, 0, done.stderr)
            table = np.loadtxt(out)
        pose = roadfix_log.read(ROOT / "logs/demo.lcm")["REFERENCE"]
        np.testing.assert_allclose(table[:, 1:4], pose.position_m, atol=1e-9)
        np.testing.assert_allclose(table[:, 4:8], pose.q_wxyz[:, [1, 2, 3, 0]], atol=1e-12)

    def test_another_anchor_and_back(self):
        old, new = (48.0, 11.0, 500.0), (48.01, 11.02, 480.0)
        p = np.array([[0.0, 0.0, 0.0], [10.0, -20.0, 3.0], [1e5, 2e5, 0.0]])
        there = roadfix_log.change_anchor(p, old, new)
        np.testing.assert_allclose(roadfix_log.change_anchor(there, new, old), p, atol=1e-8)
        # A degree of latitude is 111.2 km there and one of longitude 74.63 km: 0.01 and 0.02 deg south-west of the new one.
        np.testing.assert_allclose(there[0], [-1492.6, -1111.9, 20 - 0.27], atol=0.3)
        np.testing.assert_allclose(roadfix_log.change_anchor(p, old, old), p, atol=1e-8)

    def test_the_command_line(self):
        run = lambda *a: subprocess.run([sys.executable, "-m", "roadfix_log", *map(str, a)], cwd=ROOT / "python", capture_output=True, text=True,
                                        check=False)
        self.assertIn("CAMERA_LEFT              image_t                 901", run(ROOT / "logs/demo.lcm").stdout)
        self.assertIn("accel_mps2                       (9000, 3) float64", run(ROOT / "logs/demo.lcm", "--fields", "IMU").stdout)
        bad = run(ROOT / "README.md")
        self.assertEqual((bad.returncode, bad.stdout), (2, ""))
        self.assertRegex(bad.stderr, "^roadfix_log: .*README.md: byte 0: holds no LCM event")
        self.assertEqual(run(ROOT / "logs/nowhere.lcm").returncode, 2)


class Released(unittest.TestCase):
    def test_a_log_of_0_1_is_read_with_the_types_of_0_1(self):
        log = roadfix_log.read(ROOT / "logs/released/0.1.lcm", ["*"])
        self.assertEqual((log.damage, log.unknown), ([], {}))
        tracks = log["VO_FEATURES"]
        self.assertEqual((tracks.type, tracks.messages, tracks.broken), ("vo_features_t", 9, []))
        np.testing.assert_array_equal(tracks.u_px.lengths, tracks.num_features)


class Install(unittest.TestCase):
    def test_pip_installs_a_checkout_without_the_network(self):
        try:
            import pip  # noqa: F401
        except ImportError:
            self.skipTest("no pip (Debian: python3-pip)")
        with tempfile.TemporaryDirectory() as folder:
            done = subprocess.run([sys.executable, "-m", "pip", "install", "--quiet", "--no-index", "--target", folder, "--no-deps",
                                   str(ROOT / "python")], capture_output=True, text=True, check=False)
            self.assertEqual(done.returncode, 0, done.stderr)
            code = "import roadfix_log as r, sys; log = r.read(sys.argv[1]); print(r.__file__, log['IMU'].messages)"
            done = subprocess.run([sys.executable, "-c", code, str(ROOT / "logs/demo.lcm")], cwd=folder, env={"PYTHONPATH": folder},
                                  capture_output=True, text=True, check=False)
            self.assertEqual(done.stdout.split(), [str(Path(folder) / "roadfix_log/__init__.py"), "9000"], done.stderr)
            installed = list((Path(folder) / "roadfix_log/lcmtypes").glob("*.lcm"))
            self.assertTrue(installed and not any(path.is_symlink() for path in installed))


if __name__ == "__main__":
    unittest.main()
