# SPDX-License-Identifier: BSD-3-Clause
"""The dialogue with a procedure on the robot: requests, ends, and each way to fail."""
import errno

import pytest

from baxter_interface.robust_dialogue import ANSWER_TIMEOUT_S, Completion, Dialogue, DialogueState, ProcedureReport

RUNS, RESTS = ProcedureReport(True), ProcedureReport(False)


def play(dialogue, *steps):
    """Step through (time [s], report); return the requests."""
    return [dialogue.step(time_s, report) for time_s, report in steps]


def test_success_is_run_stop_and_rest():
    dialogue = Dialogue(60.0)
    assert play(dialogue, (0.0, None), (0.1, None), (0.5, RUNS)) == [True, None, True]
    assert dialogue.state is DialogueState.RUNNING
    done = ProcedureReport(True, Completion.SUCCESS)
    assert play(dialogue, (0.6, done), (0.7, done), (1.1, done), (1.2, RESTS)) == [False, None, False, None]
    assert dialogue.state is DialogueState.IDLE
    assert dialogue.failure is None


def test_request_is_repeated_twice_a_second_while_it_runs():
    dialogue = Dialogue(60.0)
    requests = play(dialogue, *((tick / 20.0, RUNS) for tick in range(200)))
    assert requests.count(True) == 20
    assert False not in requests


@pytest.mark.parametrize(("report", "number", "text"), [
    (ProcedureReport(True, Completion.FAILURE, ("joint moved",)), errno.EIO, "reports a failure: joint moved"),
    (RESTS, errno.ENOMSG, "ended without saying how"),
])
def test_failures_of_the_procedure(report, number, text):
    dialogue = Dialogue(60.0)
    play(dialogue, (0.0, RUNS), (1.0, report), (2.0, RESTS))
    assert dialogue.state is DialogueState.IDLE
    assert dialogue.failure[0] == number
    assert text in dialogue.failure[1]


def test_procedure_that_never_begins_is_given_up_and_told_to_stop():
    dialogue = Dialogue(60.0)
    assert play(dialogue, (0.0, None), (ANSWER_TIMEOUT_S, None), (ANSWER_TIMEOUT_S + 0.1, None)) == [True, False, None]
    assert dialogue.failure == (errno.ETIMEDOUT, "it did not begin within 10 s")
    assert dialogue.state is DialogueState.IDLE


def test_procedure_that_takes_too_long_is_told_to_stop():
    dialogue = Dialogue(60.0)
    assert play(dialogue, (0.0, RUNS), (60.0, RUNS), (60.5, RESTS)) == [True, False, None]
    assert dialogue.failure[0] == errno.ETIMEDOUT


def test_procedure_that_does_not_stop_is_an_error():
    dialogue = Dialogue(60.0)
    done = ProcedureReport(True, Completion.SUCCESS)
    play(dialogue, (0.0, RUNS), (1.0, done), (1.0 + ANSWER_TIMEOUT_S, done))
    assert dialogue.state is DialogueState.IDLE
    assert "did not stop" in dialogue.failure[1]


def test_abort_tells_it_to_stop():
    dialogue = Dialogue(60.0)
    play(dialogue, (0.0, RUNS))
    dialogue.abort(1.0)
    assert play(dialogue, (1.0, RUNS)) == [False]
    assert dialogue.failure[0] == errno.ECONNABORTED
