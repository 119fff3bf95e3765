# SPDX-License-Identifier: BSD-3-Clause
"""tests/platforms/run: its rows fit the table, and it finds what baxter.sh prints. The systems take minutes."""

import importlib.util
import subprocess
from importlib.machinery import SourceFileLoader
from pathlib import Path

import pytest

import pages

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def run():
    loader = SourceFileLoader("platforms_run", str(ROOT / "tests" / "platforms" / "run"))
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader(loader.name, loader))
    loader.exec_module(module)
    return module


def test_a_run_takes_the_place_of_the_systems_last_one_and_leaves_those_by_hand(run, tmp_path):
    debian, ubuntu = run.SYSTEMS[0], run.SYSTEMS[-1]
    by_hand = [row for row in pages.rows_of(run.DATA) if not row["command"].startswith(run.COMMAND)]
    rows = run.put(by_hand, run.row_of(debian, "214", 4.96, "0.0 mm", ""))
    rows = run.put(rows, run.row_of(debian, "200", 4.5, "0.0 mm", "9 passed, 0 failed"))
    assert len(rows) == len(by_hand) + 1 and all(row in rows for row in by_hand)
    assert rows[0]["set-up"] == "200 s" and "--tests bookworm" in rows[0]["command"]
    rows = run.put(rows, run.row_of(debian, "180", 3.0, "0.0 mm", ""))
    rows = run.put(rows, run.row_of(debian, "170", 3.0, "0.0 mm", ""))
    assert [row["set-up"] for row in rows[:2]] == ["170 s", "200 s"], "what the tests showed stays"
    rows = run.put(rows, run.row_of(ubuntu, "300", 5, "0.0 mm", ""))
    pages.write_rows(tmp_path / "platforms.csv", rows)
    assert len(pages.rows_of(tmp_path / "platforms.csv")) == len(rows)


def test_the_printed_command_that_installs_podman_is_found(run):
    script = 'source "$1/tools/container.bash"; apt() { :; }; podman_line'
    printed = subprocess.run(["bash", "-c", script, "test", ROOT], capture_output=True, text=True, check=True).stdout
    assert run.INSTALLS_PODMAN.search(f"baxter.sh: no ROS 1 here:\n  {printed}")[1] == "apt install podman"


def test_no_other_system_is_accepted(run, capsys):
    with pytest.raises(SystemExit):
        run.parsed(["slackware"])
    assert "bookworm" in capsys.readouterr().err
