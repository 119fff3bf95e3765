# SPDX-License-Identifier: BSD-3-Clause
"""Effects of a physical robot beyond ideal drives: which are switched on, and their numbers.

The numbers stand in config/physical_robot.yaml, each with its source.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import yaml

from model_files.packages import find_packages
from urdf_model import bounds, read_text

from .errors import BaxterHardwareError

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

NAMES = ("lag", "noise", "safety", "delay", "states", "uncalibrated")
#: Sections of the file: those of the effects; "senses", of the effect "noise" beside the joints; "body", of the effect
#: "safety"; "serial", how robots differ.
SECTIONS = (*NAMES, "senses", "body", "serial")
ALL, NONE = "all", "none"


def physical_robot() -> Path:
    """Path of the numbers."""
    return Path(find_packages().get_path("baxter_sim_hardware")) / "config" / "physical_robot.yaml"


def chosen(words: str) -> set[str]:
    """The set of effects that a text such as "lag,noise", "all" or "none" names. Raises BaxterHardwareError."""
    if not isinstance(words, str):
        raise BaxterHardwareError("effects is %r; it must be a text such as 'lag,noise', 'all' or 'none'" % (words,))
    names = {word.strip() for word in words.split(",")} - {"", NONE}
    if ALL in names:
        return set(NAMES)
    unknown = sorted(names - set(NAMES))
    if unknown:
        raise BaxterHardwareError("effects has %s; there are %s, %s and %s" % (
            ", ".join(map(repr, unknown)), ", ".join(NAMES), ALL, NONE))
    return names


def read(path: str | Path) -> dict[str, dict[str, dict[str, float]]]:
    """{section: {number: {name: value}}} of a YAML file, by names of joints and others.

    Raises BaxterHardwareError for what is missing or no number.
    """
    try:
        table = yaml.safe_load(read_text(path, bounds.DESCRIPTION_BYTES))
    except (OSError, ValueError, yaml.YAMLError) as error:
        raise BaxterHardwareError("%s cannot be read: %s" % (path, error)) from error
    found = {}
    for effect in SECTIONS:
        rows = table.get(effect) if isinstance(table, dict) else None
        if not isinstance(rows, dict):
            raise BaxterHardwareError("%s has no section '%s'" % (path, effect))
        found[effect] = {}
        for number, row in rows.items():
            values = row.get("values") if isinstance(row, dict) else None
            if not isinstance(values, dict) or not all(
                    isinstance(value, (int, float)) and np.isfinite(value) for value in values.values()):
                raise BaxterHardwareError("%s: %s.%s must have 'values' with a finite number for each name"
                                          % (path, effect, number))
            found[effect][number] = values
    return found


def row(rows: Mapping[str, Mapping[str, float]], number: str) -> Mapping[str, float]:
    """{name: value} of `number`. Raises BaxterHardwareError where it is missing."""
    try:
        return rows[number]
    except KeyError:
        raise BaxterHardwareError("there is no '%s' among %s" % (number, ", ".join(sorted(rows)))) from None


def positive(rows: Mapping[str, Mapping[str, float]], number: str, name: str) -> float:
    """The value of `number` for `name`. Raises BaxterHardwareError for what is missing or not greater than 0."""
    value = row(rows, number).get(name)
    if value is None or value <= 0.0:
        raise BaxterHardwareError("'%s' of %s is %s; it must be greater than 0" % (number, name, value))
    return float(value)


def per_joint(rows: Mapping[str, Mapping[str, float]], number: str, names: Iterable[str]) -> np.ndarray:
    """(n,) the value of `number` for the joints `names`, such as left_s0: that of the joint itself, or else that of s0.

    Raises BaxterHardwareError for what is missing.
    """
    values = row(rows, number)
    try:
        return np.array([values[name if name in values else name.rsplit("_", 1)[1]] for name in names], dtype=float)
    except (KeyError, IndexError) as error:
        raise BaxterHardwareError("'%s' has no value for joint %s" % (number, error)) from None
