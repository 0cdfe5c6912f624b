"""What README, CONTRIBUTING and docs/ point to is there: links, and paths in backticks. Argument: repository."""
import re
import sys
import tempfile
import unittest
from pathlib import Path

ROOT = Path(sys.argv.pop(1)).resolve()
# What stands for a name: NAME, X, and the barometer of CONTRIBUTING's example.
PAGES = ["README.md", "CONTRIBUTING.md", "CHANGELOG.md", "configs/README.md", "tools/experiments/README.md", *sorted(str(p.relative_to(ROOT)) for p in (ROOT / "docs").glob("*.md"))]
FOLDERS = ("lib", "processes", "test", "scripts", "docs", "configs", "lcmtypes", "tools", "logs", "cmake")


def missing(root, page):
    """What a page names and the tree below `root` has not."""
    text = (root / page).read_text()
    lost = []
    for target in re.findall(r"\]\(([^)#\s]+)(?:#[^)]*)?\)", text):
        if "://" not in target and not ((root / page).parent / target).exists():
            lost.append(target)
    for path in re.findall(rf"`((?:{'|'.join(FOLDERS)})/[^`\s]+)", text):
        path = re.sub(r"\{[^}]*\}|<[^>]*>|NAME|VEHICLE|\bX\b|baro", "*", path).split(":")[0].rstrip(".,")
        if not any(root.glob(path)):
            lost.append(path)
    return lost


class Links(unittest.TestCase):
    def test_every_page_points_to_what_is_there(self):
        for page in PAGES:
            with self.subTest(page):
                self.assertEqual(missing(ROOT, page), [])

    def test_what_is_not_there_is_found(self):
        with tempfile.TemporaryDirectory() as folder:
            root = Path(folder)
            (root / "lib").mkdir()
            (root / "lib/there.h").write_text("")
            (root / "page.md").write_text("[a](lib/there.h) [b](gone.md) `lib/there.h` `lib/<x>.h` `lib/gone.h` [c](https://example.org/x)")
            self.assertEqual(missing(root, "page.md"), ["gone.md", "lib/gone.h"])


if __name__ == "__main__":
    unittest.main()
