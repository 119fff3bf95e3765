# SPDX-License-Identifier: BSD-3-Clause
"""Buttons that pages hold: in order, each refusal to its page, nothing stays pressed behind a page that is lost."""
import threading
from types import SimpleNamespace

import pytest

from lab_testing.waiting import wait_until
from lab_web.buttons import Buttons
from lab_web.lab import RobotError
from lab_web.task_queue import TaskQueue
from loop_ros.faults import Faults


class Robot:
    def __init__(self):
        self.done = []

    def switch(self, action, name, steps):
        self.done.append((action, name, steps))
        if name == "ghost":
            raise RobotError("there is no ghost")
        if name == "broken":
            raise ZeroDivisionError("of its own")


class Served:
    """Buttons whose thread runs."""

    def __init__(self):
        self.robot, self.told, self._ended = Robot(), [], threading.Event()
        self.log = []
        tasks = TaskQueue(lambda *told: self.told.append(told), Faults(SimpleNamespace(error=self.log.append)))
        self.pressed = []
        self.buttons = Buttons(self.robot.switch, tasks, lambda names: self.pressed.append(sorted(names)))
        self._thread = threading.Thread(target=tasks.run, args=(self._ended.is_set, self.buttons.release_all))
        self._thread.start()

    def end(self):
        self._ended.set()
        self._thread.join()


@pytest.fixture
def served():
    made = Served()
    yield made
    made.end()


def press(served, name, pressed=True):
    served.buttons.press(1, {"op": "press", "name": name, "pressed": pressed})


def test_presses_and_turns_come_in_order(served):
    press(served, "cuff")
    served.buttons.turn(1, {"name": "wheel", "steps": -2})
    press(served, "cuff", False)
    wait_until(lambda: len(served.robot.done) == 3, "three switches")
    assert served.robot.done == [("press", "cuff", 0), ("turn", "wheel", -2), ("release", "cuff", 0)]
    served.buttons.release_all()
    served.end()
    assert len(served.robot.done) == 3


def test_what_the_robot_has_pressed_is_told_before_a_press_and_after_a_release(served):
    press(served, "cuff")
    press(served, "ghost")
    press(served, "ok")
    press(served, "cuff", False)
    wait_until(lambda: served.robot.done[-1:] == [("release", "cuff", 0)], "the last switch")
    served.end()
    assert served.pressed[:5] == [["cuff"], ["cuff", "ghost"], ["cuff"], ["cuff", "ok"], ["ok"]]
    assert served.pressed[-1] == []


def test_what_is_held_is_released_once_where_its_page_is_lost(served):
    press(served, "cuff")
    press(served, "ok")
    press(served, "ok", False)
    served.buttons.release_all()
    served.buttons.release_all()
    press(served, "last")
    wait_until(lambda: served.robot.done[-1:] == [("press", "last", 0)], "the last switch")
    assert served.robot.done.count(("release", "cuff", 0)) == 1 and served.robot.done.count(("release", "ok", 0)) == 1


def test_the_end_of_the_server_releases_what_is_held(served):
    press(served, "cuff")
    served.end()
    assert served.robot.done == [("press", "cuff", 0), ("release", "cuff", 0)]


def test_a_refusal_of_the_robot_goes_to_the_page_and_the_next_press_works(served):
    press(served, "ghost")
    press(served, "cuff")
    wait_until(lambda: len(served.robot.done) == 2, "two switches")
    assert served.told == [(1, "refused", "there is no ghost")]


def test_an_error_that_nobody_foresaw_is_told_and_logged_and_the_next_press_works(served):
    press(served, "broken")
    press(served, "cuff")
    wait_until(lambda: len(served.robot.done) == 2, "two switches")
    ((client, code, text),) = served.told
    assert (client, code) == (1, "refused") and "ZeroDivisionError: of its own" in text
    assert len(served.log) == 1 and "of its own" in served.log[0]
    # Also those at the end.
    press(served, "broken")
    served.end()
    assert served.robot.done[-2:] in ([("release", "broken", 0), ("release", "cuff", 0)],
                                      [("release", "cuff", 0), ("release", "broken", 0)])


@pytest.mark.parametrize(("method", "operation"), [
    ("press", {"pressed": True}), ("press", {"name": 3, "pressed": True}), ("press", {"name": "cuff"}),
    ("press", {"name": "cuff", "pressed": 1}), ("turn", {"name": "wheel"}), ("turn", {"name": "wheel", "steps": True}),
    ("turn", {"name": "wheel", "steps": 1000}), ("turn", {"name": "", "steps": 1})])
def test_malformed_operations_are_refused(served, method, operation):
    with pytest.raises(RobotError):
        getattr(served.buttons, method)(1, operation)
    assert served.robot.done == []
