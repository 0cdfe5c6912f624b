"""scripts/check knows what belongs to a name, scripts/build shows how far it is and what failed, the stopwatch says what the time went to."""
import importlib.machinery
import importlib.util
import os
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

ROOT = Path(sys.argv.pop(1)).resolve()
sys.dont_write_bytecode = True


def load(path):
    loader = importlib.machinery.SourceFileLoader(path.name, str(path))
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader(path.name, loader))
    loader.exec_module(module)
    return module


class Check(unittest.TestCase):
    script = ROOT / "scripts" / "check"

    def run_script(self, *words):
        return subprocess.run([str(self.script), *words], capture_output=True, text=True, cwd=ROOT)

    def test_help_names_every_library(self):
        text = self.run_script("--help").stdout
        for cmake in (ROOT / "lib").glob("*/CMakeLists.txt"):
            self.assertIn(f" {cmake.parent.name} ", text.replace("\n", " "))

    def test_an_unknown_name_is_told_with_those_that_are_there(self):
        done = self.run_script("no_such_library")
        self.assertEqual(done.returncode, 1)
        self.assertIn("nothing is called no_such_library; there are", done.stderr)
        self.assertIn(" wheel ", done.stderr)

    def test_statistics_are_left_out_unless_asked_for(self):
        check = load(self.script)
        folder = check.folders()["wheel"]
        self.assertEqual(check.test_programs(folder, False), (["wheel_test"], ["wheel_statistics_test"]))
        self.assertEqual(check.test_programs(folder, True), (["wheel_test", "wheel_statistics_test"], []))
        self.assertEqual(check.library_target(folder), "roadfix_wheel")

    def test_a_nested_library_is_not_its_parent(self):
        check = load(self.script)
        check.git = lambda *words: ["lib/simulation/scene/tiles.cpp", "test/unit/wheel/drive.cpp"] if words[0] == "diff" else []
        self.assertEqual(check.changed(), ["scene", "wheel"])


class Help(unittest.TestCase):
    def test_every_script_says_what_it_does_and_does_nothing_else(self):
        for script in sorted((ROOT / "scripts").iterdir()):
            if script.is_file() and os.access(script, os.X_OK):
                with self.subTest(script=script.name):
                    done = subprocess.run([str(script), "--help"], capture_output=True, text=True, cwd=ROOT, timeout=60)
                    self.assertEqual(done.returncode, 0)
                    self.assertIn(f"scripts/{script.name}", done.stdout)


class Build(unittest.TestCase):
    def build(self, output, status):
        """scripts/build in a folder of its own, with a cmake that prints `output`."""
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            (folder / "scripts").mkdir()
            (folder / "bin").mkdir()
            (folder / "build" / "release").mkdir(parents=True)
            (folder / "CMakePresets.json").touch()
            (folder / "build" / "release" / "build.ninja").touch()
            (folder / "scripts" / "build").write_text((ROOT / "scripts" / "build").read_text())
            cmake = folder / "bin" / "cmake"
            cmake.write_text(f"#!/bin/sh\ncat <<'END'\n{output}\nEND\nexit {status}\n")
            cmake.chmod(0o755)
            path = f"{folder / 'bin'}:{os.environ['PATH']}"
            return subprocess.run(["bash", "scripts/build"], cwd=folder, env={**os.environ, "PATH": path}, capture_output=True, text=True)

    def test_progress_is_seen(self):
        done = self.build("\n".join(f"[{k}/50] Building CXX object {k}.o" for k in range(1, 51)), 0)
        self.assertEqual(done.returncode, 0)
        self.assertIn("build: 10 % of 50 steps\n", done.stdout)
        self.assertIn("build: 100 % of 50 steps\n", done.stdout)
        self.assertNotIn("Building", done.stdout)

    def test_errors_are_told_in_full_and_end_it(self):
        done = self.build("[1/2] Building CXX object a.o\nFAILED: a.o\na.cpp:3:1: error: no such thing\n[2/2] Building CXX object b.o", 1)
        self.assertEqual(done.returncode, 1)
        self.assertIn("a.cpp:3:1: error: no such thing", done.stderr)
        self.assertNotIn("Building", done.stderr)


class WithoutTests(unittest.TestCase):
    """Which way scripts/build configures a folder: a cmake that writes down what it was asked for stands in for CMake."""

    def configured(self, arguments, cached=None):
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            for path in ("scripts", "bin", "build/release"):
                (folder / path).mkdir(parents=True)
            (folder / "CMakePresets.json").touch()
            if cached:
                (folder / "build/release/CMakeCache.txt").write_text(f"ROADFIX_TESTS:BOOL={cached}\n")
                (folder / "build/release/build.ninja").touch()
            (folder / "scripts/build").write_text((ROOT / "scripts/build").read_text())
            (folder / "scripts/setup").write_text('#!/bin/sh\necho "setup $*" >>configured\n')
            (folder / "scripts/setup").chmod(0o755)
            cmake = folder / "bin/cmake"
            cmake.write_text('#!/bin/sh\n[ "$1" = --build ] || echo "$*" >>configured\n')
            cmake.chmod(0o755)
            path = f"{folder / 'bin'}:{os.environ['PATH']}"
            done = subprocess.run(["bash", "scripts/build", *arguments], cwd=folder, env={**os.environ, "PATH": path}, capture_output=True, text=True)
            self.assertEqual(done.returncode, 0, done.stderr)
            asked = folder / "configured"
            return asked.read_text() if asked.exists() else ""

    def test_a_new_folder_has_tests_unless_told(self):
        self.assertEqual(self.configured([]), "--preset release\n")
        self.assertEqual(self.configured(["--without-tests", "release", "roadfix"]), "--preset release -DROADFIX_TESTS=OFF\n")

    def test_tests_are_added_and_never_taken_away(self):
        self.assertEqual(self.configured(["release"], cached="OFF"), "setup \n--preset release\n")
        self.assertEqual(self.configured(["--without-tests", "release"], cached="ON"), "")
        self.assertEqual(self.configured(["--without-tests", "release"], cached="OFF"), "")
        self.assertEqual(self.configured(["release"], cached="ON"), "")


class Demo(unittest.TestCase):
    def demo(self, files_in_cache):
        """scripts/demo in a folder of its own, with a build that says what it was asked for and makes a tool that does nothing."""
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            for path, text in {
                "scripts/demo": (ROOT / "scripts/demo").read_text(),
                "scripts/stopwatch.sh": (ROOT / "scripts/stopwatch.sh").read_text(),
                "scripts/setup": "#!/bin/sh\n",
                "scripts/build": "#!/bin/sh\necho \"asked for: $*; cache off: ${CCACHE_DISABLE:-no}\"\n",
                "build/release/bin/roadfix": "#!/bin/sh\necho \"roadfix $1\"\n",
                "bin/ccache": f"#!/bin/sh\nprintf 'cache_miss\\t7\\nfiles_in_cache\\t{files_in_cache}\\n'\n",
            }.items():
                (folder / path).parent.mkdir(parents=True, exist_ok=True)
                (folder / path).write_text(text)
                (folder / path).chmod(0o755)
            environment = {key: value for key, value in os.environ.items() if key != "CCACHE_DISABLE"}
            environment["PATH"] = f"{folder / 'bin'}:{environment['PATH']}"
            return subprocess.run(["bash", "scripts/demo"], cwd=folder, env=environment, capture_output=True, text=True)

    def test_only_the_tool_is_built_and_the_time_is_told(self):
        done = self.demo(5)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("asked for: --without-tests release roadfix; cache off: no\n", done.stdout)
        self.assertRegex(done.stdout, r"roadfix evaluate\nscripts/demo: [0-9.]+ min: packages [0-9.]+ min, build [0-9.]+ min, run [0-9.]+ min\n$")

    def test_an_empty_compiler_cache_is_left_alone(self):
        self.assertIn("cache off: 1\n", self.demo(0).stdout)


class Stopwatch(unittest.TestCase):
    def test_the_parts_are_told_in_minutes(self):
        script = f"source {ROOT}/scripts/stopwatch.sh; sleep 0.1; spend packages; spend 'build and link'; spent it"
        done = subprocess.run(["bash", "-c", script], capture_output=True, text=True)
        self.assertRegex(done.stdout, r"^it: 0\.\d min: packages 0\.\d min, build and link 0\.0 min\n$")


if __name__ == "__main__":
    unittest.main()
