"""One command line: what every subcommand of roadfix shares. Arguments: repository, roadfix program."""
import functools
import os
import pty
import re
import shutil
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

PROGRAM = Path(sys.argv.pop(2)).resolve()
ROOT = Path(sys.argv.pop(1)).resolve()
BIN = PROGRAM.parent
VEHICLE = ROOT / "configs/demo"

# Options of one name, and the words that explain them wherever they stand.
SHARED = {
    "--overwrite": "Replace what is there already",
    "--progress": "Show progress also where stderr is no terminal",
    "--config": "The vehicle's configuration folder|folder with run.yaml",
}


def roadfix(*arguments, **options):
    return subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, text=True, check=False, timeout=120, **options)


def subcommands(*before):
    """All that do something, as tuples of words."""
    text = roadfix(*before, "--help").stdout
    if "Subcommands:" not in text:
        return [before]
    names = re.findall(r"^  ([a-z][a-z_-]*)", text.split("Subcommands:")[1], re.MULTILINE)
    return [words for name in names for words in subcommands(*before, name)]


def printed_commands(text):
    """What a page tells to type: lines of programs of ours in indented blocks and in backticks, as lists of words without comments."""
    lines = re.findall(r"(?m)^    (.*)$", text) + re.findall(r"`([^`\n]+)`", text)
    for line in lines:
        for part in re.split(r"&&|;", line.split("  #")[0].split(" # ")[0]):
            words = part.split()
            if words[:1] == ["sudo"]:
                words = words[1:]
            if words and words[0].startswith("build/release/bin/"):
                yield [words[0].removeprefix("build/release/bin/"), *words[1:]]
            elif words and words[0] == "roadfix":
                yield words


@functools.cache
def help_of(*words):
    done = subprocess.run([BIN / words[0], *words[1:], "--help"], capture_output=True, text=True, check=False, timeout=120)
    return done.stdout if done.returncode == 0 else None


def wrong_in(words):
    """What of a printed command there is not: the program, the subcommand or an option."""
    program, *rest = words
    if not (BIN / program).exists():
        return f"{program} is no program"
    before = []
    while True:
        text = help_of(program, *before)
        below = re.findall(r"(?m)^  ([a-z][a-z_-]*)", text.split("Subcommands:")[1]) if "Subcommands:" in text else []
        if not below or not rest or not re.fullmatch(r"[a-z][a-z_-]*", rest[0]):
            break
        if rest[0] not in below and help_of(program, *before, rest[0]) is None:  # some are called by our own programs and not listed
            return f"{program} {' '.join(before)}: there is no {rest[0]}"
        before.append(rest.pop(0))
    for option in re.findall(r"(?:^|[\s\[])(--?[a-z][a-z0-9-]*)", " ".join(rest)):
        if not re.search(rf"(?<![\w-]){re.escape(option)}(?![\w-])", text):
            return f"{program} {' '.join(before)}: there is no {option}"
    return None


class Pages(unittest.TestCase):
    def test_what_pages_tell_to_type_is_there(self):
        pages = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "configs/README.md", ROOT / "processes/roadfix/simulate/README.md",
                 *sorted((ROOT / "docs").glob("*.md"))]
        commands = {(page.name, *words) for page in pages for words in printed_commands(page.read_text())}
        self.assertGreater(len(commands), 20)
        for page, *words in sorted(commands):
            with self.subTest(page, command=" ".join(words)):
                self.assertIsNone(wrong_in(words))

    def test_what_is_not_there_is_found(self):
        page = "    build/release/bin/roadfix replay in.lcm --no-such-flag  # comment\n`roadfix no_such_command x` `build/release/bin/no_such_program`\n"
        self.assertEqual([wrong_in(words) for words in printed_commands(page)],
                         ["roadfix replay: there is no --no-such-flag", "roadfix : there is no no_such_command", "no_such_program is no program"])


class Tool(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.temporary = tempfile.TemporaryDirectory()
        cls.folder = Path(cls.temporary.name)
        cls.all = subcommands()
        cls.help = {words: roadfix(*words, "--help") for words in cls.all}
        cls.drive = cls.folder / "drive.lcm"
        done = roadfix("log", "filter", ROOT / "logs/demo.lcm", "--channel", "CAMERA.*", "--invert", "--out", cls.drive)
        if done.returncode != 0:
            raise RuntimeError(done.stderr)
        cls.out = cls.folder / "out.lcm"
        done = cls.replay(cls.out)
        if done.returncode != 0:
            raise RuntimeError(done.stderr)

    @classmethod
    def tearDownClass(cls):
        cls.temporary.cleanup()

    @classmethod
    def replay(cls, out, *flags):
        return roadfix("replay", cls.drive, "--stages", "wheel_odometry", "--config", VEHICLE, "--out", out, *flags)

    def test_there_are_the_subcommands_that_are_known(self):
        self.assertLessEqual({("replay",), ("evaluate",), ("log", "cut"), ("calibrate", "kalibr"), ("doctor",)}, set(self.all))

    def test_help_is_asked_for_and_says_the_exit_status(self):
        for words, done in self.help.items():
            with self.subTest(words):
                self.assertEqual((done.returncode, done.stderr), (0, ""))
                self.assertIn("Exit status: 0", done.stdout)

    def test_an_option_of_one_name_has_one_meaning(self):
        for words, done in self.help.items():
            text = " ".join(done.stdout.split())
            for option, meaning in SHARED.items():
                if f" {option} " in text:
                    with self.subTest(words, option=option):
                        self.assertRegex(text, rf"{option} [^-]*?({meaning})")

    def test_whatever_writes_replaces_on_request_only(self):
        for words, done in self.help.items():
            if " --out " in done.stdout:
                with self.subTest(words):
                    self.assertIn("--overwrite", done.stdout)
        outputs = {
            "replay": ("replay", self.drive, "--stages", "wheel_odometry", "--config", VEHICLE),
            "export": ("export", self.out, "--channel", "POSE_WHEEL"),
            "cut": ("log", "cut", self.drive, "--to-s", "3"),
            "filter": ("log", "filter", self.drive, "--channel", "GNSS", "--channel", "MAG"),
            "repair": ("log", "repair", self.drive),
            "simulate": ("simulate", "standing", "--no-camera", "--duration", "2"),
        }
        for name, words in outputs.items():
            with self.subTest(name):
                path = self.folder / f"{name}.made"
                self.assertEqual(roadfix(*words, "--out", path).returncode, 0)
                made = path.read_bytes()
                again = roadfix(*words, "--out", path)
                self.assertEqual(again.returncode, 2)
                self.assertIn(f"{path}: is there already; --overwrite replaces it", again.stderr)
                self.assertEqual(path.read_bytes(), made)
                self.assertEqual(roadfix(*words, "--out", path, "--overwrite").returncode, 0)

    def test_a_report_is_replaced_on_request_only(self):
        words = ("evaluate", self.out, "--out", self.folder / "report", "--json", self.folder / "figures.json")
        self.assertEqual(roadfix(*words).returncode, 0)
        self.assertEqual(roadfix(*words).returncode, 2)
        self.assertEqual(roadfix(*words, "--overwrite").returncode, 0)
        other = (*words[:2], "--out", self.folder / "report2", *words[4:])
        self.assertIn("figures.json: is there already", roadfix(*other).stderr)

    def test_the_log_of_a_process_is_replaced_on_request_only(self):
        for words in ((BIN / "wheel_odometry", "--config", VEHICLE), (BIN / "monitor", "--no-dashboard", "--plain")):
            path = self.folder / f"{words[0].name}.lcm"
            command = [*map(str, words), "--log-in", str(self.drive), "--log-out", str(path)]
            codes = []
            for flags in ([], [], ["--overwrite"]):
                codes.append(subprocess.run(command + flags, capture_output=True, check=False, timeout=120).returncode)
            self.assertEqual(codes, [0, 2, 0], words)
        sentences = [str(BIN / "pose_server"), "--pose", "POSE_WHEEL", "--log-in", str(self.out), "--out", str(self.folder / "nmea")]
        codes = [subprocess.run(sentences + flags, capture_output=True, check=False, timeout=120).returncode for flags in ([], [], ["--overwrite"])]
        self.assertEqual(codes, [0, 2, 0])

    def test_what_is_wrong_is_said_under_the_subcommands_name(self):
        for words in self.all:
            name = "roadfix " + " ".join(words)
            with self.subTest(name):
                done = roadfix(*words, "--nonsense")
                self.assertEqual(done.returncode, 2)
                self.assertEqual(done.stdout, "")
                self.assertRegex(done.stderr, rf"^{name}: .*\n$")
        done = roadfix("export", self.drive, "--channel", "POSE_NONE", "--out", self.folder / "x")
        self.assertRegex(done.stderr, r"^roadfix export: .*POSE_NONE.*\n$")
        done = roadfix("replay", self.drive, "--stages", "wheel_odometry", "--config", "nowhere", "--out", self.folder / "x")
        self.assertRegex(done.stderr, r"^roadfix replay: --config: .*nowhere.*\n$")
        self.assertEqual(done.returncode, 2)

    def test_a_channel_that_is_not_there_is_told_with_those_that_are(self):
        for words in (("export", self.out, "--out", self.folder / "x"), ("evaluate", self.out, "--channel", "POSE_INS")):
            with self.subTest(words):
                done = roadfix(*words)
                self.assertEqual(done.returncode, 2)
                self.assertRegex(done.stderr, r"no poses on channel POSE_(FUSED|INS) \(there are POSE_WHEEL, REFERENCE\)")

    def test_channels_are_named_with_commas_or_again(self):
        for flags in (("--channel", "POSE_WHEEL,REFERENCE"), ("--channel", "POSE_WHEEL", "--channel", "REFERENCE")):
            done = roadfix("evaluate", *flags, self.out, "--out", self.folder / "channels", "--overwrite")
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertRegex(done.stdout, r"(?m)^REFERENCE .*aligned|^REFERENCE")

    def test_version_everywhere(self):
        programs = ["roadfix", "gnss_ins_ekf", "imm_fusion", "integrity", "vo_tracker", "wheel_odometry", "monitor", "recorder", "camera_driver",
                    "gnss_driver", "imu_driver", "pose_server", "wheel_driver"]
        cmake = (ROOT / "CMakeLists.txt").read_text()
        version = re.search(r"project\(roadfix VERSION ([0-9.]+)", cmake)[1]
        said = set()
        for program in programs:
            done = subprocess.run([BIN / program, "--version"], capture_output=True, text=True, check=False, timeout=60)
            self.assertEqual(done.returncode, 0, program)
            self.assertRegex(done.stdout, rf"^{program} {version} \(build [0-9a-f]{{16}}\)\n$")
            said.add(done.stdout.split(" ", 1)[1])
        self.assertEqual(len(said), 1, "programs of different builds")

    def lines_on_a_terminal(self, *words):
        """Lines as they stand on a terminal, standard error and output together: what is behind the last carriage return."""
        master, slave = pty.openpty()
        with subprocess.Popen([PROGRAM, *map(str, words)], stdout=slave, stderr=slave, stdin=slave) as process:
            os.close(slave)
            text = b""
            while True:
                try:
                    piece = os.read(master, 65536)
                except OSError:  # the other end is closed
                    break
                if not piece:
                    break
                text += piece
            process.wait(timeout=120)
        os.close(master)
        return text.decode().replace("\r\n", "\n").split("\n")

    def test_a_message_never_begins_on_anothers_line(self):
        hurt = self.folder / "hurt.lcm"
        whole = self.drive.read_bytes()
        middle = whole.index(b"\xed\xa1\xda\x01", len(whole) // 2)
        hurt.write_bytes(whole[:middle] + b"ABCD" + whole[middle + 4:])
        words = ("replay", hurt, "--stages", "wheel_odometry", "--config", VEHICLE, "--overwrite", "--out")
        for out in (self.folder / "shown.lcm", "/dev/full"):
            with self.subTest(out):
                lines = self.lines_on_a_terminal(*words, out)
                progress = [line for line in lines if " %" in line]
                self.assertTrue(any("\r" in line for line in progress), lines)
                for line in progress:
                    for part in filter(None, line.split("\r")):
                        self.assertRegex(part, r"^roadfix replay: +\d+ % *$")
                others = [line for line in lines if line and " %" not in line]
                self.assertTrue(any(line.startswith("roadfix replay: ") for line in others), others)

    def test_progress_into_a_file_is_lines(self):
        done = self.replay(self.folder / "lines.lcm", "--progress")
        self.assertEqual(done.returncode, 0)
        self.assertNotIn("\r", done.stderr)
        self.assertRegex(done.stderr, r"^(roadfix replay: \d+ %\n)+$")
        self.assertEqual(self.replay(self.folder / "quiet.lcm").stderr, "")

    def test_print_config_names_the_alternatives_of_a_choice(self):
        done = subprocess.run([BIN / "vo_tracker", "--config", VEHICLE, "--print-config"], capture_output=True, text=True, check=False)
        mode = re.search(r"(?m)^mode: (\w+)  # or: (\w+)$", done.stdout)
        self.assertEqual({"keyframe", "filter"}, set(mode.groups()))
        folder = self.folder / "printed"
        shutil.copytree(VEHICLE, folder)
        (folder / "vo_tracker.yaml").write_text(done.stdout)
        again = subprocess.run([BIN / "vo_tracker", "--config", folder, "--print-config"], capture_output=True, text=True, check=False)
        self.assertEqual(again.stdout, done.stdout)


if __name__ == "__main__":
    unittest.main()
