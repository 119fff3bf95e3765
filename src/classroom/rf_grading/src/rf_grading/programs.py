# SPDX-License-Identifier: BSD-3-Clause
"""Which file of a submission is the program for which exercise; programs out of notebooks. Free of ROS."""
from __future__ import annotations

import ast
import json
import posixpath
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from command_line.options import did_you_mean
from rf_checks.exercises import EXERCISES, LABS, UnknownExercise, choose
from rf_checks.submission import LARGEST_BYTES, decoded, imported

if TYPE_CHECKING:
    from rf_checks.exercises import Exercise

_MARK = re.compile(r"^\s*#\s*exercise\s*:\s*(\w+)", re.MULTILINE | re.IGNORECASE)
#: Lines of cells that are for the notebook alone.
_OF_NOTEBOOKS = re.compile(r"^(\s*)([%!?].*)$", re.MULTILINE)
#: Words that a program for this lab has; a file without any is no program of an exercise.
_OF_PROGRAMS = re.compile(r"rospy|roslib|baxter_interface|moveit_commander|__main__")


class NoProgram(Exception):
    """A submission has no program for an exercise, or several; the text says so."""


class TooLarge(Exception):
    """A notebook has more code than a program may have; the text says so."""


@dataclass(frozen=True)
class Program:
    """path: of the program in files. files: {path: bytes}, all that belongs to the submission. note: about its making,
    or ""."""

    path: str
    files: dict
    note: str = ""


def exercises_of(lab: str = "", names: Sequence[str] = ()) -> list[Exercise]:
    """The Exercises of a lab ("": of all) with these names (none: all). Raises UnknownExercise."""
    known = [exercise for exercise in EXERCISES if lab in ("", exercise.lab)]
    if not known:
        raise UnknownExercise("there is no lab '%s'; labs are %s%s" % (lab, ", ".join(LABS), did_you_mean(lab, LABS)))
    unknown = [name for name in names if name not in [exercise.name for exercise in known]]
    if unknown:
        names = [exercise.name for exercise in known]
        raise UnknownExercise("%s has no exercise '%s'; its exercises are %s%s" % (
            lab or "no lab", unknown[0], ", ".join(names), did_you_mean(unknown[0], names)))
    return [exercise for exercise in known if not names or exercise.name in names]


def with_notebooks_as_programs(files: dict[str, bytes]) -> tuple[dict[str, bytes], dict[str, str]]:
    """(files, notes): notebooks as programs beside them, and {path: note} of these programs.

    A notebook that cannot be read is left out, and its path has a sentence among the notes.
    """
    found = {path: content for path, content in files.items() if not path.lower().endswith(".ipynb")}
    notes = {}
    for path, content in files.items():
        if not path.lower().endswith(".ipynb"):
            continue
        target = path[:-len(".ipynb")] + ".py"
        if target in found:  # exported by its author
            continue
        try:
            found[target] = program_of_notebook(content).encode()
        except TooLarge as error:
            notes[path] = "%s %s" % (path, error)
            continue
        except UnicodeEncodeError:
            notes[path] = "%s holds a character that no file can hold, half of a surrogate pair" % path
            continue
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
            notes[path] = "%s is no notebook that can be read" % path
            continue
        notes[target] = "made of the code cells of %s" % path
    return found, notes


def program_of_notebook(content: bytes) -> str:
    """The code cells of a notebook (bytes) as one program; its own commands (%magic, !shell) become comments.

    Raises TooLarge; ValueError, KeyError, TypeError, AttributeError for anything that is no notebook.
    """
    cells = json.loads(content)["cells"]
    texts = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]
    # Before Python's parser sees it, which needs hundreds of bytes for each.
    if sum(map(len, texts)) > LARGEST_BYTES:
        raise TooLarge("has more than %d bytes of code" % LARGEST_BYTES)
    return "\n\n".join(_plain(text) for text in texts) + "\n"


def _plain(text: str) -> str:
    """A cell without the notebook's own commands. In a cell that is Python, a line like %d in a text stays."""
    try:
        ast.parse(text)
        return text
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        pass
    if text.startswith("%%"):
        return "".join("# %s\n" % line for line in text.splitlines())
    return _OF_NOTEBOOKS.sub(r"\1pass  # \2", text)


def assign(files: dict[str, bytes], exercises: list[Exercise]) -> dict[Exercise, NoProgram | Program]:
    """{exercise: Program, or NoProgram with the reason} of a submission's files, for a list of Exercises."""
    files, notes = with_notebooks_as_programs(files)
    modules = _modules(files)
    programs = [path for path in files if path not in modules] or list(files)
    found = {exercise: [] for exercise in exercises}
    marked_elsewhere = []
    for path in programs:
        exercise, mark = _exercise_of(path, files[path], exercises, alone=len(programs) == 1)
        if exercise is not None:
            found[exercise].append(path)
        elif mark:
            marked_elsewhere.append("%s is marked for %s" % (path, mark))
    unread = [note for path, note in notes.items() if path not in files]
    return {exercise: _one_of(paths, exercise, files, notes, [*marked_elsewhere, *unread])
            for exercise, paths in found.items()}


def _one_of(paths: list[str], exercise: Exercise, files: dict[str, bytes], notes: dict[str, Any],
            reasons: list[Any]) -> NoProgram | Program:
    if len(paths) > 1 and len({files[path] for path in paths}) > 1:
        return NoProgram("%d different files are for %s: %s; send one" % (
            len(paths), exercise.name, ", ".join(sorted(paths))))
    if not paths:
        return NoProgram("no program for %s%s" % (exercise.name, ": " + "; ".join(reasons[:3]) if reasons else ""))
    path = min(paths)
    return Program(path, files, notes.get(path, ""))


def _exercise_of(path: str, content: bytes, exercises: list[Exercise], alone: bool) -> tuple[Exercise | None, str]:
    """(the Exercise that a file is for, or None; the exercise that it names itself, or "")."""
    text = decoded(content)
    mark = _MARK.search(text)
    by_name = {exercise.name: exercise for exercise in exercises}
    if mark:
        return by_name.get(mark[1]), mark[1]
    name = posixpath.basename(path)
    stem = name[:-len(".py")].lower()
    # The longest: joint_command is no command.
    named = sorted((one for one in by_name if one in stem), key=len)
    if named:
        return by_name[named[-1]], ""
    if alone and len(exercises) == 1:
        return exercises[0], ""
    labs = [lab for lab in dict.fromkeys(exercise.lab for exercise in exercises)
            if sum(exercise.lab == lab for exercise in EXERCISES) > 1]
    for lab in labs if _OF_PROGRAMS.search(text) else ():
        try:
            chosen = choose(lab, "", name, text)
        except UnknownExercise:
            continue
        if chosen in exercises:
            return chosen, ""
    return (exercises[0], "") if len(exercises) == 1 and _OF_PROGRAMS.search(text) else (None, "")


def _modules(files: dict[str, bytes]) -> set[str]:
    """Paths of files that another file beside them imports."""
    found = set()
    for path, content in files.items():
        folder = posixpath.dirname(path)
        for module in imported(content):
            beside = posixpath.join(folder, *module.split("."))
            found |= {one for one in (beside + ".py", beside + "/__init__.py") if one in files and one != path}
            top = posixpath.join(folder, module.split(".")[0])
            found |= {one for one in files if one.startswith(top + "/")}
            found |= {top + ".py"} & set(files) - {path}
    return found
