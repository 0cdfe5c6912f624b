#!/usr/bin/env python3
"""The dashboard in a headless Chromium, at 1280 and at 400 pixels: what a person sees is there, fits, and follows the slider.

  dashboard_test.py            needs build/release/bin/monitor; prints "skipped: ..." where there is no browser
"""
import os
import sys
import time
import unittest
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "scripts/figures.d")]
sys.dont_write_bytecode = True

from browser import Browser, chromium  # noqa: E402
from operation import Monitor  # noqa: E402
from support import Runs  # noqa: E402

BIN = Path(os.environ.get("ROADFIX_BIN", ROOT / "build/release/bin"))


class DashboardTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        runs = Runs(ROOT, time.monotonic() + 170)
        runs.bin = BIN
        log = ROOT / "logs/demo.lcm"
        cls.folder = runs.folder("dashboard_test")
        estimates = cls.folder / "out.lcm"
        runs.roadfix("replay", log, "--stages", "wheel_odometry,gnss_ins_ekf,imm_fusion", "--config", ROOT / "configs/demo", "--out", estimates)
        cls.monitor = Monitor(runs, "--log-in", log, "--log-in", estimates, "--listen", "127.0.0.1:0").__enter__()
        cls.browser = Browser()

    @classmethod
    def tearDownClass(cls):
        cls.browser.__exit__()
        cls.monitor.__exit__()

    def open(self, width, at):
        self.browser.size(width, 900)
        self.browser.go("about:blank")
        self.browser.go(f"{self.monitor.url}?at={at}")
        self.assertTrue(self.browser.wait("document.documentElement.dataset.shown"), "no frame was shown")

    def text(self, selector):
        return self.browser.value(f"document.querySelector('{selector}').innerText")

    def test_the_tunnel_at_both_widths(self):
        for width in (1280, 400):
            with self.subTest(width=width):
                self.open(width, 45)
                self.assertIn("Degraded", self.text("#verdict-text"))
                self.assertIn("GNSS is silent", self.text("#reasons"))
                self.assertIn("POSE_WHEEL", self.text("#channels"))
                self.assertIn("going straight", self.text("#modes"))
                self.assertIn("Truth", self.text("#legend"))
                self.assertIn("How far off", self.text("#errors-title"))
                self.assertLessEqual(self.browser.value("document.documentElement.scrollWidth"), width)
                beside = self.browser.value("[...document.querySelectorAll('.scroll')].map((box) => box.scrollWidth - box.clientWidth)")
                self.assertEqual(beside, [0, 0, 0], "a table scrolls sideways")

    def test_a_pose_that_is_none_has_no_numbers(self):
        self.open(1280, 0.5)
        self.assertIn("Do not use", self.text("#verdict-text"))
        self.assertIn("not known", self.text("#facts"))
        self.assertNotIn("°", self.text("#facts"))
        self.open(1280, 20)
        self.assertNotIn("not known", self.text("#facts"))
        self.assertRegex(self.text("#facts"), r"(?i)heading sure to\s+± \d+\.\d\s+°")

    def test_something_is_drawn(self):
        self.open(1280, 45)
        colours = self.browser.wait("""(() => {
            const map = document.getElementById('map');
            const data = map.getContext('2d').getImageData(0, 0, map.width, map.height).data;
            const colours = new Set();
            for (let i = 0; i < data.length; i += 4) colours.add(data[i] << 16 | data[i + 1] << 8 | data[i + 2]);
            return colours.size > 20 ? colours.size : 0;
        })()""")
        self.assertTrue(colours, "the map is empty")
        self.assertTrue(self.browser.value("document.querySelector('#errors canvas').width > 300"))

    def test_the_slider_goes_to_another_moment(self):
        self.open(1280, 45)
        before = self.browser.value("document.documentElement.dataset.shown")
        self.browser.value("(() => { const s = document.getElementById('scrub'); s.value = 75; s.dispatchEvent(new Event('input')); })()")
        self.assertTrue(self.browser.wait(f"document.documentElement.dataset.shown !== '{before}'"))
        self.assertIn("OK to use", self.text("#verdict-text"))

    def test_nothing_is_fetched_from_elsewhere(self):
        self.open(1280, 10)
        names = self.browser.value("performance.getEntriesByType('resource').map((e) => e.name)")
        self.assertGreater(len(names), 5)
        self.assertEqual([name for name in names if not name.startswith(self.monitor.url) and not name.startswith("data:")], [])


if __name__ == "__main__":
    if not chromium():
        print("skipped: no chromium")
        sys.exit(0)
    unittest.main(verbosity=1)
