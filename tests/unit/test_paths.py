# SPDX-License-Identifier: BSD-3-Clause
"""Paths in pages, comments and tools exist, and docs/architecture.md links each package by its folder."""

import re
import subprocess
from pathlib import Path

import pytest
from workspace_tree import ROOT, is_in_tests, own_files, packages

pytestmark = pytest.mark.tree

TOPS = "src|docs|tests|tools|docker|rosinstall"
PATTERN = r"(?<![\w./~$}{*+-])((?:%s)/[\w./-]*[\w/])"
PATH = re.compile(PATTERN % TOPS)
# A package's README may also use paths relative to its own folder.
README_PATH = re.compile(PATTERN % (TOPS + "|test|nodes|scripts|launch|config|urdf"))
# A reader's own package in the pages.
READERS_OWN = "src/my_lab"
# Placeholders for any file or folder of their kind.
GENERAL = {"rosinstall/FILE", "test/unit", "test/rostest"}
NOT_READ = (".rst", ".ipynb", ".png", ".jpg", ".svg", ".stl", ".dae", ".rosinstall")


def stale_paths(name, text):
    """(line, path) of missing paths in the text of file `name`, relative to the root, its folder or its package."""
    bases = [ROOT, *(ROOT / name).parents[:3]]
    pattern = README_PATH if name.endswith("/README.md") else PATH
    found = []
    for number, line in enumerate(text.split("\n"), 1):
        for path in pattern.findall(line):
            if path in GENERAL or path.startswith(READERS_OWN):
                continue
            # A decision may be named by its number alone.
            if not any((base / path).exists() or next(base.glob(path + "-*"), None) for base in bases):
                found.append((number, path))
    return found


def ignored(paths):
    """Those of the paths that git ignores, because set-up makes them."""
    done = subprocess.run(["git", "-C", str(ROOT), "check-ignore", "--stdin"], input="\n".join(paths), text=True,
                          capture_output=True)
    return set(done.stdout.split("\n"))


def test_paths_in_pages_comments_and_tools_exist():
    stale = []
    for file in own_files():
        if file.endswith(NOT_READ) or (is_in_tests(file) and not file.endswith(".md")):
            continue
        text = (ROOT / file).read_bytes()
        stale += [(file, *where) for where in stale_paths(file, text.decode(errors="replace"))]
    made_by_set_up = ignored([path for _, _, path in stale])
    assert [where for where in stale if where[2] not in made_by_set_up] == []


def test_a_stale_path_is_noticed():
    text = "see `src/nowhere/`, docs/architecture.md,\ntest/unit, and docs/decisions/0007; tools/gone.py"
    assert stale_paths("README.md", text) == [(1, "src/nowhere/"), (2, "tools/gone.py")]
    assert stale_paths("src/lab/live_plot/README.md", "`src/live_plot/`, `src/rqt_plot/`, `config/a.yaml`") == [
        (1, "src/rqt_plot/"), (1, "config/a.yaml")]


def test_each_package_has_a_row_on_the_architecture_page():
    page = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (\[.*?\)) \|", page, flags=re.MULTILINE)
    linked = {name: Path(folder) for row in rows for name, folder in re.findall(r"\[(\w+)\]\(\.\./([^)]+)\)", row)}
    assert {name: linked.get(name) for name in packages()} == packages()


def test_compat_holds_stand_ins_alone():
    listed = subprocess.run(["bash", "-c", 'source "$1"; printf "%s\\n" "${STAND_INS[@]}"', "x",
                             str(ROOT / "tools" / "stand_ins.bash")], capture_output=True, text=True, check=True)
    stand_ins = {Path(path).name for path in listed.stdout.split() if path.startswith("src/compat/")}
    assert {name for name, folder in packages().items() if folder.parent == Path("src/compat")} == stand_ins
