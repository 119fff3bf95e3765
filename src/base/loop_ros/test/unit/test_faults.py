# SPDX-License-Identifier: BSD-3-Clause
"""Errors that the loop survives: counted by place, logged at a limited rate."""
import sys
from types import SimpleNamespace

import pytest

from lab_testing.waiting import wait_until
from loop_ros.faults import LINE_PERIOD_S, Faults, described
from loop_ros.log import LONGEST_LINE, LoopLog


class Clock:
    now = 0.0

    def __call__(self):
        return self.now


@pytest.fixture
def scene():
    lines, clock = [], Clock()
    return SimpleNamespace(lines=lines, clock=clock, faults=Faults(SimpleNamespace(error=lines.append), clock))


def test_each_place_is_told_once_in_a_while_and_counted_always(scene):
    for _ in range(50):
        scene.faults.note("/a", ValueError("wrong"), "the message is dropped")
    scene.faults.note("/b", KeyError("x"))
    assert scene.lines == ["/a: ValueError: wrong; the message is dropped", "/b: KeyError: 'x'; it is left out"]
    scene.clock.now = LINE_PERIOD_S
    scene.faults.note("/a", ValueError("wrong again"), "the message is dropped")
    assert scene.lines[2:] == ["/a: ValueError: wrong again; the message is dropped (51 times by now)"]
    assert (scene.faults.places["/a"].count, scene.faults.places["/b"].count) == (51, 1)


def test_a_guarded_call_returns_what_it_does_or_none(scene):
    assert scene.faults.guarded("sum", lambda a, b: a + b, 2, 3) == 5
    assert scene.faults.guarded("exit", lambda: sys.exit(1)) is None
    with pytest.raises(KeyboardInterrupt):
        scene.faults.guarded("Ctrl-C", lambda: (_ for _ in ()).throw(KeyboardInterrupt))
    assert list(scene.faults.places) == ["exit"]


def test_an_error_is_one_short_line_that_says_where():
    def fail():
        raise ValueError("many\nlines " * 10000)

    with pytest.raises(ValueError) as caught:
        fail()
    text = described(caught.value)
    assert text.startswith("ValueError: many lines many") and "test_faults.py:" in text
    assert len(text) < 400 and "\n" not in text


def test_places_do_not_grow_for_ever(scene):
    for number in range(10000):
        scene.faults.note("/topic%d" % number, ValueError())
    assert len(scene.faults.places) < 1000 and "/topic9999" in scene.faults.places


def test_a_log_line_is_cut_and_can_be_written(scene):
    got = []

    def write(text):
        text.encode("utf-8")
        got.append(text)
        if text == "broken pipe":
            raise OSError("the terminal is gone")

    log = LoopLog({"error": write})
    for text in ("x" * 10**6, "half a pair: \ud800", "broken pipe", "on"):
        log.error(text)
    wait_until(lambda: got and got[-1] == "on", "the last line")
    assert len(got[0]) < LONGEST_LINE + 50 and got[1] == "half a pair: ?"
    log.close()
