# SPDX-License-Identifier: BSD-3-Clause
"""Demonstrations as plain data: the features of a frame, and episodes of frames at a fixed rate."""
from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

#: Keys of features that every set has.
STATE, ENVIRONMENT, ACTION, EXPERT_ACTION = (
    "observation.state", "observation.environment_state", "action", "expert.action")
PICTURES = "observation.images."
REWARD, DONE, SUCCESS = "next.reward", "next.done", "next.success"
#: Marks of whoever steers: the episode that was just shown is kept as done, kept as failed, or thrown away.
MARKS = ("success", "failure", "again")
PICTURE_NAMES = ("height", "width", "channels")
_NUMBERS = ("float32", "float64", "int64", "bool")
_KEY = re.compile(r"[A-Za-z0-9_]+(\.[A-Za-z0-9_]+)*")
MAX_RATE_HZ = 1000


class DemonstrationError(Exception):
    """A set of demonstrations, or a frame of one, is not as it must be; the text says what was found."""


@dataclass(frozen=True)
class Feature:
    """One entry of a frame: dtype float32, float64, int64, bool or "video"; shape (n,), or (height, width, 3) of a
    picture; names of its numbers, and their units ("" where they have none)."""

    dtype: str
    shape: tuple[int, ...]
    names: tuple[str, ...] | None = None
    units: tuple[str, ...] | None = None

    @property
    def is_picture(self) -> bool:
        """Whether it is a picture, uint8."""
        return self.dtype == "video"


def numbers(names: Sequence[tuple[str, str]], dtype: str = "float32") -> Feature:
    """The feature of numbers with these (name, unit)."""
    return Feature(dtype, (len(names),), tuple(name for name, _ in names), tuple(unit for _, unit in names))


def picture(height: int, width: int) -> Feature:
    """The feature of a colour picture."""
    return Feature("video", (height, width, 3), PICTURE_NAMES)


#: Keys of `Schema.about` that are equal in all episodes of a set, beside the task: the conditions in the environment.
CONDITIONS = ("profile", "randomised")


@dataclass(frozen=True)
class Schema:
    """rate_hz: frames a second, whole; features: {key: Feature}; robot: its type; about: what else describes the set,
    as JSON holds it, such as the task and the action's kind. Raises DemonstrationError."""

    rate_hz: int
    features: Mapping[str, Feature]
    robot: str = "baxter"
    about: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not (isinstance(self.rate_hz, int) and 0 < self.rate_hz <= MAX_RATE_HZ):
            raise DemonstrationError("the rate is a whole number from 1 to %d Hz; found %r"
                                     % (MAX_RATE_HZ, self.rate_hz))
        if ACTION not in self.features:
            raise DemonstrationError("a set needs the feature %r; found %s"
                                     % (ACTION, ", ".join(self.features) or "none"))
        for key, feature in self.features.items():
            _check_feature(key, feature)

    @property
    def cameras(self) -> list[str]:
        """Keys of the pictures."""
        return [key for key, feature in self.features.items() if feature.is_picture]

    def checked(self, frame: Mapping[str, Any]) -> dict[str, np.ndarray]:
        """The frame's entries as arrays of the features' types and shapes. Raises DemonstrationError for missing and
        unknown keys, other shapes, and numbers that are not finite."""
        if frame.keys() != self.features.keys():
            raise DemonstrationError("a frame has exactly %s; found %s" % (
                ", ".join(self.features), ", ".join(frame) or "nothing"))
        return {key: _checked(key, self.features[key], value) for key, value in frame.items()}


def _check_feature(key, feature):
    if not _KEY.fullmatch(key):
        raise DemonstrationError("a feature's key is words of letters, digits and _ with dots between; found %r" % key)
    if ("image" in key) != feature.is_picture:
        raise DemonstrationError("%r: keys with \"image\", and they alone, are pictures" % key)
    if feature.is_picture:
        good = len(feature.shape) == 3 and feature.shape[2] == 3
        # The usual colour format of films shares colours among 2 x 2 pixels.
        good = good and all(side > 0 and side % 2 == 0 for side in feature.shape[:2])
        if not good:
            raise DemonstrationError("%r: pictures are (height, width, 3) with even sides; found %s"
                                     % (key, feature.shape))
    elif feature.dtype not in _NUMBERS or len(feature.shape) != 1 or feature.shape[0] < 1:
        raise DemonstrationError("%r: numbers are (n,) of %s; found %s of %s" % (
            key, ", ".join(_NUMBERS), feature.shape, feature.dtype))
    for texts in (feature.names, feature.units):
        if texts is not None and not feature.is_picture and len(texts) != feature.shape[0]:
            raise DemonstrationError("%r: %d names or units for %d numbers" % (key, len(texts), feature.shape[0]))


def _checked(key, feature, value):
    try:
        found = np.asarray(value)
        array = found if feature.is_picture else found.astype(feature.dtype)
    except (TypeError, ValueError):
        raise DemonstrationError("%r: %.60r is no array of numbers" % (key, value)) from None
    if array.shape == () and feature.shape == (1,):
        array = array.reshape(1)
    if array.shape != feature.shape or (feature.is_picture and array.dtype != np.uint8):
        raise DemonstrationError("%r: a frame has %s of %s; found %s of %s" % (
            key, feature.shape, "uint8" if feature.is_picture else feature.dtype, found.shape, found.dtype))
    if array.dtype.kind == "f" and not np.isfinite(array).all():
        raise DemonstrationError("%r: numbers must be finite; found %s" % (key, found))
    return array


@dataclass
class Episode:
    """One demonstration. task: as a sentence; columns: {key: (frames, n)} of all features that are no pictures; seed:
    that it began by, or None; success: whether it was."""

    task: str
    columns: dict[str, np.ndarray]
    success: bool
    seed: int | None = None

    def __len__(self) -> int:
        return len(self.columns[ACTION])
