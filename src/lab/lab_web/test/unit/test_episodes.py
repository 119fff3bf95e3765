# SPDX-License-Identifier: BSD-3-Clause
"""Episodes of pages without a browser: what they may ask for, and a recorder that ends in any way."""
import sys
from types import SimpleNamespace

import pytest

from demonstrations.editing import Listed
from demonstrations.frames import ACTION, Schema, numbers
from demonstrations.writing import SetWriter
from lab_testing.waiting import wait_until
from lab_web.episodes import Episodes, Process, command
from lab_web.lab import RobotError
from lab_web.task_queue import TaskQueue
from loop_ros.faults import Faults

START = {"do": "start", "task": "Pick up the block."}


@pytest.fixture
def made(tmp_path):
    """Episodes with a recorder of the test's own."""
    made = SimpleNamespace(started=[], marks=[], states=[], told=[])
    faults = Faults(SimpleNamespace(error=pytest.fail))
    made.tasks = TaskQueue(lambda client, code, text: made.told.append(text), faults)

    def start(task, camera, said, ended):
        made.started.append((task, camera))
        made.said, made.ended = said, ended
        return SimpleNamespace(end=ended, join=lambda: None)

    made.episodes = Episodes(tmp_path / "set", start, made.marks.append, made.tasks, made.states.append)
    return made


def write(folder, count=2):
    with SetWriter(folder, Schema(10, {ACTION: numbers([("a", "")])}, about={"task": "on the robot"})) as writer:
        for number in range(count):
            writer.frame({ACTION: [float(number)]})
            writer.keep("Task.", True)


def delete(made, number):
    made.episodes.ask(1, {"do": "delete", "number": number, "version": made.episodes._version})
    made.tasks.run(lambda: True)


def test_a_second_click_deletes_no_other_episode(made):
    """The numbers behind a deleted episode move up: a click of another page, or the second of two, was read before."""
    write(made.episodes.folder, 4)
    made.episodes._look()
    version = made.episodes._version
    for _ in range(2):
        made.episodes.ask(1, {"do": "delete", "number": 1, "version": version})
    made.tasks.run(lambda: True)
    assert len(made.states[-1]["episodes"]) == 3 and "nothing was deleted" in made.told[0]


def test_a_recording_begins_is_marked_and_ends(made):
    made.episodes.ask(1, {**START, "camera": "head"})
    assert made.started == [("Pick up the block.", "head")] and made.states[-1]["running"]
    with pytest.raises(RobotError, match="the recorder starts"):  # a mark now would be lost
        made.episodes.ask(1, {"do": "failure"})
    made.said("recording into set, which has 0 episodes")
    assert made.states[-1]["recording"] and not made.states[-1]["bad"]
    made.episodes.ask(1, {"do": "failure"})
    write(made.episodes.folder)
    made.said("episode 1 is kept")
    state = made.states[-1]
    assert made.marks == ["failure"] and state["said"] == "episode 1 is kept" and len(state["episodes"]) == 2
    made.episodes.ask(1, {"do": "stop"})
    assert not made.states[-1]["running"] and not made.states[-1]["bad"]
    delete(made, 0)
    assert len(made.states[-1]["episodes"]) == 1 and made.states[-1]["version"] > state["version"]


def test_what_goes_wrong_is_marked_as_such(made):
    made.episodes.ask(1, START)
    made.said("recording into set, which has 0 episodes")
    made.said("an episode of 5 frames is dropped: no news of head for 0.5 s; the next one begins")
    assert made.states[-1]["bad"] and made.states[-1]["recording"]
    made.said("episode 0 is kept as a success: 7 frames; the next one begins")
    assert not made.states[-1]["bad"]
    made.ended()  # by itself
    assert made.states[-1]["bad"] and not made.states[-1]["running"] and not made.states[-1]["recording"]


def test_the_first_episode_decides_on_the_camera(made, monkeypatch):
    write(made.episodes.folder)
    monkeypatch.setattr("lab_web.episodes.editing.listed", lambda folder: (
        [Listed(0, 4, True)], ("observation.images.left_hand",), 10))
    delete(made, 7)  # it looks again
    made.episodes.ask(1, {**START, "camera": "head"})
    assert made.started == [("Pick up the block.", "left_hand")]


@pytest.mark.parametrize(("asked", "why"), [
    ({"do": "start", "task": " "}, "few words"), ({"do": "start", "task": 5}, "few words"),
    ({"do": "start", "task": "a\nb"}, "few words"), ({**START, "camera": "rear"}, "no camera 'rear'"),
    ({"do": "success"}, "nothing is recorded"), ({"do": "delete", "number": "0", "version": 0}, "by its number"),
    ({"do": "delete", "number": 0}, "its list's version"),
    ({"do": "dance"}, "'dance'"), ({}, "None"), ({"do": []}, r"\[\]")])
def test_what_makes_no_sense_is_refused(made, asked, why):
    with pytest.raises(RobotError, match=why):
        made.episodes.ask(1, asked)
    assert not made.started and not made.marks


def test_nothing_is_deleted_or_begun_twice_while_something_is_recorded(made):
    write(made.episodes.folder)
    made.episodes.ask(1, START)
    for asked in (START, {"do": "delete", "number": 0, "version": 1}):
        with pytest.raises(RobotError, match="recorded"):
            made.episodes.ask(1, asked)


def test_an_episode_that_is_not_there_is_told_and_so_is_a_broken_set(made):
    write(made.episodes.folder)
    made.episodes._look()
    delete(made, 7)
    assert "episodes 0 to 1, not 7" in made.told[0] and len(made.states[-1]["episodes"]) == 2
    (made.episodes.folder / "meta" / "info.json").write_text("{")
    made.episodes.ask(1, START)
    made.said("x")
    assert "info.json" in made.states[-1]["said"] and made.states[-1]["episodes"] == []


def test_a_task_is_no_option():
    assert "--task=--help" in command("f", "--help", "")


def run(program):
    lines, ended = [], []
    return Process([sys.executable, "-u", "-c", program], lines.append, lambda: ended.append(True)), lines, ended


def test_a_process_says_its_lines_and_ends_when_it_is_asked_or_by_itself():
    process, lines, ended = run("import time; print('here'); time.sleep(1000)")
    wait_until(lambda: lines == ["here"], "its line")
    process.end()
    process.end()
    process.join()
    assert ended
    process, lines, ended = run("import sys; print('a'); sys.exit('no camera')")
    process.join()
    assert lines == ["a", "no camera"] and ended
