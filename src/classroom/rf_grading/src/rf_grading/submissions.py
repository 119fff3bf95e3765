# SPDX-License-Identifier: BSD-3-Clause
"""The submissions of a class, from what learning platforms export. Free of ROS.

A folder, or an archive of it, with for each student a folder, an archive, or files: as Moodle, nbgrader and Gradescope
write them, or by hand. Nothing in it is trusted: no link is followed, and what cannot be read becomes a sentence.
"""
from __future__ import annotations

import os
import re
import stat
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import yaml

from command_line.user_files import check_file
from rf_checks import submission as files_of_programs
from rf_grading import archives, reading

#: What a submission may bring.
PROGRAMS = (".py", ".ipynb")
_GRADESCOPE = "submission_metadata.yml"
_MAX_METADATA_BYTES = 20 << 20
#: Of an entry's name; folders have at most 255, and a number may follow.
_MAX_NAME_BYTES = 240
#: Folders in each other: os.walk cannot follow a thousand.
_DEEPEST = 30
#: "Li Na_123456_assignsubmission_file_" and what follows: a folder of Moodle's, or a file of its flat form.
_MOODLE = re.compile(r"(?P<entry>(?P<name>.+?)_(?P<number>\d+)_assignsubmission_(?:file|onlinetext)_?)(?P<file>.*)",
                     re.DOTALL)
_IGNORED_AT_TOP = ("timestamp.txt",)


class BadFolder(Exception):
    """The folder of submissions cannot be used; the text says why."""


@dataclass
class Submission:
    """The files of one student. entry: their unique name as found; student, name, email: as far as known.

    files: {path: bytes} of programs and notebooks; others: paths of other files; problem: why it is not judged, or "".
    """

    entry: str
    student: str
    name: str = ""
    email: str = ""
    files: dict = field(default_factory=dict)
    others: list = field(default_factory=list)
    problem: str = ""

    def refuse(self, sentence: str) -> None:
        self.problem, self.files = self.problem or sentence, {}


def is_program(name: str) -> bool:
    return name.lower().endswith(PROGRAMS)


def read_class(path: Path, exercise_names: Sequence[str] = (),
               assignment: str = "") -> tuple[list[Submission], list[str]]:
    """(submissions sorted by entry, names at the top that belong to no student) of a folder or an archive (path).

    exercise_names: endings of files that are no part of a student's name, as in li_wave.py. assignment: nbgrader's;
    only its folder in each student's is read. Raises BadFolder, OSError.
    """
    path = Path(path)
    if path.is_dir():
        top = _Folder(path)
    elif archives.is_archive(path.name):
        top = _Archive(path)
    else:
        raise BadFolder("%s is neither a folder nor a zip or tar file" % path)
    collected, left_out = {}, []
    for name in top.names():
        _sort_in(top, name, collected, left_out, exercise_names)
    _name_by_gradescope(top, collected)
    for one in collected.values():
        _finish(one, assignment)
    return sorted(collected.values(), key=lambda one: one.entry), left_out


def _sort_in(top: _Folder | _Archive, name: str, collected: dict[str, Submission], left_out: list[str],
             exercise_names: Sequence[str]) -> None:
    """Add what an entry at the top holds to the student's Submission; make it where it is new."""
    moodle = _MOODLE.fullmatch(name)
    is_folder = top.is_folder(name)
    if name.startswith(".") or archives.is_litter(name):
        return
    if not (is_folder or moodle or is_program(name) or archives.is_archive(name) or archives.is_other_archive(name)
            or top.is_link(name)):
        left_out.append(name)
        return
    if moodle:
        key = entry = moodle["entry"] if moodle["file"] else name
        student, full_name = moodle["number"], moodle["name"]
    elif is_folder:
        key, entry, student, full_name = "folder " + name, name, name, ""
    elif archives.is_archive(name) or archives.is_other_archive(name):
        entry = student = archives.stem(name)
        key, full_name = "archive " + name, ""
    else:
        entry = student = _without_exercise(name.rpartition(".")[0] or name, exercise_names)
        key, full_name = "file " + entry, ""
    one = collected.get(key)
    if one is None:
        taken = {other.entry for other in collected.values()}
        entry = _shortened(entry)
        if entry in taken:
            numbered = ("%s (%d)" % (entry, k) for k in range(2, len(taken) + 3))
            entry = next(one for one in numbered if one not in taken)
        one = collected[key] = Submission(entry, student, full_name)
    try:
        files, others = _unpacked(*top.read(name))
    except archives.BadArchive as error:
        one.refuse("%s %s" % (name, error))
        return
    except files_of_programs.BadSubmission as error:
        one.refuse(str(error))
        return
    except OSError as error:
        one.refuse("%s cannot be read: %s" % (name, error.strerror or error))
        return
    except reading.NotRead as error:
        one.refuse("%s is not read: %s" % (name, error))
        return
    except Exception as error:  # noqa: BLE001  (one submission ends no grading of the others)
        one.refuse("%s cannot be read: %s" % (name, reading.unforeseen(error)))
        return
    if moodle and not is_folder:
        files = {moodle["file"] if path == name else path: content for path, content in files.items()}
    one.others += others
    if not one.problem:
        one.files.update(files)


def _shortened(entry: str) -> str:
    """A name that a folder can have, also with a number behind it."""
    return os.fsencode(entry)[:_MAX_NAME_BYTES].decode(errors="ignore") if (
        len(os.fsencode(entry)) > _MAX_NAME_BYTES) else entry


def _without_exercise(stem: str, exercise_names: Sequence[str]) -> str:
    for name in sorted(exercise_names, key=len, reverse=True):
        found = re.fullmatch(r"(.+?)[\s_.-]+%s" % re.escape(name), stem, re.IGNORECASE)
        if found:
            return found[1]
    return stem


def _unpacked(files: dict[str, bytes], others: list[str]) -> tuple[dict[str, bytes], list[str]]:
    """(files, others) with what the archives among the files hold in their places. Raises BadSubmission."""
    found, others = {}, list(others)
    for path, content in files.items():
        if not archives.is_archive(path):
            found[path] = content
            continue
        try:
            packed, further = reading.limited(archives.read, content, path, is_program)
        except archives.BadArchive as error:
            raise files_of_programs.BadSubmission("%s %s" % (path, error)) from None
        folder = archives.stem(path)
        found.update({"%s/%s" % (folder, name): packed[name] for name in packed})
        others += ["%s/%s" % (folder, name) for name in further]
        _limit(found)
    return found, others


def _limit(files: dict[str, bytes]) -> None:
    """Raises BadSubmission where {path: bytes} of programs are too many or too large."""
    if len(files) > archives.MAX_FILES or sum(map(len, files.values())) > archives.MAX_TAKEN_BYTES:
        raise files_of_programs.BadSubmission("the submission holds more than %d programs, or %d MiB of them" % (
            archives.MAX_FILES, archives.MAX_TAKEN_BYTES >> 20))


def _finish(one: Submission, assignment: str) -> None:
    """Keep what belongs to the assignment, and refuse a submission without programs."""
    if assignment:
        one.files = {path: content for path, content in one.files.items() if path.startswith(assignment + "/")}
    if one.problem or one.files:
        return
    there = [path for path in one.others if path.rpartition("/")[2] not in _IGNORED_AT_TOP]
    packed = [path for path in there if archives.is_other_archive(path)]
    if packed:
        one.refuse("%s is an archive of a kind that is not read; zip and tar are" % packed[0])
    elif there:
        one.refuse("the submission holds no Python file, only %s" % ", ".join(sorted(there)[:3]))
    else:
        one.refuse("the submission is empty")


def _name_by_gradescope(top: _Folder | _Archive, collected: dict[str, Submission]) -> None:
    """Names and numbers from Gradescope's list, where there is one."""
    try:
        listed = yaml.safe_load(top.text(_GRADESCOPE) or "") or {}
    except (yaml.YAMLError, ValueError, RecursionError, OSError, files_of_programs.BadSubmission):
        return
    for one in collected.values():
        entry = listed.get(one.entry) if isinstance(listed, dict) else None
        people = entry.get(":submitters") if isinstance(entry, dict) else None
        if not isinstance(people, list) or not all(isinstance(person, dict) for person in people) or not people:
            continue
        one.name = ", ".join(str(person.get(":name") or "") for person in people)
        one.student = ", ".join(str(person.get(":sid") or person.get(":email") or one.entry) for person in people)
        one.email = ", ".join(str(person.get(":email") or "") for person in people)


class _Folder:
    """A folder of submissions on disk."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def names(self) -> list[str]:
        return sorted(os.listdir(self._path))

    def is_folder(self, name: str) -> bool:
        return stat.S_ISDIR((self._path / name).lstat().st_mode)

    def is_link(self, name: str) -> bool:
        return (self._path / name).is_symlink()

    def text(self, name: str) -> str:
        path = self._path / name
        if path.is_symlink() or not path.is_file() or path.stat().st_size > _MAX_METADATA_BYTES:
            return ""
        return path.read_text(encoding="utf-8", errors="replace")

    def read(self, name: str) -> tuple[dict[str, bytes], list[str]]:
        """(files, others) below an entry. Raises BadArchive, BadSubmission, OSError."""
        path = self._path / name
        if archives.is_archive(name) and path.is_file() and not path.is_symlink():
            return reading.limited(archives.read, path, name, is_program)
        if not self.is_folder(name):
            return ({name: _content(path, name)}, []) if is_program(name) or path.is_symlink() else ({}, [name])
        return _walk(path)


def _walk(top: Path) -> tuple[dict[str, bytes], list[str]]:
    """(files, others) of a folder on disk; a link in it is refused."""
    files, packed, others = {}, {}, []

    def give_up(error: BaseException):
        raise error

    for folder, below, names in os.walk(top, onerror=give_up):
        for name in [*below, *names]:
            path = Path(folder) / name
            relative = path.relative_to(top).as_posix()
            if archives.is_litter(relative):
                if name in below:
                    below.remove(name)
            elif path.is_symlink():
                raise files_of_programs.BadSubmission("%s is a link, to %s; links are not followed" % (
                    relative, os.readlink(path)))
            elif relative.count("/") >= _DEEPEST:
                raise files_of_programs.BadSubmission("the submission has more than %d folders in each other"
                                                      % _DEEPEST)
            elif name in names:
                if archives.is_archive(name):
                    packed[relative] = _content(path, relative)
                elif is_program(name):
                    files[relative] = _content(path, relative)
                else:
                    others.append(relative)
        _limit(files)
        if sum(map(len, packed.values())) > archives.MAX_ARCHIVE_BYTES:
            raise files_of_programs.BadSubmission("the submission holds archives of more than %d MiB" % (
                archives.MAX_ARCHIVE_BYTES >> 20))
        below.sort()
    return {**files, **packed}, others


def _content(path: Path, relative: str) -> bytes:
    if archives.is_archive(path.name):
        if not stat.S_ISREG(path.lstat().st_mode) or path.stat().st_size > archives.MAX_ARCHIVE_BYTES:
            raise files_of_programs.BadSubmission("%s is no archive of at most %d MiB" % (
                relative, archives.MAX_ARCHIVE_BYTES >> 20))
        return path.read_bytes()
    try:
        return files_of_programs.read(path, archives.most_bytes(path.name))
    except files_of_programs.BadSubmission as error:
        # With the path in the submission instead of the one on this machine.
        raise files_of_programs.BadSubmission(str(error).replace(str(path), relative)) from None


class _Archive:
    """An archive of a whole class, as platforms export it."""

    def __init__(self, path: Path) -> None:
        def is_wanted(name: str) -> bool:
            return is_program(name) or archives.is_archive(name) or name.rpartition("/")[2] == _GRADESCOPE

        refused = {}
        try:
            check_file(path, archives.OF_A_CLASS.bytes)
        except OSError as error:
            raise BadFolder("%s cannot be read: %s" % (path, error.strerror or error)) from error
        try:
            found, others = archives.read(path, path.name, is_wanted, archives.OF_A_CLASS, refused)
        except archives.BadArchive as error:
            raise BadFolder("%s %s; unpack it yourself, and name the folder" % (path, error)) from error
        names = [*found, *others, *refused]
        tops = {name.partition("/")[0] for name in names}
        # Many platforms and all Macs put a folder around everything.
        around = next(iter(tops)) + "/" if len(tops) == 1 and all(name.count("/") > 1 or archives.is_archive(name)
                                                                   for name in names) else ""
        self._found = {name[len(around):]: content for name, content in found.items()}
        self._others = [name[len(around):] for name in others]
        self._refused = {name[len(around):]: sentence for name, sentence in refused.items()}

    def names(self) -> list[str]:
        return sorted({name.partition("/")[0] for name in self._paths()})

    def is_folder(self, name: str) -> bool:
        return any(path.startswith(name + "/") for path in self._paths())

    def _paths(self) -> tuple[str, ...]:
        return (*self._found, *self._others, *self._refused)

    def is_link(self, name: str) -> bool:
        return False

    def text(self, name: str) -> str:
        return self._found.get(name, b"").decode("utf-8", "replace")

    def read(self, name: str) -> tuple[dict[str, bytes], list[str]]:
        for path, sentence in self._refused.items():
            if path == name or path.startswith(name + "/"):
                raise files_of_programs.BadSubmission("the submission " + sentence)
        if self.is_folder(name):
            start = len(name) + 1
            return ({path[start:]: content for path, content in self._found.items() if path.startswith(name + "/")},
                    [path[start:] for path in self._others if path.startswith(name + "/")])
        if archives.is_archive(name):
            return reading.limited(archives.read, self._found[name], name, is_program)
        return ({name: self._found[name]}, []) if name in self._found else ({}, [name])
