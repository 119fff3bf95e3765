# SPDX-License-Identifier: BSD-3-Clause
"""The project's pages: links lead to files and headings that exist, marked commands run, named tests exist."""

import re
import subprocess
from pathlib import Path

import pytest

import pages
from lab_tests import page_blocks

pytestmark = pytest.mark.tree

ROOT = Path(__file__).resolve().parents[2]
LINK = re.compile(r"\[[^\]]*\]\(([^)\s]+)\)")
#: Only against hanging: the machine may be busy.
LIMIT_S = {"quick": 180, "long": 1800}


def tracked(pattern):
    listed = subprocess.run(["git", "-C", ROOT, "ls-files", pattern], capture_output=True, text=True, check=True)
    return sorted(path for path in listed.stdout.split() if (ROOT / path).exists())


def prose(path):
    """A page without its fenced and indented blocks, and without code in a line."""
    text = re.sub(r"^```.*?^```", "", path.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    return re.sub(r"^(?:    .*\n)+", "\n", text, flags=re.MULTILINE)


def anchors(path):
    """The names that a page's headings can be linked by, as the usual web views of a repository make them."""
    found, seen = [], []
    for heading in re.findall(r"^#+ +(.*?) *$", prose(path), flags=re.MULTILINE):
        heading = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading)
        name = re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")
        found.append(f"{name}-{seen.count(name)}" if name in seen else name)
        seen.append(name)
    return found


@pytest.mark.parametrize("page", tracked("*.md"))
def test_links_lead_to_files_and_headings(page):
    broken = []
    for target in LINK.findall(re.sub(r"`[^`\n]*`", "", prose(ROOT / page))):
        if "://" in target or target.startswith("mailto:"):
            continue
        path, _, anchor = target.partition("#")
        leads_to = (ROOT / page).parent / path if path else ROOT / page
        if not leads_to.exists() or (anchor and anchor not in anchors(leads_to)):
            broken.append(target)
    assert broken == []


def test_headings_become_anchors(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("# A `name`, and more\n\n## Twice\n\n    # not one\n\n```bash\n# nor this\n```\n\n## Twice\n"
                    "## [B](b.md)!\n### Twice\n")
    assert anchors(page) == ["a-name-and-more", "twice", "twice-1", "b", "twice-2"]


def blocks_of(page):
    return page_blocks.marked_blocks(page, (ROOT / page).read_text(encoding="utf-8"))


def run_page(page, kind, folder):
    page_blocks.make_workspace(folder, ROOT)
    for block in blocks_of(page):
        if block.kind == "file":
            page_blocks.write_file(block, folder)
        elif block.kind == kind:
            # No master: blocks that need one are marked `lab`.
            page_blocks.run(block, folder, LIMIT_S[kind], ROS_MASTER_URI="http://localhost:1")


@pytest.mark.parametrize("page", [page for page in tracked("*.md") if any(b.kind == "quick" for b in blocks_of(page))])
def test_commands_run(page, tmp_path):
    run_page(page, "quick", tmp_path)


@pytest.mark.long
@pytest.mark.parametrize("page", [page for page in tracked("*.md") if any(b.kind == "long" for b in blocks_of(page))])
def test_long_commands_run(page, tmp_path):
    run_page(page, "long", tmp_path)


PAGE = """Text.

```bash run
echo here >one
```

```text
not run
```

```python file=src/mine/src/mine.py
VALUE = 3
```

```bash run
test "$(cat one)" = here
python3 -c 'import mine; assert mine.VALUE == 3'
```

```bash run lab
false
```
"""


def test_blocks_are_found_with_their_lines_and_run_in_order(tmp_path):
    page_blocks.make_workspace(tmp_path, ROOT)
    blocks = page_blocks.marked_blocks("page.md", PAGE)
    assert [(block.kind, block.line) for block in blocks] == [("quick", 3), ("file", 11), ("quick", 15), ("lab", 20)]
    for block in blocks[:3]:
        if block.kind == "file":
            page_blocks.write_file(block, tmp_path)
        else:
            page_blocks.run(block, tmp_path, 30)
    with pytest.raises(AssertionError, match=r"page\.md:20 ends with 1"):
        page_blocks.run(blocks[3], tmp_path, 30)
    assert not (ROOT / "one").exists() and not (ROOT / "src" / "mine").exists()


@pytest.mark.parametrize("mark", ["python run", "bash run fast", "bash runs", "bash file=a run"])
def test_a_mark_that_means_nothing_is_refused(mark):
    with pytest.raises(page_blocks.PageError, match="page.md:2: found"):
        page_blocks.marked_blocks("page.md", f"\n```{mark}\n```\n")


def test_a_command_that_fails_before_its_end_or_takes_too_long_is_noticed(tmp_path):
    failing, slow = page_blocks.marked_blocks("p.md", "```bash run\nfalse\ntrue\n```\n```bash run\nsleep 30\n```\n")
    with pytest.raises(AssertionError, match="ends with 1"):
        page_blocks.run(failing, tmp_path, 30)
    with pytest.raises(AssertionError, match="has not ended"):
        page_blocks.run(slow, tmp_path, 0.2)


def test_pains_page_answers_forty_rows_by_packages_and_tests_that_exist():
    text = (ROOT / "docs" / "pains.md").read_text(encoding="utf-8")
    rows = [[cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]]
            for line in text.splitlines() if re.match(r"\| \d+ \|", line)]
    assert [int(row[0]) for row in rows] == list(range(1, 41))
    packages = {Path(path).parent.name for path in tracked("*package.xml")} | {"tools", "docs", "docker"}
    for number, _, package, settled_by, test in rows:
        if settled_by.startswith("later"):
            assert (package, test) == ("–", ""), number
        else:
            assert set(package.split(", ")) <= packages and settled_by and test, number
    names = {Path(path).name for path in tracked("*.test") + tracked("*.py")}
    named = set(re.findall(r"`([a-z]\w*\.(?:test|py))`", text)) - {"enable_robot.py"}
    assert named and named <= names


def test_architecture_answers_where_to_look():
    """Each answer is a file, and a name that is in it."""
    text = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    table = text.split("## Where to look")[1].split("\n## ")[0]
    answers = re.findall(r"^\| [^|]+\? \| \[([^]]+)\]\(([^)]+)\), `([^`]+)` \| [^|]+ \|$", table, re.MULTILINE)
    assert len(answers) == table.count("\n| ") - 1 >= 10
    for label, link, name in answers:
        assert link.endswith("/" + label)
        assert re.search(r"\b%s\b" % re.escape(name), (ROOT / "docs" / link).read_text(encoding="utf-8")), name


def test_the_page_of_switches_has_every_environment_variable():
    listed = re.findall(r"`([A-Z_]+)`", (ROOT / "docs" / "switches.md").read_text(encoding="utf-8"))
    used = set()
    for path in [*tracked("*.py"), *tracked("*.test"), *tracked("*/nodes/*")]:
        used |= set(re.findall(r"""["']((?:LAB|IK|BULLET|BENCH|TORTURE)_[A-Z_]+)["']""",
                               (ROOT / path).read_text(encoding="utf-8")))
    assert used - set(listed) == set()


@pytest.mark.parametrize("page", sorted(pages.DOCS.glob("*.md")), ids=lambda page: page.name)
def test_tables_are_those_of_the_data(page):
    text = page.read_text(encoding="utf-8")
    assert pages.with_tables(text, pages.DOCS) == text, "tools/pages.py writes them"


def test_figures_name_their_run_and_lines_are_short():
    figures, runs = pages.rows_of(pages.FIGURES), {row["run"] for row in pages.rows_of(pages.RUNS)}
    assert all(row["here"] and row["run"] in runs for row in figures)
    keys = [row["bench"] for row in figures if row["bench"]]
    suites = re.findall(r'^    "(\w+)": \("', (ROOT / "tests/bench/run.py").read_text(encoding="utf-8"), re.MULTILINE)
    assert len(keys) == len(set(keys)) and {key.partition(":")[0] for key in keys} <= set(suites)
    for name in ("performance.md", "compatibility.md"):
        assert max(map(len, (pages.DOCS / name).read_text(encoding="utf-8").splitlines())) <= 200, name


def test_a_table_without_rows_or_with_an_unknown_column_is_refused(tmp_path):
    (tmp_path / "a.csv").write_text("kind,name\nx,one\ny,two\n")
    page = "<!-- table of a.csv, kind = %s: %s -->\nold\n<!-- end of table -->"
    assert "| name |\n|---|\n| two |\n<" in pages.with_tables(page % ("y", "name"), tmp_path)
    with pytest.raises(ValueError, match="'z'"):
        pages.with_tables(page % ("z", "name"), tmp_path)
    with pytest.raises(KeyError, match="size"):
        pages.with_tables(page % ("x", "size"), tmp_path)
    (tmp_path / "a.csv").write_text("kind,name\nx\n")
    with pytest.raises(ValueError, match="row 1"):
        pages.with_tables(page % ("x", "name"), tmp_path)


def test_the_figures_of_a_bench_are_taken():
    def of_bench(what, figure, ratio, met, **goal):
        return {"suite": "ik", "what": what, "unit": "ms", "figure": figure, "peer_name": "TRAC-IK", "ratio": ratio,
                "met": met, "goal": goal}
    machine = {"quick": False, "date": "2027-01-02 10:00 UTC", "cpu": "EPYC", "cores": 2, "load_before": "0.10 0.2 0.3",
               "rounds": 5}
    bench = {"machine": machine, "rows": [of_bench("mean", 0.02345, 0.0712, True, ratio_most=0.1),
                                          of_bench("p99", 1.5, None, False, most=1.0),
                                          of_bench("median", 0.1, None, None)]}
    figures = [{"figure": name, "here": "", "beside": "", "goal": "", "run": "old", "bench": f"ik: {name}"}
               for name in ("mean", "p99")]
    runs = [{"run": "old", "date": "", "machine": "", "command": ""}]
    assert pages.take(bench, "new", figures, runs) == ["ik: median"]
    assert [(row["here"], row["beside"], row["goal"], row["run"]) for row in figures] == [
        ("0.0234 ms", "TRAC-IK: 0.0712 times", "0.1 times", "new"), ("1.5 ms", "TRAC-IK", "1 ms: **not kept**", "new")]
    assert [(row["run"], row["date"], row["command"]) for row in runs] == [
        ("new", "2027-01-02", "`bench ik --rounds 5`")]
    with pytest.raises(ValueError, match="'new'"):
        pages.take(bench, "new", figures, runs)
    machine["quick"] = True
    with pytest.raises(ValueError, match="--quick"):
        pages.take(bench, "other", figures, runs)
