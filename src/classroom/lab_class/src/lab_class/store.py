# SPDX-License-Identifier: BSD-3-Clause
"""The class on disk: a folder with class.json, running.json while a supervisor runs, and a folder for each lab.

Students' files and tokens survive restarts of the host; the rest is of one run.
"""
from __future__ import annotations

import contextlib
import fcntl
import json
import os
import secrets
import shlex
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from lab_class.disk import remove
from lab_class.labs import ClassError
from rf_checks.roster import INSTRUCTOR, Student

_CLASS, _RUNNING, _LOCK = "class.json", "running.json", "lock"
# Of a file that is being written.
_NEW = ".new"
#: Begins the name of a supervisor's folder of sockets, below the folder of temporary files.
RUNTIME = "lab-class-"
#: The files of one run in a lab's folder, and the folder of the student's files.
RUN_FILES, HOME = ("output.txt", "caches"), "home"


class StoreError(Exception):
    """The folder of the class cannot be used; the text says why."""


@dataclass(frozen=True)
class ClassOptions:
    """How a class runs. ``launch``: the words after roslaunch, by default with 100 messages of the clock a second;
    ``idle_s``: None means never; ``keep_running``: labs do not wait for their first visitor paused; ``memory_bytes``,
    ``disk_bytes``: of each lab; ``at_once``: labs that start at a time; ``address``: of a server in front of the
    front door, without a slash at the end, or "".
    """

    launch: tuple = ("baxter_gazebo", "baxter_world.launch", "gui:=false", "clock_rate:=100")
    port: int = 8100
    public: bool = False
    trusted: bool = False
    idle_s: float | None = 900.0
    keep_running: bool = False
    memory_bytes: int = 2 << 30
    disk_bytes: int = 1 << 30
    at_once: int = 1
    address: str = ""

    @property
    def prefix(self) -> str:
        """The common prefix of all addresses' paths: the path of ``address``, mostly ""."""
        return urlsplit(self.address).path


@dataclass(frozen=True)
class Tokens:
    """Of one lab: for its student, and for those that watch."""

    act: str
    view: str


@dataclass(frozen=True)
class ClassRecord:
    """The content of class.json: options, students, tokens by name, the instructor's token."""

    options: ClassOptions
    students: tuple
    tokens: dict
    instructor: str

    @staticmethod
    def made(options: ClassOptions, students: Sequence[Student], earlier: ClassRecord | None = None) -> ClassRecord:
        """A record for these students; those of an ``earlier`` one keep their tokens."""
        known = earlier.tokens if earlier else {}
        tokens = {student.name: known.get(student.name) or Tokens(_token(), _token()) for student in students}
        return ClassRecord(options, tuple(students), tokens, earlier.instructor if earlier else _token())

    def renewed(self, name: str) -> ClassRecord:
        """This record with new tokens for one student, or for INSTRUCTOR. Raises ClassError."""
        if name == INSTRUCTOR:
            return replace(self, instructor=_token())
        if name not in self.tokens:
            raise ClassError("there is no lab %s; there are: %s" % (name, ", ".join(self.tokens)))
        return replace(self, tokens={**self.tokens, name: Tokens(_token(), _token())})


def _token() -> str:
    return secrets.token_urlsafe(18)


def default_folder() -> str:
    """Where a class is kept: $XDG_STATE_HOME/baxter_labs, by default ~/.local/state/baxter_labs."""
    base = os.environ.get("XDG_STATE_HOME") or os.path.join(os.path.expanduser("~"), ".local", "state")
    return os.path.join(base, "baxter_labs")


class Store:
    """The folder of a class; readable by its owner alone."""

    def __init__(self, folder: Path | str) -> None:
        self.folder = Path(folder).absolute()

    def command(self, words: str) -> str:
        """The command line of these words for this class."""
        is_usual = self.folder == Path(default_folder()).absolute()
        return "./baxter.sh labs %s%s" % ("" if is_usual else "--folder %s " % shlex.quote(str(self.folder)), words)

    def make(self) -> None:
        """Make the folder. Raises StoreError."""
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            self.folder.chmod(0o700)
        except OSError as error:
            raise StoreError("%s cannot be the folder of the class: %s" % (self.folder, error.strerror)) from error

    @contextlib.contextmanager
    def locked(self) -> Iterator[None]:
        """Held by the one supervisor of this folder. Raises StoreError where another one runs."""
        with open(self.folder / _LOCK, "w", encoding="ascii") as stream:
            try:
                fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                raise StoreError("a class runs in %s already; %s ends it"
                                 % (self.folder, self.command("down"))) from None
            yield

    def read(self) -> ClassRecord | None:
        """The ClassRecord, or None where there is none. Raises StoreError for a broken file."""
        try:
            data = (self.folder / _CLASS).read_bytes()
        except FileNotFoundError:
            return None
        try:
            found = json.loads(data.decode("utf-8"))
            names = {one.name for one in fields(ClassOptions)}
            options = {name: value for name, value in found["options"].items() if name in names}
            options["launch"] = tuple(options["launch"])
            return ClassRecord(ClassOptions(**options), tuple(Student(*row) for row in found["students"]),
                               {name: Tokens(*pair) for name, pair in found["tokens"].items()}, found["instructor"])
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise StoreError("%s is not the record of a class (%s: %s); remove it to begin again, which gives the "
                             "students new addresses" % (self.folder / _CLASS, type(error).__name__, error)) from error

    def write(self, record: ClassRecord) -> None:
        """Keep a ClassRecord. Raises StoreError."""
        self._write(_CLASS, {"options": asdict(record.options), "students": [list(row) for row in record.students],
                             "tokens": {name: [pair.act, pair.view] for name, pair in record.tokens.items()},
                             "instructor": record.instructor})

    def running(self) -> dict[str, Any]:
        """The content that the supervisor wrote by `write_running`, or {}; also where a host that lost power has kept
        only a part of it."""
        try:
            found = json.loads((self.folder / _RUNNING).read_text(encoding="utf-8"))
        except (FileNotFoundError, ValueError):
            return {}
        return found if isinstance(found, dict) else {}

    def write_running(self, values: dict[str, Any]) -> None:
        """Keep what other commands need to know of the supervisor. Raises StoreError."""
        self._write(_RUNNING, values)

    def _write(self, name: str, values: dict[str, Any]) -> None:
        # Whole or not at all, also where the host loses power.
        temporary = self.folder / (name + _NEW)
        try:
            with open(temporary, "w", encoding="utf-8") as stream:
                os.fchmod(stream.fileno(), 0o600)
                json.dump(values, stream, indent=1)
                stream.flush()
                os.fsync(stream.fileno())
            temporary.replace(self.folder / name)
        except OSError as error:
            with contextlib.suppress(OSError):
                temporary.unlink()
            raise StoreError("%s cannot be written: %s" % (self.folder / name, error.strerror or error)) from error

    def lab(self, name: str) -> Path:
        """The folder of one lab; made where it is missing."""
        folder = self.folder / "labs" / name
        (folder / HOME).mkdir(parents=True, exist_ok=True)
        return folder

    def remove_run(self) -> None:
        """Remove what one run leaves; the students' files, the roster and the tokens stay."""
        for name in (_RUNNING, _LOCK, _CLASS + _NEW, _RUNNING + _NEW):
            (self.folder / name).unlink(missing_ok=True)
        for folder in self.folder.glob("labs/*"):
            for name in RUN_FILES:
                path = folder / name
                remove(path)
