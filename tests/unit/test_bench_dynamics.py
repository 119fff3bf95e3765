# SPDX-License-Identifier: BSD-3-Clause
"""The table of how an arm feels: its parts are those that are measured; a slip in a name changes nothing."""
import csv
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def dynamics():
    sys.path.insert(0, str(ROOT / "tests/bench"))
    import dynamics as module
    yield module
    sys.path.remove(str(ROOT / "tests/bench"))


def test_every_row_says_where_its_figure_is_from(dynamics):
    with dynamics.TABLE.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    simulated = {row["part"] for row in rows if row["kind"] == "simulated"}
    assert simulated == set(dynamics.PARTS)
    assert {row["kind"] for row in rows} == {"simulated", "published", "recorded", "left out"}
    assert all(row["source"] or row["kind"] == "left out" for row in rows)


def test_an_unknown_part_is_refused(dynamics, capsys):
    before = dynamics.TABLE.read_bytes()
    assert dynamics.main(["payloads"]) == 2
    assert "payload, stopping" in capsys.readouterr().err and dynamics.TABLE.read_bytes() == before


def test_a_hand_that_was_told_of_its_weight_keeps_it(dynamics):
    with dynamics.made(tools=(dynamics.Tool(dynamics.SIDE, dynamics.WEIGHT % 1.0, (0.0, 0.0, 0.08)),)) as lab:
        arm = dynamics.at(lab, dynamics.STRETCHED)
        height = arm.pose[2, 3]
        dynamics.stream(lab, dynamics.Mode.TORQUE, [0.0] * 7, 0.3)
        assert height - arm.pose[2, 3] > 0.05
