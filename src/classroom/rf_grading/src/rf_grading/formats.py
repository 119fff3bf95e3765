# SPDX-License-Identifier: BSD-3-Clause
"""Results in the forms that other programs read: CSV, JUnit, nbgrader's export of grades, Gradescope. Free of ROS."""
from __future__ import annotations

import csv
import io
import json
import re
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

from rf_grading.results import GRADED, NOT_GRADED, POINTS, as_data, held_back

if TYPE_CHECKING:
    from rf_grading.results import Results, Row

#: The columns that nbgrader's own export of grades has.
NBGRADER_COLUMNS = ("assignment", "duedate", "timestamp", "student_id", "last_name", "first_name", "email", "raw_score",
                    "late_submission_penalty", "score", "max_score")
#: A spreadsheet takes a cell that begins so for a formula.
_FORMULA = ("=", "+", "-", "@", "\t", "\r")
_NO_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def plain(text: str) -> str:
    """A text without characters that files in UTF-8 and XML cannot hold; each becomes a question mark."""
    return _NO_XML.sub("?", str(text))


def one_line(text: str) -> str:
    """As :func:`plain`, for a terminal: a name with a line's end does not pretend to be another line."""
    return " ".join(plain(text).split())


def _points(value: float | None) -> str:
    return "" if value is None else "%g" % round(value, 2)


def as_json(results: Results) -> str:
    return json.dumps(as_data(results), indent=1) + "\n"


def _table(header: Sequence[str], rows: Iterable[Any]) -> str:
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(header)
    for row in rows:
        cells = [plain(cell) for cell in row]
        writer.writerow(["'" + cell if cell.startswith(_FORMULA) and not _is_number(cell) else cell for cell in cells])
    return stream.getvalue()


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def as_csv(results: Results) -> str:
    """A line for each student: points in each exercise, their sum, the reasons for lost points, notes."""
    names = [exercise.name for exercise in results.exercises]
    return _table(["entry", "student", "name", "email", "status", *names, "points", "of", "reasons", "notes"], (
        [row.submission.entry, row.submission.student, row.submission.name, row.submission.email, row.status,
         *(_points(row.cells[name].points) for name in names), _points(row.points), _points(results.most_points),
         " / ".join(row.sentences), " / ".join("%s: %s" % one for one in row.notes)] for row in results.rows))


def as_nbgrader(results: Results) -> str:
    """The form of `nbgrader export`: a line for each student. A student without grade has an empty score."""
    def line(row: Row) -> list[str]:
        first, _, last = row.submission.name.rpartition(" ")
        score = _points(row.points)
        return [results.assignment, "", "", row.submission.student, last, first, row.submission.email, score, "0",
                score, _points(results.most_points)]

    return _table(NBGRADER_COLUMNS, map(line, results.rows))


def as_junit(results: Results) -> str:
    """A suite for each exercise, a case for each student."""
    top = ElementTree.Element("testsuites", name=plain(results.assignment))
    for exercise in results.exercises:
        cells = [(row, row.cells[exercise.name]) for row in results.rows]
        suite = ElementTree.SubElement(
            top, "testsuite", name="%s.%s" % (exercise.lab, exercise.name), tests=str(len(cells)),
            failures=str(sum(cell.status != NOT_GRADED and not cell.has_passed for _, cell in cells)),
            errors=str(sum(cell.status == NOT_GRADED for _, cell in cells)))
        for row, cell in cells:
            case = ElementTree.SubElement(suite, "testcase", name=plain(row.submission.entry),
                                          classname="%s.%s" % (exercise.lab, exercise.name),
                                          time="%.2f" % (cell.verdict or {}).get("wall_s", 0.0))
            text = "%s of %g points: %s" % (_points(cell.points), POINTS, cell.sentence)
            if cell.status == NOT_GRADED:
                ElementTree.SubElement(case, "error", message=plain(cell.sentence))
            elif not cell.has_passed:
                ElementTree.SubElement(case, "failure", message=plain(text))
            else:
                ElementTree.SubElement(case, "system-out").text = plain(text)
    return ElementTree.tostring(top, encoding="unicode", xml_declaration=True) + "\n"


def _criteria(run: dict[str, Any]) -> str:
    lines = ["%s: %g of %g (%s)" % (one["name"], round(one["points"], 2), round(one["of"], 2), one["found"])
             for one in run["criteria"]]
    said = held_back(run)
    return "\n".join([*lines, "%g points%s" % (round(run["points"], 1), said)] if said else lines)


def hundredths(points: list[float], total: float) -> list[tuple[int, int]]:
    """[(score, most)] of each run in hundredths of a point, which add up to ``total`` and to POINTS exactly.

    points: of each run, 0 to POINTS; total: their mean. The hundredths that are left when POINTS are shared equally go
    to runs that need them; a run with all points has its most, one without points none.
    """
    whole = round(100 * POINTS)
    least, extra = divmod(whole, len(points))
    scores, most = [round(value * least / POINTS) for value in points], [least] * len(points)
    missing, order = round(100 * total) - sum(scores), sorted(range(len(points)), key=lambda k: -points[k])
    for place, k in enumerate(order):
        if extra and (missing > 0 or len(order) - place <= extra):
            most[k] += 1
            extra -= 1
        if points[k] >= POINTS:
            step = most[k] - scores[k]
        elif points[k] > 0:
            step = max(-scores[k], min(missing, most[k] - scores[k]))
        else:
            step = 0
        scores[k] += step
        missing -= step
    return list(zip(scores, most, strict=True))


def as_gradescope(row: Row) -> str:
    """One student's results.json: a test for each run, with the points that count.

    Has no notes for the instructor: students read it. One that is not graded has no score anywhere: else Gradescope
    would add up the tests' scores.
    """
    tests = []
    for number, (name, cell) in enumerate(row.cells.items(), 1):
        if cell.status == NOT_GRADED:
            continue
        if cell.status != GRADED:
            tests.append({"number": str(number), "name": name, "score": 0.0, "max_score": POINTS, "status": "failed",
                          "output": plain(cell.sentence)})
            continue
        runs = cell.verdict["runs"]
        shares = hundredths([run["points"] for run in runs], cell.points)
        tests += [{"number": "%d.%d" % (number, place), "name": plain(" ".join([name, *run["arguments"]])),
                   "score": score / 100, "max_score": most / 100,
                   "status": "passed" if run["points"] >= cell.verdict["pass_mark"] else "failed",
                   "output": plain(_criteria(run))} for place, (run, (score, most)) in enumerate(
                       zip(runs, shares, strict=True), 1)]
    found = {"output": plain("\n".join(row.sentences)), "output_format": "text", "test_output_format": "text",
             "visibility": "visible", "stdout_visibility": "hidden", "tests": tests,
             "execution_time": round(sum((cell.verdict or {}).get("wall_s", 0.0) for cell in row.cells.values()))}
    if row.points is None:
        for test in tests:
            del test["score"], test["max_score"]
    else:
        found["score"] = round(row.points, 2)
    return json.dumps(found, indent=1) + "\n"
