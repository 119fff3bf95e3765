# SPDX-License-Identifier: BSD-3-Clause
"""The tasks of a grading: one for each program of each submission, its files laid out in a folder. Free of ROS."""
from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rf_checks import submission as files_of_programs
from rf_grading import keys, programs, reading

if TYPE_CHECKING:
    from rf_checks.exercises import Exercise
    from rf_grading.submissions import Submission


@dataclass(frozen=True)
class PlannedVerdict:
    """One verdict to be found. program: path of the laid-out program."""

    key: str
    exercise: Exercise
    program: str


@dataclass
class SubmissionEntry:
    """A Submission and, for each exercise's name, its key, or the sentence that says why it is not judged.

    paths: the program's path in the submission, notes: about its making; both by the exercise's name. texts: {path:
    text} of its programs.
    """

    submission: Submission
    keys: dict = field(default_factory=dict)
    problems: dict = field(default_factory=dict)
    paths: dict = field(default_factory=dict)
    notes: dict = field(default_factory=dict)
    texts: dict = field(default_factory=dict)


def make(submissions: list[Submission], exercises: list[Exercise], version: str, conditions: dict[str, Any],
         folder: Path, only_used: bool = False) -> tuple[list[Exercise], list[SubmissionEntry],
                                                         dict[str, PlannedVerdict]]:
    """(exercises, entries, {key: PlannedVerdict}) for Submissions.

    conditions: {"seed", "profile", ...} of every verdict. folder: an empty one for the programs. only_used: leave out
    exercises for which no submission has a program. Raises OSError.
    """
    assigned = {one.entry: _assigned(one, exercises) for one in submissions}
    if only_used:
        exercises = [exercise for exercise in exercises if any(
            isinstance(found.get(exercise), programs.Program) for found in assigned.values())]
    entries, tasks = [], {}
    for number, one in enumerate(submissions):
        entry = SubmissionEntry(one)
        entries.append(entry)
        laid_out = None
        for exercise in exercises:
            found = assigned[one.entry].get(exercise)
            if not isinstance(found, programs.Program):
                entry.problems[exercise.name] = one.problem or str(found)
                continue
            try:
                laid_out = laid_out or _lay_out(found.files, Path(folder) / str(number))
                path = laid_out / found.path
                used = files_of_programs.files(path)
                key = keys.key(version, exercise, conditions, path.name, used)
                parent = Path(found.path).parent
                texts = {(parent / name).as_posix(): files_of_programs.decoded(content)
                         for name, content in used.items()}
            except Exception as error:  # noqa: BLE001  (one submission ends no grading of the others)
                entry.problems[exercise.name] = "%s cannot be judged: %s" % (
                    found.path, _shorter(error, folder, number))
                continue
            entry.keys[exercise.name], entry.paths[exercise.name] = key, found.path
            entry.notes[exercise.name] = found.note
            entry.texts.update(texts)
            tasks.setdefault(key, PlannedVerdict(key, exercise, str(path)))
    return exercises, entries, tasks


def _assigned(one: Submission, exercises: list[Exercise]) -> dict[Exercise, programs.NoProgram | programs.Program]:
    """{exercise: Program, or NoProgram} of a Submission; {}, and it is refused, where its programs cannot be read."""
    if not one.files:
        return {}
    sentence = reading.problem(one.files, exercises)
    if sentence:
        one.refuse(sentence)
        return {}
    try:
        return programs.assign(one.files, exercises)
    except Exception as error:  # noqa: BLE001  (one submission ends no grading of the others)
        one.refuse("the submission is not read: %s" % reading.unforeseen(error))
        return {}


def _lay_out(files: dict[str, bytes], folder: Path) -> Path:
    for path, content in files.items():
        target = folder / path
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(content)
    return folder


def _shorter(error: Exception, folder: Path, number: int) -> str:
    if isinstance(error, OSError | files_of_programs.BadSubmission):
        text = "%s" % (getattr(error, "strerror", None) or error)
    else:
        text = reading.unforeseen(error)
    return text.replace("%s/%d/" % (folder, number), "")
