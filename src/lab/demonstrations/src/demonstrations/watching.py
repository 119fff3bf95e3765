# SPDX-License-Identifier: BSD-3-Clause
"""From what a robot says, in whatever order and rates, to episodes of frames on an exact grid of time. Free of ROS.

The robot's own joint states are the clock: their stamps pass the instants of the grid, and each frame has what was
newest then. So a busy machine, or a recording that is read faster than it was made, loses no frame.
"""
from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from baxter_model import JOINTS, SIDES

from .frames import ACTION, ENVIRONMENT, MARKS, PICTURES, STATE, DemonstrationError, Feature, Schema, numbers, picture
from .writing import SetWriter

#: What `WatchingRecorder.take` takes: (14,) joints [rad], left before right; (14,) their set-points; of each side how
#: far its gripper is open and was told to be, 0 closed to 100 open.
JOINT_ANGLES, SET_POINTS, OPENING, TOLD = "joints", "set_points", "%s_opening", "%s_told"
#: A model's pose, (7,) place [m] and quaternion x y z w.
MODEL = "model %s"
#: Names and units of states and actions, as LeRobot's plugins have them.
NAMED = tuple(item for side in SIDES for item in (
    *(("%s_%s.pos" % (side, joint), "rad") for joint in JOINTS), ("%s_gripper.pos" % side, "%")))
#: The task of every set of a robot; its episodes have theirs in words.
ON_THE_ROBOT = "on the robot"
#: How the lines begin, or what they have, that tell that a recorder records, and that it has lost an episode.
RECORDING, LOST = "recording into ", " is dropped: "
#: The instants of the grid may come this much early [s]: stamps are rounded.
_EARLY_S = 1e-6
_POSE = (*(("%s.x", "m"), ("%s.y", "m"), ("%s.z", "m")), *((name, "") for name in ("%s.qx", "%s.qy", "%s.qz", "%s.qw")))


def schema_of(rate_hz: int, cameras: Mapping[str, tuple[int, int]], models: Sequence[str] = ()) -> Schema:
    """Frames of a robot. cameras: {name: (height, width)}; models: whose poses they have. Raises DemonstrationError."""
    features: dict[str, Feature] = {ACTION: numbers(NAMED), STATE: numbers(NAMED)}
    if models:
        features[ENVIRONMENT] = numbers([(name % model, unit) for model in models for name, unit in _POSE])
    features |= {PICTURES + name: picture(*size) for name, size in cameras.items()}
    return Schema(rate_hz, features, about={"task": ON_THE_ROBOT, "control": "positions"})


class WatchingRecorder:
    """Takes what a robot says, and writes episodes; a mark ends one, and the next begins. writer: of a set with
    `schema_of`; task: in words; seen_s: age of what a frame has at most [s]; say: hears what is kept, dropped, and
    waited for."""

    def __init__(self, writer: SetWriter, task: str, seen_s: float = 0.5, say: Callable[[str], None] = print):
        self._writer, self._task, self._seen_s, self._say = writer, task, seen_s, say
        schema = writer.schema
        self._cameras = [key.removeprefix(PICTURES) for key in schema.cameras]
        names = schema.features[ENVIRONMENT].names if ENVIRONMENT in schema.features else ()
        self._models = list(dict.fromkeys(name.rpartition(".")[0] for name in names or ()))
        self._needed = [JOINT_ANGLES, SET_POINTS, *(OPENING % side for side in SIDES), *self._cameras,
                        *(MODEL % name for name in self._models)]
        self._values: dict[str, Any] = {}
        self._came: dict[str, float] = {}
        self._now: float | None = None
        self._begin()

    def _begin(self) -> None:
        self._start: float | None = None
        self._waits = ""

    @property
    def length(self) -> int:
        """Frames of the present episode."""
        return self._writer.length

    @property
    def waits(self) -> str:
        """The condition that the episode waits for, "" while it is recorded."""
        return self._waits

    def take(self, key: str, value: Any, stamp: float | None = None) -> None:
        """Something new. stamp: of JOINT_ANGLES, in the robot's time [s]. Raises DemonstrationError for what is not as
        the set's frames are, OSError where the disk refuses it."""
        if key == JOINT_ANGLES:
            if stamp is None:
                raise DemonstrationError("joint states have a stamp")
            self._pass(stamp)
        if self._now is not None:
            self._values[key], self._came[key] = value, self._now

    def _pass(self, stamp: float) -> None:
        """Write the frames whose instants are before `stamp`."""
        before, self._now = self._now, stamp
        if before is None:
            return
        if stamp < before:
            self._lose("time went back from %.3f s to %.3f s" % (before, stamp))
            self._came.clear()
        elif stamp - before > self._seen_s:
            self._lose("there were no joint states for %.2f s" % (stamp - before))
        elif missing := self._missing():
            self._lose("no news of %s for %g s" % (", ".join(missing), self._seen_s))
            self._waits = "waiting for %s" % ", ".join(missing)
        else:
            if self._start is None:
                self._start, self._waits = before, ""
            while self._start + self._writer.length / self._writer.schema.rate_hz < stamp - _EARLY_S:
                self._writer.frame(self._frame())

    def _missing(self) -> list[str]:
        now = self._now or 0.0
        return [key for key in self._needed if now - self._came.get(key, -np.inf) > self._seen_s]

    def _lose(self, why: str) -> None:
        if self._writer.length:
            self._say("an episode of %d frames%s%s; the next one begins" % (self._writer.length, LOST, why))
        self._writer.drop()
        self._begin()

    def _frame(self) -> dict[str, Any]:
        values = self._values

        def joined(joints, openings):
            parts = np.split(np.asarray(joints, dtype=float), len(SIDES))
            return np.concatenate([[*part, opening] for part, opening in zip(parts, openings, strict=True)])

        openings = [values[OPENING % side] for side in SIDES]
        told = [values.get(TOLD % side, opening) for side, opening in zip(SIDES, openings, strict=True)]
        frame: dict[str, Any] = {STATE: joined(values[JOINT_ANGLES], openings),
                                 ACTION: joined(values[SET_POINTS], told)}
        if self._models:
            frame[ENVIRONMENT] = np.concatenate([values[MODEL % name] for name in self._models])
        return frame | {PICTURES + camera: values[camera] for camera in self._cameras}

    def mark(self, what: str) -> None:
        """One of MARKS: the episode is kept as a success or as a failure, or is thrown away. Raises DemonstrationError
        where it cannot be kept; those before are."""
        if what not in MARKS:
            self._say("%r is no mark; marks are %s" % (what, ", ".join(MARKS)))
        elif what == "again" or not self._writer.length:
            self._say("%d frames that are marked neither success nor failure are thrown away"
                      % self._writer.length if self._writer.length else
                      "there is nothing to keep: %s" % (self._waits or "no frame yet"))
            self._writer.drop()
        else:
            length = self._writer.length
            number = self._writer.keep(self._task, what == "success")
            self._say("episode %d is kept as a %s: %d frames; the next one begins" % (number, what, length))
        self._begin()
