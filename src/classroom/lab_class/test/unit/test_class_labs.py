# SPDX-License-Identifier: BSD-3-Clause
"""States of labs, and what comes next; time is a number."""
import pytest

from lab_class.front_door import kind_of
from lab_class.labs import MAX_FAILURES, START_LIMIT_S, Action, ClassError, ClassLabState, Kind, Labs, Role, may

IDLE_S = 900.0


@pytest.fixture
def labs():
    made = Labs(["anna", "ben", "cleo"], at_once=1, idle_s=IDLE_S)
    for lab in made:
        made.start(lab.name, 0.0)
    return made


def run(labs, name, now=0.0):
    while labs[name].state is not ClassLabState.RUNNING:
        (_, started), = labs.due(now)
        labs.answered(started, now)
        labs[started].visited = True
        labs.has_settled(started, now)


def test_labs_start_one_after_the_other(labs):
    assert labs.due(0.0) == [(Action.START, "anna")]
    assert labs.due(1.0) == []
    labs.answered("anna", 5.0)
    # Its simulator still loads the robot.
    assert labs.due(5.0) == []
    labs.has_settled("anna", 9.0)
    assert labs.due(9.0) == [(Action.START, "ben")]


def settled(labs, name="anna"):
    labs.due(0.0)
    labs.answered(name, 1.0)
    return labs.has_settled(name, 2.0)


def test_a_lab_waits_for_its_first_client_paused(labs):
    assert settled(labs) == [(Action.PAUSE, "anna")]
    assert labs.request("anna", 3.0) == [(Action.WAKE, "anna")]
    # One that goes on does not start a second time.
    assert not labs["anna"].is_starting
    assert labs.has_settled("anna", 4.0) == []
    assert labs["anna"].state is ClassLabState.RUNNING


@pytest.mark.parametrize("visit", [
    lambda labs: labs.request("anna", 0.5), lambda labs: labs.serving("anna", Kind.ANSWER, 1, 0.5),
    lambda labs: labs.serving("anna", Kind.PAGE, 1, 0.5)])
def test_a_lab_with_a_client_is_not_paused_when_it_has_started(labs, visit):
    labs.due(0.0)
    visit(labs)
    assert settled(labs) == []
    assert labs["anna"].state is ClassLabState.RUNNING


def test_a_lab_that_starts_again_waits_for_its_client_again(labs):
    labs.request("anna", 0.0)
    settled(labs)
    labs.stop("anna", 3.0)
    labs.start("anna", 4.0)
    labs.due(4.0)
    labs.stop("ben", 4.0)
    labs.due(4.0)
    assert settled(labs) == [(Action.PAUSE, "anna")]


@pytest.mark.parametrize("idle_s, keep_running", [(None, False), (IDLE_S, True)])
def test_labs_run_from_their_start_where_that_is_wanted(idle_s, keep_running):
    labs = Labs(["anna"], 1, idle_s, keep_running)
    labs.start("anna", 0.0)
    assert settled(labs) == []
    assert labs["anna"].state is ClassLabState.RUNNING


def test_a_lab_that_is_paused_while_it_starts_makes_room_for_the_next(labs):
    labs.due(0.0)
    labs.answered("anna", 1.0)
    labs.pause("anna", 1.5)
    assert labs.due(2.0) == [(Action.START, "ben")]
    labs.request("anna", 3.0)
    assert not labs["anna"].is_starting


def test_a_lab_with_a_client_that_waits_starts_first(labs):
    labs.request("cleo", 0.0)
    assert labs.place_in_line("ben") == 2
    assert labs.due(0.0) == [(Action.START, "cleo")]


def test_an_unused_lab_is_paused_and_woken_by_a_request(labs):
    run(labs, "anna")
    labs.request("anna", 10.0)
    assert (Action.PAUSE, "anna") not in labs.due(10.0 + IDLE_S)
    assert (Action.PAUSE, "anna") in labs.due(11.0 + IDLE_S)
    assert labs.request("anna", 5000.0) == [(Action.WAKE, "anna")]
    assert labs["anna"].state is ClassLabState.RUNNING
    assert (Action.PAUSE, "anna") not in labs.due(5001.0)


def test_a_lab_is_not_paused_while_it_answers(labs):
    run(labs, "anna")
    labs.serving("anna", Kind.ANSWER, 1, 0.0)
    assert (Action.PAUSE, "anna") not in labs.due(9000.0)
    labs.serving("anna", Kind.ANSWER, -1, 9000.0)
    assert (Action.PAUSE, "anna") in labs.due(9001.0 + IDLE_S)


def test_no_lab_is_paused_without_a_limit():
    labs = Labs(["anna"], 1, None)
    labs.start("anna", 0.0)
    run(labs, "anna")
    assert labs.due(1e9) == []


def test_a_lab_that_ends_starts_again_at_the_next_request_three_times_at_most(labs):
    for failures in range(1, MAX_FAILURES + 1):
        run(labs, "anna")
        assert labs.ended("anna", "roslaunch has ended", 1.0) == [(Action.END, "anna")]
        assert (labs["anna"].state, labs["anna"].failures) == (ClassLabState.FAILED, failures)
        labs.request("anna", 1.0)
    assert labs["anna"].state is ClassLabState.FAILED
    labs.start("anna", 2.0)
    assert (labs["anna"].state, labs["anna"].failures) == (ClassLabState.WAITING, 0)


def test_a_lab_that_has_run_for_long_may_fail_again(labs):
    for now in (100.0, 300.0, 500.0, 700.0):
        run(labs, "anna", now)
        labs.ended("anna", "x", now + 100.0)
        labs.request("anna", now + 100.0)
        assert labs["anna"].state is ClassLabState.WAITING


def test_a_lab_that_does_not_answer_fails_and_the_next_one_starts(labs):
    labs.due(0.0)
    assert labs.due(START_LIMIT_S + 1.0) == [(Action.END, "anna"), (Action.START, "ben")]
    assert "180 s" in labs["anna"].reason


def test_a_lab_over_its_limits_waits_for_the_instructor(labs):
    run(labs, "anna")
    assert labs.exceeded("anna", "it used 3 GB", 1.0) == [(Action.KILL, "anna")]
    labs.request("anna", 2.0)
    assert (labs["anna"].state, labs["anna"].reason) == (ClassLabState.FAILED, "it used 3 GB")


def test_a_stopped_lab_stays_stopped_and_its_end_is_no_failure(labs):
    run(labs, "anna")
    assert labs.stop("anna", 1.0) == [(Action.END, "anna")]
    assert labs.ended("anna", "x", 1.1) == []
    labs.request("anna", 2.0)
    assert labs["anna"].state is ClassLabState.STOPPED
    assert labs.stop("anna", 3.0) == []


def test_what_cannot_be_done_is_said(labs):
    with pytest.raises(ClassError, match="ben is waiting; only a running lab"):
        labs.pause("ben", 0.0)
    with pytest.raises(ClassError, match="there is no lab dora; there are: anna, ben, cleo"):
        labs.stop("dora", 0.0)


def test_who_may_do_what():
    assert [may(role, "watch") for role in (Role.STUDENT, Role.VIEWER, None)] == [True, True, False]
    assert [may(role, "use") for role in (Role.STUDENT, Role.VIEWER)] == [True, False]
    assert [role for role in Role if may(role, "change")] == [Role.INSTRUCTOR]


def test_a_page_counts_once_with_all_of_its_connections():
    kinds = [kind_of(is_upgrade, uri) for is_upgrade, uri in (
        (True, "/lab?token=x"), (True, "/rosbridge"), (True, "/notebook/api/kernels/1/channels"), (False, "/lab"))]
    assert kinds == [Kind.PAGE, Kind.SOCKET, Kind.SOCKET, Kind.ANSWER]
    labs = Labs(["anna"], 1, None)
    for kind in kinds:
        labs.serving("anna", kind, 1, 0.0)
    lab = labs["anna"]
    assert (lab.pages, lab.sockets, lab.busy) == (1, 3, 1)


SHORT = "this machine has only 0.3 GB of memory free"


def test_where_memory_is_short_labs_wait_and_say_so(labs):
    # One lab may always start.
    assert labs.due(0.0, SHORT) == [(Action.START, "anna")]
    labs.due(1.0, SHORT)
    assert labs["ben"].reason == "", "the first one is starting"
    labs.answered("anna", 2.0)
    labs["anna"].visited = True
    labs.has_settled("anna", 3.0)
    assert labs.due(4.0, SHORT) == [] and labs["ben"].reason == SHORT and labs["ben"].state is ClassLabState.WAITING
    assert labs.due(5.0) == [(Action.START, "ben")] and labs["ben"].reason == labs["cleo"].reason == ""


def test_where_memory_is_short_an_unvisited_lab_gives_way_to_a_visitor(labs):
    for name, now in (("anna", 0.0), ("ben", 10.0)):
        assert labs.due(now) == [(Action.START, name)]
        labs.answered(name, now)
        assert labs.has_settled(name, now + 1.0) == [(Action.PAUSE, name)]
    assert labs.due(20.0, SHORT) == []
    labs.request("cleo", 21.0)
    assert labs.due(22.0, SHORT) == [(Action.END, "ben")] and labs["ben"].state is ClassLabState.WAITING
    # Its memory is free a while later.
    assert labs.due(23.0, SHORT) == []
    assert labs.due(24.0) == [(Action.START, "cleo")]


def test_where_memory_is_short_no_visited_lab_gives_way(labs):
    run(labs, "anna")
    labs.pause("anna", 1.0)
    labs.request("ben", 2.0)
    assert labs.due(3.0, SHORT) == [] and labs["anna"].state is ClassLabState.PAUSED
