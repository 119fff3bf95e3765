# SPDX-License-Identifier: BSD-3-Clause
"""Target joint values of a group. No ROS needed; angles in rad, lengths in m."""
from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from command_line.options import counted
from motion_planning.model import ModelError

from .exception import MoveItCommanderException

if TYPE_CHECKING:
    from numpy.random import Generator

    from motion_planning.model import Group, PlanningModel


class JointValueTarget:
    """Values for every variable of a model, of which those of one group are the target.

    It starts at the model's default state: every joint at 0, or in the middle of its limits if 0 is beyond them.
    Every setter raises MoveItCommanderException, and changes nothing, for values that are beyond the limits by more
    than ``tolerance``, and for names and numbers of values that do not fit.
    """

    def __init__(self, model: PlanningModel, group: Group) -> None:
        self._model, self._group = model, group
        self._state = model.default_state()

    @property
    def q(self) -> np.ndarray:
        """The whole model's values (n,)."""
        return self._state.q

    def values(self) -> list[float]:
        """The group's values, in the order of its ``valued_joints``."""
        return values_of(self._model, self._group, self._state.q)

    def moved(self) -> list[float]:
        """The values of the group's ``joints``, those that can be moved."""
        return self._state.q[self._group.indices].tolist()

    def set_values(self, values: Sequence[float] | np.ndarray, tolerance: float) -> None:
        """Set all values of the group, given in the order of its ``valued_joints``, or of its ``joints``."""
        names, values = self._group.valued_joints, [float(value) for value in values]
        if len(values) != len(names):
            names = self._group.joints
        if len(values) != len(names):
            raise MoveItCommanderException("group '%s' has %s (%s), got %s" % (
                self._group.name, counted(len(self._group.valued_joints), "joint"),
                ", ".join(self._group.valued_joints), counted(len(values), "value")))
        self.set_by_name(dict(zip(names, values, strict=True)), tolerance)

    def set_by_name(self, values: Mapping[str, float], tolerance: float) -> None:
        """Set the values, {joint: value}, of some of the group's joints; the others stay as they are.

        The values of joints that mimic others are ignored: they follow.
        """
        known = self._group.valued_joints
        foreign = [name for name in values if name not in known]
        if foreign:
            raise MoveItCommanderException("group '%s' has no joint %s; its joints are %s" % (
                self._group.name, ", ".join("'%s'" % name for name in foreign), ", ".join(known)))
        self._set({name: value for name, value in values.items() if name in self._group.joints}, tolerance)

    def set_robot(self, values: Mapping[str, float], tolerance: float) -> None:
        """Set the values, {joint: value}, of any joints of the robot; fixed and mimic joints are ignored."""
        known = self._model.robot.joints
        unknown = [name for name in values if name not in known]
        if unknown:
            raise MoveItCommanderException("the robot has no joint %s" % ", ".join("'%s'" % name for name in unknown))
        self._set({name: value for name, value in values.items() if name in self._model.variables}, tolerance)

    def _set(self, values: Mapping[str, float], tolerance: float) -> None:
        try:
            state = self._state.with_joints({name: float(value) for name, value in values.items()})
        except ModelError as error:
            raise MoveItCommanderException(str(error)) from None
        self.check(state.q, tolerance)
        self._state = state

    def check(self, q: np.ndarray, tolerance: float) -> None:
        """Raise MoveItCommanderException where the group's part of ``q`` (n,) is beyond the limits."""
        beyond = self._model.beyond_limits(q, tolerance, self._group.indices)
        if beyond:
            raise MoveItCommanderException("Error setting joint target. Is it within bounds? " + "; ".join(
                "%s = %g, limits are %g to %g" % one for one in beyond))


def values_of(model: PlanningModel, group: Group, q: np.ndarray) -> list[float]:
    """Return the values of the group's ``valued_joints`` at ``q`` (n,), as a list."""
    values = model.joint_values(q)
    return [values[name] for name in group.valued_joints]


def with_followers(model: PlanningModel, group: Group, values: Mapping[str, float]) -> dict[str, float]:
    """Return ``values``, {joint: value}, with those of the group's joints that mimic them."""
    followers = {name: model.mimics[name] for name in group.valued_joints if name in model.mimics}
    return {**values, **{name: multiplier * values[source] + offset
                         for name, (source, multiplier, offset) in followers.items() if source in values}}


def random_values(model: PlanningModel, group: Group, generator: Generator) -> np.ndarray:
    """Return values (k,) of the group's ``joints`` within the limits, evenly spread.

    ``generator``: numpy.random.Generator. Raises MoveItCommanderException for joints without limits.
    """
    low, high = model.bounds[group.indices].T
    if not np.isfinite(low).all() or not np.isfinite(high).all():
        raise MoveItCommanderException("group '%s' has joints without limits" % group.name)
    return generator.uniform(low, high)


def within_limits(model: PlanningModel, q: np.ndarray) -> np.ndarray:
    """Return ``q`` (n,) with every joint inside its limits; continuous joints are wrapped to -pi to pi."""
    q = model.wrapped(q)
    return np.where(model.continuous, q, np.clip(q, model.bounds[:, 0], model.bounds[:, 1]))


def jacobian(group: Group, values: Sequence[float], reference_point: Sequence[float]) -> np.ndarray:
    """Return the Jacobian (6, k) of a point of the group's tip, velocity [m/s] above angular velocity [rad/s].

    Both in the frame of the link that the group's chain begins at. ``reference_point`` (3,): in the tip's frame [m].
    Raises MoveItCommanderException for a group that is not a chain.
    """
    if group.chain is None:
        raise MoveItCommanderException("group '%s' is not a chain of joints; it has no Jacobian" % group.name)
    pose, matrix = group.chain.fk_and_jacobian(values)
    shift = pose[:3, :3] @ np.asarray(reference_point, dtype=float)
    matrix = np.array(matrix)
    # v = v_tip + omega x shift
    matrix[:3] += np.cross(matrix[3:].T, shift).T
    return matrix
