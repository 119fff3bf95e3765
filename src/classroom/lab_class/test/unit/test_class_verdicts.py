# SPDX-License-Identifier: BSD-3-Clause
"""Results of students' own checks: the last of each exercise, kept over restarts; hostile files are left alone."""
import json
import os

import pytest

from lab_class.verdicts import Verdicts


def result(exercise="wave", points=100.0, passed=True):
    return json.dumps({"exercise": exercise, "passed": passed, "points": points, "pass_mark": 80.0, "not_graded": "",
                       "hint": "", "runs": []})


@pytest.fixture
def file(tmp_path):
    file = tmp_path / "home/.ros/lab_page/exercise.json"
    file.parent.mkdir(parents=True)
    return file


@pytest.fixture
def verdicts(tmp_path, file):
    return Verdicts(tmp_path, tmp_path / "home")


def replace(file, text):
    draft = file.with_name("draft")
    draft.write_text(text)
    draft.replace(file)


def test_the_last_result_of_each_exercise_counts_and_survives_a_restart(tmp_path, file, verdicts):
    verdicts.look()
    assert verdicts.known == {}
    for text in (result(points=40.0, passed=False), result("joint_command", None, False), result()):
        replace(file, text)
        verdicts.look()
    expected = {"wave": {"points": 100.0, "passed": True}, "joint_command": {"points": None, "passed": False}}
    assert verdicts.known == expected
    assert Verdicts(tmp_path, tmp_path / "home").known == expected


def test_a_file_that_is_no_result_changes_nothing(file, verdicts):
    replace(file, result())
    verdicts.look()
    for text in ("", "{", "[]", '{"exercise": 1}', "[" * 100000, result("x" * 2000000)):
        replace(file, text)
        verdicts.look()
    assert list(verdicts.known) == ["wave"]


@pytest.mark.parametrize("points", ["NaN", "-Infinity", "1e999", "1e300", "-1", "1" + "0" * 400, "true1", '"x"'])
def test_points_that_no_check_gives_are_not_kept(tmp_path, file, verdicts, points):
    replace(file, result())
    verdicts.look()
    replace(file, result("joint_command").replace("100.0", points))
    verdicts.look()
    replace(file, result("rotate").replace("80.0", points))
    verdicts.look()
    expected = {"wave": {"points": 100.0, "passed": True}}
    assert verdicts.known == expected or points in ("-1", "1e300")
    assert "joint_command" not in verdicts.known
    json.dumps(verdicts.known, allow_nan=False)
    # What an earlier version has kept.
    (tmp_path / "verdicts.json").write_text('{"wave": {"points": %s, "passed": true}}' % points)
    assert Verdicts(tmp_path, tmp_path / "home").known == {}


def test_links_pipes_and_folders_are_not_read(tmp_path, file, verdicts):
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "exercise.json").write_text(result())
    file.symlink_to(elsewhere / "exercise.json")
    verdicts.look()
    file.unlink()
    # Nobody writes to it: a plain open would wait for ever.
    os.mkfifo(file)
    verdicts.look()
    file.unlink()
    file.mkdir()
    verdicts.look()
    file.rmdir()
    file.parent.rmdir()
    file.parent.symlink_to(elsewhere)
    verdicts.look()
    assert verdicts.known == {}


def test_names_are_limited_in_length_and_number(file, verdicts):
    for number in range(60):
        replace(file, result("%d\n" % number + "x" * 100))
        verdicts.look()
    assert len(verdicts.known) == 40
    assert all(len(name) <= 60 and "\n" not in name for name in verdicts.known)


def test_a_broken_file_of_what_is_kept_is_begun_again(tmp_path, file):
    (tmp_path / "verdicts.json").write_text('{"wave": 3}')
    assert Verdicts(tmp_path, tmp_path / "home").known == {}
