# SPDX-License-Identifier: BSD-3-Clause
"""Responses of `./baxter.sh check` to its arguments, before any program runs."""
import ast
import os
import subprocess
import sys
from pathlib import Path

import pytest

from lab_web.exercises import shown_of
from rf_checks import command
from rf_checks.exercises import EXERCISES
from rf_checks.judge import Result, RunResult
from rf_checks.recording import Criterion, RunFault

EXERCISE_FOLDERS = Path(__file__).resolve().parents[2] / "exercises"
NAMES = [exercise.name for exercise in EXERCISES]


@pytest.fixture(autouse=True)
def somewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "my_node.py").write_text("print('hello')\n")


def test_the_list_has_every_exercise_and_how_it_is_called(capsys):
    assert command.main(["--list"]) == command.PASSED
    listing = capsys.readouterr().out
    assert all(exercise.name in listing and exercise.usage in listing for exercise in EXERCISES)
    # Its columns are straight, whatever the labs are called.
    assert len({line.index(exercise.title) for exercise in EXERCISES
                for line in listing.splitlines() if exercise.title in line}) == 1


@pytest.mark.parametrize("name", NAMES)
def test_a_skeleton_is_copied_once_and_knows_its_exercise(name, capsys):
    assert command.main(["--start", name]) == command.PASSED
    assert "./baxter.sh check" in capsys.readouterr().out
    copy = Path(name + ".py")
    assert "# exercise: %s\n" % name in copy.read_text()
    assert os.access(copy, os.X_OK)
    copy.write_text("mine")
    assert command.main(["--start", name]) == command.WRONG_WORDS
    assert copy.read_text() == "mine"


@pytest.mark.parametrize(("words", "expected"), [
    ([], "which lab and which program"), (["lab2"], "expected LAB [EXERCISE] PROGRAM"),
    (["my_node.py"], "check LAB my_node.py, where LAB is lab2 or"), (["lab2", "gone.py"], "gone.py is not there"),
    (["wave.py"], "./baxter.sh check lab2 wave.py?"), (["plan_around"], "./baxter.sh check moveit plan_around.py?"),
    (["my_node.py", "lab2"], "expected LAB [EXERCISE] PROGRAM"),
    (["lab2", "."], "is a folder"),
    (["lab2", "/dev/zero"], "/dev/zero is a device"), (["lab7", "my_node.py"], "no lab 'lab7'"),
    (["plan_around", "my_node.py"], "is an exercise of moveit"),
    (["lab2", "wav", "my_node.py"], "no exercise 'wav'"), (["lab2", "my_node.py"], "lab2 wave my_node.py"),
    (["lab2", "wave", "my_node.py", "--seed", "-1"], "--seed: expected a whole number from 0"),
    (["lab2", "wave", "my_node.py", "--serial", "-1"], "--serial: expected a whole number from 0"),
    (["lab2", "wave", "my_node.py", "--profile", "fast"], "--profile"),
    (["lab2", "wave", "my_node.py", "--json", "nowhere/x.json"], "there is no folder"),
    (["--start", "waves"], "did you mean wave?"),
    (["lob2", "gone.py"], "did you mean lab2?"), (["lab2", "wav", "gone.py"], "did you mean wave?"),
])
def test_wrong_words_are_answered_in_a_sentence(words, expected, capsys):
    try:
        status = command.main(words)
    except SystemExit as end:
        status = end.code
    assert status == command.WRONG_WORDS
    said = capsys.readouterr().err
    assert expected in said
    assert "usage:" not in said


def test_links_are_not_followed(capsys):
    Path("elsewhere").mkdir()
    Path("elsewhere/theirs.py").write_text("print('theirs')\n")
    Path("folder").symlink_to("elsewhere")
    Path("report.json").symlink_to("elsewhere/report.json")
    Path("wave.py").symlink_to("elsewhere/wave.py")
    Path("theirs.py").symlink_to("elsewhere/theirs.py")
    check = ["lab2", "wave", "my_node.py"]
    for words, link in (([*check, "--json", "report.json"], "report.json is a link, to elsewhere/report.json"),
                        ([*check, "--junit", "folder/report.xml"], "folder is a link, to elsewhere"),
                        ([*check, "--json", str(Path("folder/x.json").absolute())], "folder is a link, to elsewhere"),
                        (["lab2", "wave", "theirs.py"], "theirs.py is a link, to elsewhere/theirs.py")):
        with pytest.raises(SystemExit) as end:
            command.main(words)
        assert end.value.code == command.WRONG_WORDS
        assert link in capsys.readouterr().err
    assert command.main(["--start", "wave"]) == command.WRONG_WORDS
    assert sorted(os.listdir("elsewhere")) == ["theirs.py"]
    # One that was made while the program ran is replaced.
    command.write_report(Path("report.json"), "{}")
    assert not Path("report.json").is_symlink()
    assert sorted(os.listdir("elsewhere")) == ["theirs.py"]


@pytest.mark.parametrize("kind", ["skeletons", "solutions"])
def test_every_exercise_has_both_programs(kind):
    files = {path.stem: path.read_text(encoding="utf-8") for path in (EXERCISE_FOLDERS / kind).glob("*.py")}
    assert set(files) == set(NAMES)
    for name, text in files.items():
        ast.parse(text)
        assert ("TODO" in text) == (kind == "skeletons"), name


class CalmJudge:
    """A judge that has seen one run of half the points."""

    def __init__(self, *_):
        pass

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def check(self, exercise, program, seed):
        run = RunResult((), (Criterion("path", 0.5, 40.0, "1.5 periods"),), RunFault("short", "the sine is too short"))
        return Result(exercise, str(program), seed, (run,), "none", 3.0)


def test_the_labs_page_finds_the_result(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("ROS_HOME", str(tmp_path / "home"))
    monkeypatch.setattr(command, "Judge", CalmJudge)
    assert command.main(["lab2", "wave", "my_node.py"]) == command.NOT_PASSED
    assert "50 of 100 points" in capsys.readouterr().out
    shown = shown_of(command.page_files.result_file().read_text())
    assert (shown["exercise"], shown["passed"], shown["points"]) == ("wave", False, 50.0)
    assert shown["hint"] == "the sine is too short" and shown["runs"][0]["criteria"][0]["found"] == "1.5 periods"
    # A folder that cannot be written costs only that.
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("ROS_HOME", str(tmp_path / "file"))
    assert command.main(["lab2", "wave", "my_node.py"]) == command.NOT_PASSED


@pytest.mark.parametrize(("walled", "trusted"), [(None, False), ("1", True)])
def test_in_the_lab_of_a_class_no_second_sandbox_is_asked_for(walled, trusted, monkeypatch, tmp_path):
    asked = []

    class Asked(CalmJudge):
        def __init__(self, _wall_limit, trusted, _which):
            asked.append(trusted)

    monkeypatch.setenv("ROS_HOME", str(tmp_path))
    monkeypatch.setattr(command, "Judge", Asked)
    if walled is None:
        monkeypatch.delenv("LAB_WALLED", raising=False)
    else:
        monkeypatch.setenv("LAB_WALLED", walled)
    assert command.main(["lab2", "wave", "my_node.py"]) == command.NOT_PASSED
    assert asked == [trusted]


@pytest.mark.parametrize("script", ["check", "check_rostest"])
def test_the_installed_programs_find_what_they_import(script):
    # Another process, since a program enters a network of its own as it is loaded.
    path = EXERCISE_FOLDERS.parent / "scripts" / script
    loaded = subprocess.run([sys.executable, "-c", "import runpy, sys; runpy.run_path(sys.argv[1])", path],
                            capture_output=True, text=True, timeout=60.0)
    assert loaded.returncode == 0, loaded.stderr
