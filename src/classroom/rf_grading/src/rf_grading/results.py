# SPDX-License-Identifier: BSD-3-Clause
"""The results of a class as plain data: from submissions and verdicts to one table. Free of ROS."""
from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rf_checks.exercises import Exercise
    from rf_grading.plan import SubmissionEntry
    from rf_grading.submissions import Submission

#: The points of one exercise.
POINTS = 100.0
GRADED, NO_PROGRAM, NOT_GRADED = "graded", "no program", "not graded"


@dataclass(frozen=True)
class Cell:
    """One student's result in one exercise. points: 0 to 100, or None where it is not graded.

    status: GRADED; NO_PROGRAM, which has 0 points; NOT_GRADED, where the judge failed, and which another start of the
    grading tries again. sentence: the reason, for the student. verdict: the judge's, or {}.
    """

    status: str
    points: float | None
    sentence: str
    program: str = ""
    note: str = ""
    key: str = ""
    verdict: dict | None = None

    @property
    def has_passed(self) -> bool:
        return bool(self.verdict and self.verdict["passed"])


def held_back(run: dict[str, Any]) -> str:
    """The words behind the points of a verdict's run whose fault costs more than its criteria, or ""."""
    total = sum(one["points"] for one in run["criteria"])
    return ", and not %g, because of the fault" % round(total, 1) if total - run["points"] > 0.05 else ""


@dataclass(frozen=True)
class Row:
    """One student: a Submission, and {exercise's name: Cell}."""

    submission: Submission
    cells: dict

    @property
    def points(self) -> float | None:
        """The sum over the exercises; None where one is not graded."""
        found = [cell.points for cell in self.cells.values()]
        return None if None in found else sum(found)

    @property
    def status(self) -> str:
        statuses = [cell.status for cell in self.cells.values()]
        return next((one for one in (NOT_GRADED, GRADED) if one in statuses), NO_PROGRAM)

    @property
    def sentences(self) -> list[str]:
        """The reasons for lost points, each once."""
        return list(dict.fromkeys(cell.sentence for cell in self.cells.values() if cell.sentence))

    @property
    def notes(self) -> list[Any]:
        """[(exercise's name, note for the instructor)]."""
        return [(name, note) for name, cell in self.cells.items()
                for note in (*([cell.note] if cell.note else ()), *(cell.verdict or {}).get("notes", ()))]


@dataclass(frozen=True)
class Results:
    """A graded class. assignment: its name. exercises: Exercises. rows: Rows. conditions: seed, profile, serial.
    version: the product's. left_out: names in the folder that are no submissions. alike: alike.Pairs."""

    assignment: str
    exercises: tuple
    rows: tuple
    conditions: dict
    version: str
    left_out: tuple = ()
    alike: tuple = ()

    @property
    def most_points(self) -> float:
        return POINTS * len(self.exercises)


def rows_of(entries: list[SubmissionEntry], exercises: list[Exercise], verdicts: dict[str, dict[str, Any]],
            failures: dict[str, str]) -> tuple[Row, ...]:
    """Rows of plan.Entries. verdicts: {key: verdict}; failures: {key: why there is none}."""
    return tuple(Row(entry.submission, {one.name: _cell(entry, one.name, verdicts, failures) for one in exercises})
                 for entry in entries)


def _cell(entry: SubmissionEntry, name: str, verdicts: dict[str, dict[str, Any]], failures: dict[str, str]) -> Cell:
    if name in entry.problems:
        return Cell(NO_PROGRAM, 0.0, entry.problems[name])
    key, path, note = entry.keys[name], entry.paths[name], entry.notes[name]
    verdict = verdicts.get(key)
    if verdict is None:
        return Cell(NOT_GRADED, None, failures.get(key, "not judged yet"), path, note, key)
    return Cell(GRADED, verdict["points"], verdict["hint"] or "", path, note, key, verdict)


def as_data(results: Results) -> dict[str, Any]:
    """The results as {name: value that JSON can hold}."""
    return {
        "assignment": results.assignment, "version": results.version, **results.conditions,
        "exercises": [{"lab": one.lab, "name": one.name, "title": one.title} for one in results.exercises],
        "max_points": results.most_points, "left_out": list(results.left_out),
        "students": [{
            "entry": row.submission.entry, "student": row.submission.student, "name": row.submission.name,
            "email": row.submission.email, "status": row.status, "points": row.points,
            "exercises": {name: {"status": cell.status, "points": cell.points, "passed": cell.has_passed,
                                 "sentence": cell.sentence, "program": cell.program, "key": cell.key,
                                 "verdict": cell.verdict} for name, cell in row.cells.items()},
            "notes": ["%s: %s" % one for one in row.notes]} for row in results.rows],
        "alike": [{"first": pair.first, "second": pair.second, "of_first": round(pair.of_first, 3),
                   "of_second": round(pair.of_second, 3), "fingerprints": pair.count} for pair in results.alike]}
