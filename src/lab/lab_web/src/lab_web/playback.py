# SPDX-License-Identifier: BSD-3-Clause
"""Recordings of the arms and their playback, in the format of joint_recorder. No ROS."""
from __future__ import annotations

import io
import threading
from typing import TYPE_CHECKING

from baxter_examples.recording import COLUMNS, BadRecording, Recording, parse, write_row
from lab_web.lab import RobotError
from lab_web.motion import LEAD_RAD, MotionError, PageMotion, check_not_lost

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from typing import Any

    from lab_web.lab import PageLab
    from lab_web.motion import PageJointLimits

#: The longest recording [s].
LONGEST_S = 600.0
# A measured angle may lie this far outside of its limits [rad].
_NOISE_RAD = 0.02
# A speed limit is kept within rounding.
_ROUNDED = 1.0 + 1e-6


class Tape(Recording):
    """A recording that knows its extremes: {name: ((least value, time [s]), (largest, time))}. To make one may take a
    moment; to play it then takes none.
    """

    def __init__(self, names: list[str], times_s: list[float], rows: list[dict[str, float]]) -> None:
        super().__init__(names, times_s, rows)
        self.extremes = {name: (min(values), max(values)) for name in names
                         for values in [[(row[name], time_s) for time_s, row in zip(times_s, rows, strict=True)]]}


class MotionRecorder:
    """One recording for all pages; for any thread. ``changed({"running", "seconds"})``: seconds [s] of what is kept,
    None where there is nothing.
    """

    def __init__(self, changed: Callable[[dict[str, Any]], object]) -> None:
        self._changed = changed
        self._lock = threading.Lock()
        self._rows = None
        #: The last :class:`Tape`, or None.
        self.recording = None

    @property
    def is_running(self) -> bool:
        """Whether a recording is under way."""
        return self._rows is not None

    def record(self, _client: int, operation: dict[str, Any]) -> None:
        """An operation "record" of a page: ``on``, begin or end. Raises RobotError."""
        with self._lock:
            if operation.get("on") is True:
                if self._rows is None:
                    self._rows = []
            elif self._rows is None:
                raise RobotError("nothing is being recorded")
            else:
                self._end()
        self._tell()

    def take(self, time_s: float, values: Mapping[str, float]) -> None:
        """The robot at a time [s]: {joint: [rad], SIDE_gripper: [%]}."""
        rows = self._rows
        if rows is None:
            return
        with self._lock:
            if rows and time_s < rows[-1][0]:
                # The simulation was reset.
                rows.clear()
            if not rows or time_s > rows[-1][0]:
                rows.append((time_s, {name: float(values.get(name, 0.0)) for name in COLUMNS[1:]}))
            if self._rows is None or time_s - rows[0][0] < LONGEST_S:
                return
            self._end()
        self._tell()

    def load(self, _client: int, operation: dict[str, Any]) -> None:
        """An operation "load" of a page, by an upload: ``content``, a Tape. Raises RobotError."""
        recording = operation.get("content")
        if not isinstance(recording, Tape):
            raise RobotError("a recording is loaded by an upload of its file")
        self.keep(recording)

    def keep(self, recording: Tape) -> None:
        """Make this the recording; ends one that is under way."""
        with self._lock:
            self._rows, self.recording = None, recording
        self._tell()

    def _end(self) -> None:
        rows, self._rows = self._rows, None
        if rows:
            begin_s = rows[0][0]
            self.recording = Tape(COLUMNS[1:], [time_s - begin_s for time_s, _ in rows], [row for _, row in rows])

    def _tell(self) -> None:
        kept = self.recording
        self._changed({"running": self._rows is not None, "seconds": kept and round(kept.duration_s, 2)})


def text_of(recording: Recording) -> str:
    """The file of a recording."""
    stream = io.StringIO()
    write_row(stream, ["time", *recording.names])
    for time_s, row in zip(recording.times_s, recording.rows, strict=True):
        write_row(stream, [time_s, *(row[name] for name in recording.names)])
    return stream.getvalue()


def recording_of(content: bytes) -> Tape:
    """The Tape in the bytes of a file. Raises MotionError."""
    try:
        found = parse(io.StringIO(content.decode(), newline=""), "the recording")
    except (BadRecording, UnicodeDecodeError) as error:
        raise MotionError(str(error)) from None
    return Tape(found.names, found.times_s, found.rows)


class RecordingPlayback:
    """First to the recording's start, slowly, then as recorded; slower where a joint would exceed its speed limit.

    Used as a :class:`lab_web.motion.PageMotion`; values of grippers come out as they are.
    """

    def __init__(self, limits: Mapping[str, PageJointLimits], recording: Tape, measured: Mapping[str, float]) -> None:
        """Raises MotionError for a recording that leaves the limits."""
        self.limits = dict(limits)
        self._recording = recording
        self._joints = [name for name in recording.names if name in limits]
        for joint in self._joints:
            lower, upper, _ = limits[joint]
            for value, time_s in recording.extremes[joint]:
                if not lower - _NOISE_RAD <= value <= upper + _NOISE_RAD:
                    raise MotionError("the recording has %s at %.4f rad at %.2f s; %.4f to %.4f is possible"
                                      % (joint, value, time_s, lower, upper))
        self._time_s = recording.times_s[0]
        self._now = self._at(self._time_s)
        self._approach = PageMotion(limits)
        self._approach.aim({joint: self._now[joint] for joint in self._joints}, measured)
        self.is_moving = True

    def stop(self) -> bool:
        """End; returns whether it was under way."""
        moved, self.is_moving = self.is_moving, False
        return moved

    def step(self, dt: float, measured: Mapping[str, float]) -> dict[str, float]:
        """The set-points {name: [rad or %]} after ``dt`` [s]. Raises MotionError where something else has moved a
        joint.
        """
        if self._approach.is_moving:
            return self._approach.step(dt, measured)
        check_not_lost({joint: self._now[joint] for joint in self._joints}, measured)
        if all(joint in measured and abs(self._now[joint] - measured[joint]) <= LEAD_RAD for joint in self._joints):
            self._advance(min(dt, self._recording.duration_s - self._time_s), dt)
        if self._time_s >= self._recording.duration_s:
            self.is_moving = False
        return dict(self._now)

    def _advance(self, step_s: float, dt: float) -> None:
        """Go on in the recording by ``step_s`` [s], or by less where a joint would exceed its speed limit in ``dt``."""
        while step_s > 0.0:
            after = self._at(self._time_s + step_s)
            excess = max([0.0, *(abs(after[joint] - self._now[joint]) / (self.limits[joint].velocity * dt)
                                 for joint in self._joints)])
            if excess <= _ROUNDED:
                self._time_s += step_s
                self._now = after
                return
            step_s /= excess

    def _at(self, time_s: float) -> dict[str, float]:
        values = self._recording.at(time_s)
        for joint in self._joints:
            values[joint] = min(max(values[joint], self.limits[joint].lower), self.limits[joint].upper)
        return values


def play(lab: PageLab, client: int, recorder: MotionRecorder) -> None:
    """Play the recording for a page of a :class:`lab_web.lab.PageLab`. Raises RobotError, MotionError, NotInControl."""
    recording = recorder.recording
    if recording is None:
        raise RobotError("there is no recording; record one, or load a file of joint_recorder")
    lab.start(client, lambda limits, measured: RecordingPlayback(limits, recording, measured))
