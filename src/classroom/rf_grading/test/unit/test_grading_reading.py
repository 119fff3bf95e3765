# SPDX-License-Identifier: BSD-3-Clause
"""Texts that Python's parser cannot take apart, or not in bounded time, and those that it can."""
import os
import signal

import pytest

from rf_grading import plan, programs, reading
from rf_grading.submissions import Submission

EXERCISES = programs.exercises_of("lab2", ["wave"])


def of(text):
    return {"wave.py": text.encode()}


@pytest.mark.parametrize("text", [
    "print(1)\n", "f'%s'" % ("{1}" * 100), "x = [%s]\n" % ", ".join(map(str, range(20_000))), "def f(:\n" * 10_000,
    "x = %s1" % ("-" * 100_000), "x = %s" % ("(" * 100_000), "x = 1%s" % ("()" * 50_000)])
def test_other_programs_are_read(text):
    # Too deep expressions are for the judge, which says so.
    assert reading.problem(of(text), EXERCISES) == ""


@pytest.mark.parametrize("text", ["x = f'%s'" % ("{1}" * 100_000), "import %sa" % ("a." * 400_000)])
def test_a_text_that_takes_the_parser_minutes_is_refused_in_time(text):
    one = Submission("li", "li")
    one.files = of(text)
    assert "more than 1 s of processor time" in reading.problem(one.files, EXERCISES, cpu_s=1)


def test_a_parser_that_ends_its_process_ends_no_other(monkeypatch):
    monkeypatch.setattr(programs, "assign", lambda files, exercises: signal.raise_signal(signal.SIGSYS))
    assert "nested too deeply" in reading.problem(of("#" * 100_000), EXERCISES)


def test_such_a_submission_gets_its_sentence_and_the_others_are_planned(monkeypatch, tmp_path):
    monkeypatch.setattr(reading, "problem", lambda files, _: "is not read" if b"bad" in files["wave.py"] else "")
    sent = [Submission(name, name, files=of(name)) for name in ("bad", "good")]
    _, entries, tasks = plan.make(sent, EXERCISES, "v", {}, tmp_path)
    assert [entry.problems for entry in entries] == [{"wave": "is not read"}, {}] and len(tasks) == 1


@pytest.mark.parametrize(("how", "words"), [
    (lambda: [0] * (1 << 27), "memory"), (lambda: b"x" * (1 << 33), "memory"),
    (lambda: signal.raise_signal(signal.SIGSYS), "ends the process"), (lambda: os._exit(7), "ends the process")])
def test_a_reader_has_limits(how, words):
    with pytest.raises(reading.NotRead, match=words):
        reading.limited(how, memory_bytes=200 << 20)


def test_a_reader_returns_or_raises_what_it_has_found():
    assert reading.limited(int, "17") == 17
    with pytest.raises(ValueError, match="invalid literal"):
        reading.limited(int, "x")


def test_a_reader_that_goes_on_without_the_memory_is_seen():
    def read():
        kept = []
        try:
            while True:
                kept.append(b"x" * (1 << 20))
        except MemoryError:
            return len(kept)

    with pytest.raises(reading.NotRead, match="100 MB"):
        reading.limited(read, memory_bytes=100 << 20)


def test_what_nobody_has_foreseen_costs_its_submission_alone(monkeypatch, tmp_path):
    def assign(files, exercises):
        if b"bad" in files["wave.py"]:
            raise LookupError("a new kind")
        return genuine(files, exercises)

    genuine = programs.assign
    monkeypatch.setattr(programs, "assign", assign)
    sent = [Submission(name, name, files=of(name)) for name in ("bad", "good")]
    _, entries, tasks = plan.make(sent, EXERCISES, "v", {}, tmp_path)
    assert "a new kind" in entries[0].problems["wave"] and not entries[1].problems and len(tasks) == 1
