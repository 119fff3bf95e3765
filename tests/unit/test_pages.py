# SPDX-License-Identifier: BSD-3-Clause
"""The project's pages: every link to a file leads somewhere, and the tests that docs/pains.md names exist."""

import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
LINK = re.compile(r"\[[^\]]*\]\(([^)\s]+)\)")


def tracked(pattern):
    listed = subprocess.run(["git", "-C", ROOT, "ls-files", pattern], capture_output=True, text=True, check=True)
    return sorted(listed.stdout.split())


@pytest.mark.parametrize("page", tracked("*.md"))
def test_links_lead_to_files(page):
    text = (ROOT / page).read_text(encoding="utf-8")
    text = re.sub(r"^```.*?^```", "", text, flags=re.MULTILINE | re.DOTALL)
    broken = []
    for target in LINK.findall(text):
        path = target.partition("#")[0]
        if "://" in target or not path or target.startswith("mailto:"):
            continue
        if not (ROOT / page).parent.joinpath(path).exists():
            broken.append(target)
    assert broken == []


def test_pains_page_names_forty_rows_and_tests_that_exist():
    text = (ROOT / "docs" / "pains.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (\d+) \|", text, flags=re.MULTILINE)
    assert [int(row) for row in rows] == list(range(1, 41))
    names = {Path(path).name for path in tracked("*.test") + tracked("*.py")}
    named = set(re.findall(r"`([a-z]\w*\.(?:test|py))`", text)) - {"enable_robot.py"}
    assert named and named <= names
