# SPDX-License-Identifier: BSD-3-Clause
"""Results in every form, and the pages: right, complete, and harmless whatever a student wrote."""
import csv
import dataclasses
import io
import json
import random
from xml.etree import ElementTree

import pytest

from rf_grading import alike, drawing, formats, motion, pages, programs, results
from rf_grading.plan import SubmissionEntry
from rf_grading.submissions import Submission

EXERCISES = programs.exercises_of("lab2", ["wave", "tf_listener"])
EVIL = "<script>alert('x')</script>\x00\x1b[31m\ud800"


def verdict(points, hint=None, **more):
    return {"points": points, "passed": points >= 80, "pass_mark": 80, "hint": hint,
            "fault": "far_off" if hint else None,
            "wall_s": 2.0, "program": "wave.py", "notes": [], "isolation": "bubblewrap",
            "runs": [{"arguments": ["z", "90"], "points": points, "fault": None, "output": "", "errors": "",
                      "end": {"how": "finished", "simulated_s": 3.0},
                      "criteria": [{"name": "position", "points": points, "of": 100.0, "found": "2 cm off"}]}], **more}


def entry(name, keys=(), problems=(), full_name=""):
    one = SubmissionEntry(Submission(name, name, full_name, "%s@example.org" % name))
    one.keys, one.problems = dict(keys), dict(problems)
    one.paths = dict.fromkeys(one.keys, "wave.py")
    one.notes = dict.fromkeys(one.keys, "")
    return one


@pytest.fixture
def found():
    none = {"tf_listener": "no program for tf_listener"}
    rows = results.rows_of([
        entry("anna", {"wave": "a"}, none, "Anna Maria Groß"), entry("=cmd()", {"wave": "b"}, none),
        entry("chen", {"wave": "c"}, none), entry("dan", (), {"wave": "is empty", "tf_listener": "is empty"})],
        EXERCISES, {"a": verdict(100.0, notes=["SECRET: copied"]), "b": verdict(30.0, EVIL)}, {"c": "took too long"})
    pairs = (alike.Pair("=cmd()", "anna", 0.9, 0.8, 40),)
    return results.Results("lab 2", tuple(EXERCISES), rows, {"seed": 3, "profile": "sim", "serial": 0}, "v1",
                           ("roster.csv",), pairs)


def test_points_and_states(found):
    assert [(row.points, row.status) for row in found.rows] == [
        (100.0, "graded"), (30.0, "graded"), (None, "not graded"), (0.0, "no program")]
    assert found.most_points == 200.0


def test_json_has_everything(found):
    data = json.loads(formats.as_json(found))
    assert [student["points"] for student in data["students"]] == [100.0, 30.0, None, 0.0]
    assert data["students"][0]["exercises"]["wave"]["verdict"]["points"] == 100.0
    assert data["alike"][0]["first"] == "=cmd()" and data["left_out"] == ["roster.csv"] and data["seed"] == 3


def test_csv_has_a_line_for_each_and_no_formulas(found):
    rows = list(csv.DictReader(io.StringIO(formats.as_csv(found))))
    assert [(row["entry"], row["wave"], row["tf_listener"], row["points"], row["of"]) for row in rows] == [
        ("anna", "100", "0", "100", "200"), ("'=cmd()", "30", "0", "30", "200"), ("chen", "", "0", "", "200"),
        ("dan", "0", "0", "0", "200")]
    assert rows[3]["reasons"] == "is empty"
    assert "SECRET" in rows[0]["notes"]


def test_nbgraders_columns(found):
    rows = list(csv.reader(io.StringIO(formats.as_nbgrader(found))))
    assert tuple(rows[0]) == formats.NBGRADER_COLUMNS
    assert rows[1] == ["lab 2", "", "", "anna", "Groß", "Anna Maria", "anna@example.org", "100", "0", "100", "200"]
    assert dict(zip(rows[0], rows[3], strict=True))["score"] == ""


def test_junit_counts(found):
    root = ElementTree.fromstring(formats.as_junit(found).encode())
    wave = next(suite for suite in root if suite.get("name") == "lab2.wave")
    assert (wave.get("tests"), wave.get("failures"), wave.get("errors")) == ("4", "2", "1")
    assert [case.get("name") for case in wave] == ["anna", "=cmd()", "chen", "dan"]


def test_points_of_runs_add_up_exactly():
    """Of runs with all, some and no points; three runs with all of them had 99.99."""
    rng = random.Random(0)
    cases = [[rng.choice((0.0, 100.0, round(rng.uniform(0, 100), 2))) for _ in range(count)]
             for count in range(1, 12) for _ in range(200)]
    for points in ([100.0] * 3, [0.0] * 3, [100.0, 0.0, 100.0], *cases):
        total = round(sum(points) / len(points), 2)
        shares = formats.hundredths(points, total)
        assert sum(most for _, most in shares) == 10_000, points
        assert sum(score for score, _ in shares) == round(100 * total), (points, shares)
        for value, (score, most) in zip(points, shares, strict=True):
            assert 0 <= score <= most and (score == most or value < 100.0) and (score == 0 or value > 0.0), shares
            assert score == pytest.approx(value / len(points) * 100, abs=len(points)), (points, shares)


def test_gradescope_has_scores_that_add_up_and_no_notes(found):
    for row in found.rows:
        text = formats.as_gradescope(row)
        data = json.loads(text)
        assert "SECRET" not in text
        if row.points is None:
            # Gradescope adds up the tests' scores where there is no other.
            assert not any("score" in part for part in (data, *data["tests"])) and "took too long" in data["output"]
        else:
            assert data["score"] == row.points == pytest.approx(sum(test["score"] for test in data["tests"]))
            assert sum(test["max_score"] for test in data["tests"]) == found.most_points
        assert all(test["status"] in ("passed", "failed") for test in data["tests"])


def test_a_students_page_is_about_that_student_alone(found):
    page = pages.feedback(found, found.rows[0], {})
    assert "Anna Maria Groß" in page and "2 cm off" in page
    assert "./baxter.sh check lab2 wave wave.py --seed 3" in page
    assert not any(word in page for word in ("SECRET", "chen", "cmd", "took too long"))


def test_a_run_whose_fault_costs_more_than_its_criteria_says_so(found):
    run = found.rows[1].cells["wave"].verdict["runs"][0]
    run["criteria"] = [{"name": "base -> hand", "points": 100 / 3, "of": 100 / 3, "found": "right"}] * 2
    said = "30 points%s, and not 66.7, because of the fault"
    assert said % " for this run" in pages.feedback(found, found.rows[1], {})
    assert said % "" in json.loads(formats.as_gradescope(found.rows[1]))["tests"][1]["output"]
    assert "because of the fault" not in pages.feedback(found, found.rows[0], {})
    assert "33.333" not in pages.feedback(found, found.rows[1], {}) + formats.as_gradescope(found.rows[1])


def test_pages_hold_no_code_of_a_student(found):
    for page in (pages.feedback(found, found.rows[1], {}), pages.overview(found, 1.0, lambda row: "a b/ü%.html")):
        assert "<script" not in page and "&lt;script&gt;" in page
        assert "\x00" not in page and "\x1b" not in page
        page.encode()  # without lone surrogates
        # Each tag that is opened is closed.
        ElementTree.fromstring(page.partition("\n")[2].replace('<meta charset="utf-8"><meta name="viewport" '
                                                               'content="width=device-width">', ""))


def test_the_overview_has_everybody_and_who_is_alike(found):
    page = pages.overview(found, 12.0, lambda row: "feedback/%s/feedback.html" % row.submission.entry)
    assert all(row.submission.entry in page for row in found.rows)
    assert 'href="feedback/%3Dcmd%28%29/feedback.html"' in page
    assert "90 % of the first's own code" in page and "SECRET" in page and "roster.csv" in page
    assert '<td>wave</td><td>far off</td><td class="why">' in page and "far_off" not in page
    assert '<td class="n">4</td><td>tf_listener</td><td>no program</td>' in page


def test_the_overview_has_a_column_of_names_where_somebody_has_one(found):
    assert "Anna Maria Gro" in found.rows[0].submission.name
    for rows, shown in ((found.rows, True), (found.rows[1:], False)):
        page = pages.overview(dataclasses.replace(found, rows=rows, alike=()), 1.0, lambda row: "a.html")
        assert ("<th>name</th>" in page) == shown


def test_the_median_of_two_is_between_them(found):
    page = pages.overview(dataclasses.replace(found, rows=found.rows[:2]), 1.0, lambda row: "a.html")
    assert "Mean 65.0 of 200 points, median 65.0." in page


def test_pages_suit_dark_windows_telephones_and_paper(found):
    """Pages have no colour but the style's, in which each has a second value for dark windows."""
    row = found.rows[1]
    row.cells["wave"].verdict["runs"][0]["output"] = "it said this"
    page = pages.feedback(found, row, {"b": [motion.of_run(FakeRecording(5), FakeRobot())]})
    assert '<text x="2" y="13" font-size="12" fill="currentColor">' in page
    light, dark = page.split("@media screen and (prefers-color-scheme: dark)")
    names = [part.partition(":")[0] for part in light.split("--")[1:]]
    assert names and all("--%s: " % name in dark.partition("} }")[0] for name in names)
    # Closed details are not printed, and half of a wide table is not seen on a telephone that cannot scroll it.
    assert "<details open>" in page and "@media print" in page and "overflow-x: auto" in page


class FakeRobot:
    """Arms that turn about the vertical axis by the first joint value."""

    def frame(self, name, joints):
        pose = [[1, 0, 0, 0.1 * motion.LINKS.index(name.partition("_")[2])], [0, 1, 0, joints["a"]], [0, 0, 1, 0.5]]
        return Matrix([*pose, [0, 0, 0, 1]])


class Matrix:
    def __init__(self, rows):
        self.rows = rows

    def __getitem__(self, place):
        rows, column = place
        return [row[column] for row in self.rows[rows]]


class FakeRecording:
    def __init__(self, count):
        self.records = [{"t": 5.0 + 0.01 * k} for k in range(count)]

    def joints_at(self, row):
        return {"a": 0.001 * row}


def test_the_picture_moves_from_the_first_to_the_last_record():
    found = motion.of_run(FakeRecording(1000), FakeRobot())
    assert len(found["times"]) == motion.MAX_FRAMES
    assert (found["times"][0], found["times"][-1]) == (0.0, 9.99)
    assert found["left"][0][0] == [0, 0, 500] and found["left"][-1][-1] == [400, 999, 500]
    root = ElementTree.fromstring(drawing.of_run(found))
    for animate in root.iter("{http://www.w3.org/2000/svg}animate"):
        times, values = animate.get("keyTimes").split(";"), animate.get("values").split(";")
        assert len(times) == len(values)
        assert (times[0], times[-1]) == ("0.0000", "1")
        assert [float(time) for time in times] == sorted(map(float, times))
    assert motion.of_run(FakeRecording(0), FakeRobot()) == {} and drawing.of_run({}) == ""
    assert ElementTree.fromstring(drawing.of_run(motion.of_run(FakeRecording(1), FakeRobot()))) is not None
