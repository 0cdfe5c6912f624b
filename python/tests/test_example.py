"""The example on a replay of the demo drive says what roadfix evaluate says. Arguments: repository, roadfix program."""
import json
import re
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

PROGRAM = Path(sys.argv.pop(2)).resolve()
ROOT = Path(sys.argv.pop(1)).resolve()
try:
    import numpy  # noqa: F401
except ImportError:
    print("skipped: no numpy (Debian: python3-numpy)")
    sys.exit(0)


def run(*command, **options):
    return subprocess.run([str(word) for word in command], capture_output=True, text=True, check=True, **options).stdout


class Example(unittest.TestCase):
    def test_its_error_is_that_of_roadfix_evaluate(self):
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            log = folder / "out.lcm"
            run(PROGRAM, "replay", ROOT / "logs/demo.lcm", "--stages", "gnss_ins_ekf", "--config", ROOT / "configs/demo", "--out", log)
            run(PROGRAM, "evaluate", log, "--out", folder / "report", "--json", folder / "figures.json")
            told = run(sys.executable, ROOT / "python/examples/look_at_a_drive.py", log, env={"PYTHONPATH": str(ROOT / "python")})
            figures = json.loads((folder / "figures.json").read_text())["channels"]["POSE_INS"]
        rmse_m = float(re.search(r"RMSE ([0-9.]+) m", told).group(1))
        wanted_m = figures["errors"]["horizontal_m"]["rmse"]
        self.assertLess(abs(rmse_m / wanted_m - 1), 0.05, told)
        self.assertGreater(rmse_m, 0.01)
        inside = float(re.search(r"inside of 3 sigma: ([0-9.]+)%", told).group(1))
        self.assertGreater(inside, 95)


if __name__ == "__main__":
    unittest.main()
