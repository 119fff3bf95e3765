# SPDX-License-Identifier: BSD-3-Clause
"""The first plan of a robot waits for its spheres, which are made once, and can be stopped meanwhile."""
import threading
import time

import pytest

from motion_planning.exact import ExactChecker
from motion_planning.planners import NoPath, SearchOptions, plan_path, planning
from motion_planning.scene import Scene

PATIENCE_S = 60.0


@pytest.fixture
def slow(monkeypatch):
    """(list of the groups that are being made, Event that the first is, Event that lets them be ready)"""
    making, begun, ready = [], threading.Event(), threading.Event()

    def make(spheres, group, allowed):
        making.append(group.name)
        begun.set()
        ready.wait(PATIENCE_S)

    monkeypatch.setattr(planning, "make_links", make)
    yield making, begun, ready
    ready.set()


def plan(mix, exact, answers, stop=lambda: False):
    def run():
        group = mix.groups["arm"]
        q = Scene(mix).state.q[group.indices]
        try:
            answers.append(plan_path(Scene(mix), "arm", q, q[None],
                                     SearchOptions(exact, 1, PATIENCE_S, time.monotonic, stop)))
        except NoPath as error:
            answers.append(error)

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    return thread


def test_two_plans_make_the_spheres_once_and_both_get_their_paths(mix, slow):
    making, begun, ready = slow
    exact, answers = ExactChecker(mix, None), []
    threads = [plan(mix, exact, answers) for _ in range(2)]
    assert begun.wait(PATIENCE_S)
    ready.set()
    for thread in threads:
        thread.join(PATIENCE_S)
    assert making == ["arm"] and [type(answer).__name__ for answer in answers] == ["Path", "Path"]


def test_a_plan_that_waits_for_spheres_can_be_stopped(mix, slow):
    making, begun, _ = slow
    exact, answers, stopped = ExactChecker(mix, None), [], threading.Event()
    plan(mix, exact, answers)
    assert begun.wait(PATIENCE_S)
    waits = plan(mix, exact, answers, stopped.is_set)
    stopped.set()
    waits.join(PATIENCE_S)
    assert answers[0].stopped and making == ["arm"]
