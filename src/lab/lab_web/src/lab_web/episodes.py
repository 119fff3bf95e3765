# SPDX-License-Identifier: BSD-3-Clause
"""Demonstrations that pages record: a LeRobot data set of this lab, its recorder, and its list of episodes. No ROS: the
recorder is a separate process.
"""
from __future__ import annotations

import io
import subprocess
import sys
import tempfile
import threading
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from demonstrations import editing, layout
from demonstrations.frames import MARKS, PICTURES, DemonstrationError
from demonstrations.watching import LOST, RECORDING
from lab_web.child import HeardChild
from lab_web.lab import RobotError
from processes import keeper

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from typing import Any, BinaryIO

    from lab_web.task_queue import TaskQueue

#: What the recorder may put into an episode beside the joints.
CAMERAS = ("head", "left_hand", "right_hand")
_LONGEST_TASK = 200
#: Pictures in a strip, and their height at most is twice this [pixels].
_PICTURES, _HEIGHT = 6, 48


class Process:
    """A command that runs until `end`, or until this process ends. said(line): gets its lines of text, in a thread;
    ended(): is called once it has ended. Raises OSError."""

    def __init__(self, command: Sequence[str], said: Callable[[str], object], ended: Callable[[], object]) -> None:
        self._runtime = tempfile.TemporaryDirectory(prefix="lab-episodes-")
        self._process = HeardChild(
            [sys.executable, keeper.__file__, str(Path(self._runtime.name) / "state"), *command], subprocess.STDOUT)
        self._thread = threading.Thread(target=self._follow, args=(said, ended))
        self._thread.start()

    def _follow(self, said: Callable[[str], object], ended: Callable[[], object]) -> None:
        with self._process.stdout as lines:
            for line in lines:
                said(line.decode("utf-8", "replace").strip())
        self._process.wait()
        self._runtime.cleanup()
        ended()

    def end(self) -> None:
        """Ask it to end; does not wait."""
        self._process.end()

    def join(self) -> None:
        """Wait until it has ended."""
        self._thread.join()


class Episodes:
    """folder: of the set, whose first episode decides on its camera; start(task, camera, said, ended): begins to record
    and returns what has `end` and `join`, camera "" for none; mark(what): tells the recorder one of MARKS, and raises
    RobotError; tasks: :class:`lab_web.task_queue.TaskQueue`; changed(state): tells all pages.
    """

    def __init__(self, folder: Path, start: Callable[[str, str, Callable[[str], object], Callable[[], object]], Any],
                 mark: Callable[[str], object], tasks: TaskQueue, changed: Callable[[dict[str, Any]], object]) -> None:
        self.folder = folder
        self._start, self._mark, self._tasks, self._changed = start, mark, tasks, changed
        self._lock = threading.Lock()
        self._recorder, self._said, self._version = None, "", 0
        self._is_asked_to_end = self._is_recording = self._is_bad = False
        self._list: dict[str, Any] = {"episodes": [], "camera": "", "rate": 0}
        self._look()
        self._share()

    def ask(self, client: int, operation: dict[str, Any]) -> None:
        """The operation "episodes" of a page: ``do``: start (with ``task``, ``camera``), stop, one of MARKS, or delete
        (with ``number``, and the ``version`` of the list that it is of: numbers move up). Raises RobotError."""
        do = operation.get("do")
        if do == "start":
            self._begin(*_checked(operation))
        elif do == "stop":
            with self._lock:
                recorder, self._is_asked_to_end = self._recorder, True
            if recorder is not None:
                recorder.end()
        elif isinstance(do, str) and do in MARKS:
            if not self._is_recording:
                raise RobotError("nothing is recorded %s" % (
                    "yet: the recorder starts" if self._recorder else "now; press the record button first"))
            self._mark(do)
        elif do == "delete":
            number, version = operation.get("number"), operation.get("version")
            if not isinstance(number, int) or not isinstance(version, int) or self._recorder is not None:
                raise RobotError("an episode is deleted by its number and its list's version, "
                                 "while nothing is recorded")
            self._tasks.add(client, self._delete, number, version)
        else:
            raise RobotError("%r is nothing to do with episodes" % (do,))

    def close(self) -> None:
        """End the recorder; an episode that has no mark yet is thrown away."""
        with self._lock:
            recorder, self._is_asked_to_end = self._recorder, True
        if recorder is not None:
            recorder.end()
            recorder.join()

    def picture(self, number: int) -> bytes:
        """The strip of an episode's film, a JPEG. Raises DemonstrationError."""
        from PIL import Image

        file = io.BytesIO()
        pixels = editing.strip(self.folder, number, self._list["camera"], _PICTURES, _HEIGHT)
        Image.fromarray(np.ascontiguousarray(pixels)).save(file, "JPEG", quality=80)
        return file.getvalue()

    def write_zip(self, file: BinaryIO) -> None:
        """The set as one file. Raises DemonstrationError, OSError."""
        editing.write_zip(self.folder, file)

    def _begin(self, task: str, camera: str) -> None:
        with self._lock:
            if self._recorder is not None:
                raise RobotError("an episode is being recorded")
            if self._list["episodes"]:
                camera = self._list["camera"].removeprefix(PICTURES)
            self._said, self._is_asked_to_end, self._is_recording, self._is_bad = "", False, False, False
            try:
                self._recorder = self._start(task, camera, self._hear, self._end)
            except OSError as error:
                raise RobotError("the recorder does not start: %s" % error) from error
        self._share()

    def _hear(self, line: str) -> None:
        if not line:
            return
        self._said, self._is_bad = line, LOST in line
        self._is_recording = self._is_recording or line.startswith(RECORDING)
        self._look()
        self._share()

    def _end(self) -> None:
        with self._lock:
            # It ends by itself only when something is wrong, which its last line says.
            self._recorder, self._is_recording, self._is_bad = None, False, not self._is_asked_to_end
        self._look()
        self._share()

    def _delete(self, number: int, version: int) -> None:
        try:
            # Another page, or a program, may have deleted one meanwhile: then this number is another episode's.
            self._look()
            if version != self._version:
                raise RobotError("the list of episodes has changed; nothing was deleted. Choose again")
            editing.delete(self.folder, number)
        except DemonstrationError as error:
            raise RobotError(str(error)) from error
        finally:
            self._look()
            self._share()

    def _look(self) -> None:
        """Read the list. A set that cannot be read is told, and has none."""
        found: dict[str, Any] = {"episodes": [], "camera": "", "rate": 0}
        if (self.folder / layout.INFO).exists():
            try:
                rows, cameras, rate = editing.listed(self.folder)
                found = {"episodes": [row._asdict() for row in rows], "camera": cameras[0] if cameras else "",
                         "rate": rate}
            except (DemonstrationError, OSError) as error:
                self._said, self._is_bad = str(error), True
        if found != self._list:
            # A browser that has a strip of an earlier list asks again.
            self._list, self._version = found, self._version + 1

    def _share(self) -> None:
        self._changed({"running": self._recorder is not None, "recording": self._is_recording,
                       "bad": self._is_bad, "said": self._said, "version": self._version,
                       "folder": str(self.folder), **self._list})


def _checked(operation: dict[str, Any]) -> tuple[str, str]:
    """(task, camera) of a page. Raises RobotError."""
    task, camera = operation.get("task"), operation.get("camera", "")
    if not isinstance(task, str) or not task.strip() or len(task) > _LONGEST_TASK or not task.isprintable():
        raise RobotError("say in a few words what is shown, such as: Pick up the block.")
    if camera and camera not in CAMERAS:
        raise RobotError("there is no camera %r; there are %s" % (camera, ", ".join(CAMERAS)))
    return task.strip(), camera


def command(folder: Path, task: str, camera: str) -> list[str]:
    """The recorder's command line."""
    return ["rosrun", "demonstrations", "record", str(folder), "--task=" + task,
            *(["--cameras", camera] if camera else ())]


def of_workspace(workspace: Path, mark: Callable[[str], object], tasks: TaskQueue,
                 changed: Callable[[dict[str, Any]], object]) -> Episodes:
    """The episodes in a workspace, or, beside an install space, in the user's own folder; as for `Episodes`."""
    folder = (workspace / ".baxter" if (workspace / "src").is_dir() else Path.home() / "baxter_lab") / "episodes"

    def start(task: str, camera: str, said: Callable[[str], object], ended: Callable[[], object]) -> Process:
        return Process(command(folder, task, camera), said, ended)

    return Episodes(folder, start, mark, tasks, changed)
