# SPDX-License-Identifier: BSD-3-Clause
"""When a run is over: by simulated time, by the program's processor time, by what it did; never by wall time."""
import threading
import time
from types import SimpleNamespace

import pytest

from lab_testing.waiting import wait_until
from rf_checks import observing
from rf_checks.observing import Observer
from rf_checks.tasks import ProgramCall


def student(**fields):
    usual = {"exit_code": None, "excess": lambda: "", "output": ""}
    return SimpleNamespace(**{**usual, **fields})


def record(k, q=0.0, commands=0, rested=True, helpers_s=0.0):
    return {"t": round(100.0 + 0.01 * k, 4), "q": [q], "counts": {"left": commands * k, "right": 0}, "rested": rested,
            "helpers_s": 7.0 + helpers_s * k}


@pytest.fixture
def observe():
    """Feed an Observer from a thread, as a lab does; returns it when it has ended, with the number of its records."""
    observers = []

    def run(the_student, make_record=record, cpu_s=lambda k: 0.0, limit_s=2.0, is_satisfied=lambda output: False,
            is_meddled=lambda: False):
        observer = Observer(ProgramCall((), {}, limit_s, None), the_student, is_satisfied, is_meddled)
        observers.append(observer)
        threading.Thread(target=lambda: [observer.on_record(make_record(k), cpu_s(k)) for k in range(3000)],
                         daemon=True).start()
        wait_until(lambda: observer.wait(0.05), "the end of the run")
        return observer

    yield run
    for observer in observers:
        observer.release()


def test_a_program_that_does_not_end_has_simulated_time(observe):
    observer = observe(student())
    assert observer.ended == "sim time"
    assert len(observer.records) == 201


def test_the_wall_has_no_say(observe, monkeypatch):
    days = iter(range(10**6))
    monkeypatch.setattr(time, "monotonic", lambda: 86400.0 * next(days))
    monkeypatch.setattr(time, "time", time.monotonic)
    observer = Observer(ProgramCall((), {}, 2.0, None), student(), lambda output: False, lambda: False)
    for k in range(200):
        observer.on_record(record(k), 0.01 * k)
    assert observer.ended == ""


def test_the_world_stands_still_from_the_end_of_a_run_on():
    observer = Observer(ProgramCall((), {}, 2.0, None), student(), lambda output: False, lambda: False)
    held = []
    observer._released = SimpleNamespace(wait=lambda: held.append(len(observer.records)))
    for k in range(203):
        observer.on_record(record(k), 0.0)
    # Each record from then on is held.
    assert held == [201, 201, 201]


@pytest.mark.parametrize(("fields", "words", "ended"), [
    ({"excess": lambda: "output"}, {}, "output"),
    ({"excess": lambda: "processes"}, {}, "processes"),
    ({"excess": lambda: "threads"}, {}, "threads"),
    ({"excess": lambda: "sockets"}, {}, "sockets"),
    ({"excess": lambda: "memory"}, {}, "memory"),
    ({}, {"make_record": lambda k: record(k, helpers_s=0.4)}, "requests"),
    ({}, {"make_record": lambda k: record(k, helpers_s=0.04)}, "sim time"),
    ({}, {"is_meddled": lambda: True}, "meddled"),
    ({"output": "yes"}, {"is_satisfied": lambda output: output == "yes"}, "satisfied"),
    ({}, {"make_record": lambda k: record(k, commands=11)}, "flood"),
    ({}, {"make_record": lambda k: record(k, rested=False), "cpu_s": lambda k: 0.06 * k}, "busy"),
])
def test_what_ends_a_run(observe, fields, words, ended):
    assert observe(student(**fields), **words).ended == ended


def test_a_program_that_computes_and_rests_is_not_ended_for_it(observe):
    # More than BUSY_S of processor time, and at rest every second record.
    observer = observe(student(), make_record=lambda k: record(k, rested=k % 2 == 0), cpu_s=lambda k: 0.1 * k)
    assert 0.1 * len(observer.records) > 2 * observing.BUSY_S
    assert observer.ended == "sim time"


@pytest.mark.parametrize(("moves_until", "expected"), [(0, 31), (50, 80), (1000, 150)])
def test_after_a_programs_end_the_arms_come_to_rest(observe, moves_until, expected):
    observer = observe(student(exit_code=0), make_record=lambda k: record(k, q=0.01 * min(k, moves_until)))
    assert observer.ended == "exited"
    assert observer.records[0]["exited"] == 100.0
    assert len(observer.records) == pytest.approx(expected, abs=2)


def test_an_end_from_outside_is_not_lost_on_a_record_that_comes_at_the_same_time():
    inside, go_on = threading.Event(), threading.Event()

    def look(output):
        inside.set()
        go_on.wait(60.0)
        return False

    observer = Observer(ProgramCall((), {}, 2.0, None), student(), look, lambda: False)
    records = threading.Thread(target=observer.on_record, args=(record(0), 0.0))
    records.start()
    inside.wait(60.0)
    end = threading.Thread(target=observer.end, args=("output",))
    end.start()
    end.join(0.2)  # as far as it gets
    go_on.set()
    end.join()
    observer.release()
    records.join()
    assert observer.ended == "output"
