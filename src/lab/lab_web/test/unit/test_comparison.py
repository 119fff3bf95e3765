# SPDX-License-Identifier: BSD-3-Clause
"""Pages ask how much of a physical robot's interface is here."""
import pytest

from baxter_conformance.comparison import ConformanceFinding, SeenInterface, Verdict, compare, scores, totals
from baxter_model.interface import physical_robot
from lab_web.comparison import Comparison, findings_of, shown_of
from lab_web.lab import RobotError

FINDINGS = [ConformanceFinding("/robot", "/robot/state", Verdict.MET, True),
            ConformanceFinding("/robot", "/robot/x", Verdict.MISSING, True, "nobody"),
            ConformanceFinding("services", "/s", Verdict.OTHER, True, "type a"),
            ConformanceFinding("services", "/own", Verdict.MISSING, False, "n")]


class TaskQueue:
    """Work that waits until the test does it."""

    def __init__(self):
        self.waiting = []

    def add(self, client, work):
        self.waiting.append((client, work))


@pytest.fixture
def tasks():
    return TaskQueue()


def test_what_is_missing_and_what_is_different_is_shown_but_for_what_nobody_can_use():
    assert shown_of(FINDINGS) == {
        "met": 1, "of": 3, "groups": [{"name": "/robot", "met": 1, "of": 2}, {"name": "services", "met": 0, "of": 1}],
        "others": [{"name": "/robot/x", "verdict": "missing", "reason": "nobody"},
                   {"name": "/s", "verdict": "other", "reason": "type a"}]}


def test_a_comparison_under_way_is_not_begun_again_and_its_result_stays(tasks):
    told = []
    comparison = Comparison(lambda: FINDINGS, tasks, told.append, lambda: 12.5)
    for client in (7, 8):
        comparison.ask(client, {})
    assert told == [{"is_running": True}] and [client for client, _ in tasks.waiting] == [7]
    tasks.waiting.pop()[1]()
    assert told[-1] == {"is_running": False, **shown_of(FINDINGS), "when_s": 12.5}
    comparison.ask(8, {})
    assert told[-1] == {"is_running": True, **shown_of(FINDINGS), "when_s": 12.5}


def test_a_comparison_that_failed_can_be_tried_again(tasks):
    def findings():
        raise RobotError("gone")
    told = []
    comparison = Comparison(findings, tasks, told.append, lambda: 0.0)
    comparison.ask(7, {})
    with pytest.raises(RobotError, match="gone"):
        tasks.waiting.pop()[1]()
    assert told[-1] == {"is_running": False}
    comparison.ask(7, {})
    assert len(tasks.waiting) == 1


def test_findings_are_those_of_the_command():
    robot = physical_robot()
    found = findings_of(robot, lambda _: SeenInterface(), lambda: True, OSError)
    assert found == compare(robot, SeenInterface()) and totals(found, True)[0] == 0 and len(scores(found)) > 5


def test_a_master_that_ends_is_no_finding():
    def refused(_robot):
        raise ConnectionRefusedError("refused")
    for read, is_there, why in ((refused, True, "refused"), (lambda _: SeenInterface(), False, "not reachable")):
        with pytest.raises(RobotError, match="nothing was compared.*" + why):
            findings_of(physical_robot(), read, lambda there=is_there: there, OSError)
