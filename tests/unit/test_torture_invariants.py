# SPDX-License-Identifier: BSD-3-Clause
"""Torture's invariants: each finds its own violation, and nothing else."""
import json
import math
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from baxter_core_msgs.msg import EndpointState
from sensor_msgs.msg import JointState, LaserScan

TORTURE = Path(__file__).resolve().parents[1] / "torture"


@pytest.fixture(scope="module", autouse=True)
def modules():
    sys.path.insert(0, str(TORTURE))
    import invariants
    import journal

    yield SimpleNamespace(invariants=invariants, journal=journal)
    sys.path.remove(str(TORTURE))


def test_nan_is_found_however_deep(modules):
    message = EndpointState()
    assert modules.invariants.not_finite("/t", "x/Y", message) == []
    message.twist.angular.z = math.nan
    assert modules.invariants.not_finite("/t", "x/Y", message) == ["/t: twist.angular.z is nan"]
    states = JointState(name=["a"], position=(0.0, math.inf))
    assert modules.invariants.not_finite("/t", "sensor_msgs/JointState", states) == ["/t: position[1] is inf"]


def test_a_scan_without_echo_is_infinite_but_never_nan(modules):
    scan = LaserScan(ranges=[math.inf])
    assert modules.invariants.not_finite("/t", LaserScan._type, scan) == []
    scan.ranges.append(math.nan)
    assert len(modules.invariants.not_finite("/t", LaserScan._type, scan)) == 1


def test_joint_limits(modules):
    limits = modules.invariants.JointLimits({"a": (-1.0, 1.0)}, slack=0.1)
    assert limits.check(["a", "free"], [1.05, 99.0]) == []
    assert "a is at 1.2" in limits.check(["a"], [1.2])[0]
    assert limits.check(["a"], [math.nan])


def test_stamps_go_forward_but_after_an_announced_reset(modules):
    stamps = modules.invariants.Stamps()
    assert [stamps.check("/t", stamp) for stamp in (1.0, 1.0, 2.0)] == [[], [], []]
    assert "from 2.000 s back to 1.500 s" in stamps.check("/t", 1.5)[0]
    stamps.announce_reset()
    assert stamps.check("/t", 1.6) == []  # published before it
    assert stamps.check("/t", 0.0) == []
    assert stamps.check("/t", -1.0)
    stamps.announce_reset()
    stamps.settle()
    assert stamps.check("/t", -2.0)


def test_joints_stay_while_armed(modules):
    still = modules.invariants.Still(0.001)
    assert still.check(["a"], [5.0]) == []
    still.arm({"a": 1.0})
    assert still.check(["a", "b"], [1.0009, 7.0]) == []
    assert "a moved by 0.00200 rad" in still.check(["a"], [1.002])[0]
    assert still.farthest == pytest.approx(0.002)
    assert still.check(["a"], [math.nan])
    still.disarm()
    assert still.check(["a"], [9.0]) == []


def test_growth_is_told_by_what_grew(modules):
    usage = modules.invariants.Usage
    allowed = usage(2, 2, 100)
    assert modules.invariants.grown("/n", usage(5, 5, 500), usage(7, 7, 600), allowed) == []
    found = modules.invariants.grown("/n", usage(5, 5, 500), usage(8, 8, 601), allowed)
    assert [text.split()[1] for text in found] == ["threads", "descriptors", "memory"]


def test_patience_counts_work_first(modules):
    patience = modules.invariants.Patience(cpu_s=10.0, wall_s=100.0)
    assert patience.check("/s", 9.0, 99.0) == []
    assert "10 s of its node's CPU time" in patience.check("/s", 11.0, 12.0)[0]
    assert "in which its node used 0.1 s of CPU time" in patience.check("/s", 0.1, 101.0)[0]


def test_emergency_stop(modules):
    stop = modules.invariants.EmergencyStop(ticks=10, rest_ticks=100, rest_speed=0.01)
    assert stop.check(9, False, [2.0]) == []
    assert "is not stopped" in stop.check(10, False, [2.0])[0]
    assert stop.check(99, True, [2.0]) == []
    assert "moves at 2.0000 rad/s" in stop.check(100, True, [0.0, -2.0])[0]
    assert stop.check(100, True, [math.nan])


def test_the_journal_says_how_to_repeat_a_failure(modules, tmp_path):
    said = []
    journal = modules.journal.Journal(tmp_path, "fuzz", echo=said.append)
    value = {"text": "x" * 10**6, "data": b"\xff", "number": math.nan, "deep": {"a": [1] * 10**5}}
    journal.note(100, "/a", "boundary", value)
    journal.fail("/gazebo died", 7, 100, 50)
    assert "fuzz --seed 7 --first 100 --messages 50" in said[0]
    result = journal.finish(seed=7, simulated_s=3600.0)
    line, = (tmp_path / "sent.jsonl").read_text().splitlines()
    assert len(line) < 2000 and json.loads(line)[:3] == [100, "/a", "boundary"]
    assert json.loads((tmp_path / "result.json").read_text())["failures"][0]["seed"] == 7
    assert "1: one in 1 messages, one in 1.00 simulated hours" in modules.journal.report(result)


def test_a_run_without_failures_says_so(modules, tmp_path):
    result = modules.journal.Journal(tmp_path, "fuzz", echo=print).finish(seed=7)
    assert "failures: none in 0 messages" in modules.journal.report(result)
