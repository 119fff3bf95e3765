# SPDX-License-Identifier: BSD-3-Clause
"""The result of an exercise that the page shows."""
import json
import os

import pytest

from lab_web.exercises import ExerciseResults, shown_of

RESULT = {
    "lab": "lab2", "exercise": "rotate_gripper", "program": "rotate.py", "seed": 1, "graded": True, "not_graded": None,
    "points": 62.5, "pass_mark": 80, "passed": False, "fault": "order", "hint": "the numbers are in the wrong order",
    "runs": [{"arguments": ["z", "90"], "points": 62.5, "end": {"how": "finished"},
              "criteria": [{"name": "position", "points": 20.0, "of": 20.0, "found": "0.0 cm off"}]}]}


def test_a_result_is_shown_once_it_is_new(tmp_path):
    path = tmp_path / "exercise.json"
    path.write_text(json.dumps(RESULT))
    results = ExerciseResults(path)
    assert results.newest() is None
    draft = tmp_path / "draft"
    draft.write_text(json.dumps(RESULT))
    os.replace(draft, path)
    found = results.newest()
    assert (found["exercise"], found["points"], found["due"], found["passed"]) == ("rotate_gripper", 62.5, 80.0, False)
    assert found["runs"] == [{"call": "z 90", "criteria": RESULT["runs"][0]["criteria"]}]
    assert found["hint"] == RESULT["hint"] and results.newest() is None
    path.unlink()
    assert results.newest() is None
    path.write_text("{")
    assert results.newest() is None


def test_what_is_not_graded_has_its_reason():
    found = shown_of(json.dumps({**RESULT, "points": None, "not_graded": "this machine is too slow", "hint": None}))
    assert found["points"] is None and found["why"] == "this machine is too slow" and found["hint"] == ""


@pytest.mark.parametrize("text", [
    "", "[]", "{}", "3", json.dumps({**RESULT, "runs": 3}), json.dumps({**RESULT, "points": "many"}),
    json.dumps({**RESULT, "pass_mark": 10 ** 400}), json.dumps({**RESULT, "runs": [{"arguments": []}]})])
def test_another_text_is_no_result(text):
    with pytest.raises(ValueError):
        shown_of(text)
