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


def searches(page):
    """What docs/PAPERS.md tells to search for: the last column of its table of equations."""
    return re.findall(r"(?m)^\|[^|]*\|[^|]*\|[^|]*\| `([^`]+)` \|$", page)


def not_found(root, texts):
    """Those that no source file of lib has in one line."""
    sources = "\n".join(path.read_text() for path in (root / "lib").rglob("*") if path.suffix in (".h", ".cpp"))
    return [text for text in texts if text not in sources]


class Equations(unittest.TestCase):
    def test_every_equation_is_where_the_table_of_papers_says(self):
        texts = searches((ROOT / "docs/PAPERS.md").read_text())
        self.assertGreater(len(texts), 15)
        self.assertEqual(not_found(ROOT, texts), [])

    def test_an_equation_that_is_nowhere_is_found_missing(self):
        self.assertEqual(not_found(ROOT, ["Ock et al. 2020 (9)", "Ock et al. 2020 (99)"]), ["Ock et al. 2020 (99)"])


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
