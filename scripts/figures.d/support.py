"""What the measurements share: runs of the built programs, each done once however many rows use it."""
import json
import math
import os
import shutil
import subprocess
import time


class Skipped(Exception):
    """A row that cannot be measured here, with the reason."""


def root_mean_square(values):
    values = list(values)
    return math.sqrt(sum(v * v for v in values) / len(values)) if values else math.nan


class Runs:
    """Imports, replays and evaluations under build/figures; results are kept for the length of this program."""

    def __init__(self, root, deadline):
        self.root = root
        self.shared = root / ".." / "shared"
        self.bin = root / "build" / "release" / "bin"
        self.work = root / "build" / "figures"
        self.deadline = deadline
        self.known = {}

    def once(self, key, function):
        """function() on the first call with this key, its result on later ones."""
        if key not in self.known:
            self.known[key] = function()
        return self.known[key]

    def program(self, name):
        path = self.bin / name
        if not path.exists():
            raise Skipped(f"build/release/bin/{name} is not built")
        return path

    def drive(self, name):
        path = self.shared / "data" / name
        if not path.exists():
            raise Skipped(f"../shared/data/{name} is not here")
        return path

    def call(self, *command):
        """Standard output of a program; Skipped with its last words where it fails or the time is up."""
        left = self.deadline - time.monotonic()
        if left <= 0:
            raise Skipped("45 minutes are over")
        words = [str(word) for word in command]
        try:
            done = subprocess.run(words, cwd=self.root, capture_output=True, text=True, timeout=left)
        except subprocess.TimeoutExpired:
            raise Skipped("45 minutes are over") from None
        if done.returncode != 0:
            last = (done.stderr.strip() or done.stdout.strip() or "no output").splitlines()[-1]
            raise Skipped(f"{' '.join(words[:3])} ended with {done.returncode}: {last}")
        return done.stdout

    def benchmark(self, program, counter):
        """A counter of a benchmark program's only benchmark; median of five repetitions."""
        flags = ("--benchmark_format=json", "--benchmark_repetitions=5", "--benchmark_report_aggregates_only=true")
        for row in json.loads(self.call(self.program(program), *flags))["benchmarks"]:
            if row.get("aggregate_name") == "median" and counter in row:
                return row[counter]
        raise Skipped(f"{program} printed no median of {counter}")

    def roadfix(self, *arguments):
        """A subcommand of the tool; what an earlier measurement wrote is replaced."""
        writes = arguments[0] in ("evaluate", "export", "import", "paper", "replay", "simulate") and "--out" in arguments
        replace = ("--overwrite",) if writes and "--overwrite" not in arguments else ()
        return self.call(self.program("roadfix"), *arguments, *replace)

    def python(self, code, *arguments):
        """What `code` prints, with numpy and python/roadfix_log. Debian's Python first, which python3-numpy belongs to."""
        for program in ("/usr/bin/python3", shutil.which("python3")):
            if program and os.path.exists(program):
                try:
                    self.call(program, "-c", "import numpy")
                except Skipped:
                    continue
                return self.call("env", f"PYTHONPATH={self.root / 'python'}", program, "-c", code, *arguments)
        raise Skipped("no Python with numpy (Debian: python3-numpy)")

    def imported(self, drive):
        """(log, vehicle folder) of a drive of ../shared/data."""

        def run():
            folder = self.folder(drive)
            log, vehicle = folder / "drive.lcm", folder / "vehicle"
            shutil.rmtree(vehicle, ignore_errors=True)
            self.roadfix("import", self.drive(drive), "--out", log, "--vehicle", vehicle, "--overwrite")
            return log, vehicle

        return self.once(("import", drive), run)

    def fleet(self, stages, scenario, seeds, *words, aligned=(), config=None):
        """(figures of every channel, folder) of a scenario with each of the seeds 1 to `seeds`, in their order, by `roadfix fleet`. Words are KEY=VALUE;
        `aligned` has pairs (channel, alignment) that differ from what the channel's frame suggests, `config` is a folder with a tuning. The errors of a channel lie in
        report/CHANNEL_errors.csv of its drive's folder."""

        def run():
            path = self.folder("fleet", scenario, *words, *(("tuned",) if config else ()))
            tuning = ("--config", config) if config else ()
            align = [word for channel, alignment in aligned for word in ("--align", f"{channel}={alignment}")]
            self.roadfix("fleet", "run", scenario, f"seeds=1..{seeds}", *words, "--stages", stages, *align, *tuning, "--keep", "errors",
                         "--engine", "local", "--out", path, "--overwrite")
            folders = [path / "tasks" / f"{index:06}" for index in range(seeds)]
            return [(json.loads((folder / "result.json").read_text())["figures"]["channels"], folder) for folder in folders]

        return self.once(("fleet", stages, scenario, seeds, words, aligned, config), run)

    def folder(self, *words):
        name = "_".join(str(word).lstrip("-").replace(",", "_") for word in words) or "run"
        path = self.work / name
        path.mkdir(parents=True, exist_ok=True)
        return path

    def recorded(self, stages, drive, *words, config=None, align=None, fit_latency=False):
        """(figures of every channel, folder) of each drive that these words of `roadfix fleet` make of a recording of ../shared/data, in their order;
        `config` is a folder with a tuning, `align` a pair (channel, alignment). The errors of a channel lie in report/CHANNEL_errors.csv of its
        drive's folder."""

        def run():
            self.drive(drive)
            path = self.folder("fleet", drive.strip("/").replace("/", "_"), *words)
            flags = [*(("--config", config) if config else ()), *(("--align", "=".join(align)) if align else ()), *(("--fit-latency",) if fit_latency else ())]
            self.roadfix("fleet", "run", drive, *words, "--root", self.shared / "data", "--stages", stages, *flags, "--keep", "errors", "--engine", "local",
                         "--out", path, "--overwrite")
            folders = sorted(path.glob("tasks/*"))
            return [(json.loads((folder / "result.json").read_text())["figures"]["channels"], folder) for folder in folders]

        return self.once(("recorded", stages, drive, words, config, align, fit_latency), run)

    def scored(self, channel, stages, drive, *words, **options):
        """The figures of one channel of one recording, by recorded()."""
        ((channels, _),) = self.recorded(stages, drive, *words, **options)
        return channels[channel]

    def windows(self, channel, stages, drive, length, first, every, phases, *words, **options):
        """RMS of the horizontal errors at the ends of all outages of all phases, m; one drive of a fleet a phase."""
        cut = (f"cut_gnss_s={length}", f"every_s={every}", f"after_s={first}", f"phase_s={','.join(map(str, phases))}")
        ends = []
        for phase, (channels, _) in zip(phases, self.recorded(stages, drive, *cut, *words, **options)):
            outages = channels[channel]["outages"]
            if outages["missing"]:
                raise Skipped(f"{outages['missing']} outages of phase {phase} end without an estimate")
            ends += [outage["horizontal_m"] for outage in outages["each"]]
        if not ends:
            raise Skipped("the drive has no such outage")
        return root_mean_square(ends)
