# SPDX-License-Identifier: BSD-3-Clause
"""After each step, restores models with an impossible state, before anything reads it."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from urdf_model import bounds

from .errors import BulletSimError, within

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    import numpy as np

    from .body import Body
    from .model import Model
    from .world import World

# Bounds of what Model.read_joints returns. Efforts only need to be finite.
_OF_JOINTS = (
    bounds.JOINT_POSITION,
    bounds.TURN_RATE,
    bounds.Bound(-1e100, 1e100, "N or N m", "what a drive has given, which is bounded by itself"),
)

# Fewest steps between two log lines about one model.
_QUIET_STEPS = 5000
# A body without joints that has not moved for this many steps is asleep and is checked only in every fiftieth step.
# That is enough: when a NaN is found, all bodies are checked in the same step.
_ASLEEP_STEPS = 50
_TURNS = 50


class ImpossibleState(NamedTuple):
    """An impossible state."""

    text: str  # which value is out of its bound
    is_finite: bool


def out_of_bounds(roots: Mapping[str, tuple], joint_names: Iterable[str], readings: Iterable[np.ndarray]) -> str:
    """Return which value of a model is out of its bound, or "".

    roots: {link: (position (3,), quaternion (4,))}; readings: position, velocity and effort of the joints
    ``joint_names``, (n,) each.
    """
    try:
        for root, base in roots.items():
            within(bounds.POSITION, base[0], "the position of link '%s'" % root)
            within(bounds.POSITION, base[1], "the orientation of link '%s'" % root)
        for values, bound, what in zip(readings, _OF_JOINTS, ("position", "velocity", "effort"), strict=True):
            for name, value in zip(joint_names, values.tolist(), strict=True):
                within(bound, value, "the %s of joint '%s'" % (what, name))
    except BulletSimError as error:
        return str(error)
    return ""


class StateWatch:
    """Checks the models of a World after each step.

    A force, mass or inertia that Bullet cannot compute with gives NaN, which spreads to what is touched. One NaN in
    Bullet's search tree of boxes also stops all collisions in the world, even after all states are restored; so all
    bodies are then rebuilt. This takes some ms per robot.
    """

    def __init__(self, world: World, error: Callable[[str], None]) -> None:
        self._world = world
        self._error = error
        self._logged_at = {}  # model's name -> steps
        self._lively, self._resting = [], []
        self._sorted = False
        self._turn = 0

    def models_changed(self) -> None:
        """A model was added or removed."""
        self._sorted = False

    def note_touched(self, model: Body) -> None:
        """A force or a new state was applied to ``model``."""
        if model.still_for >= _ASLEEP_STEPS:
            model.still_for = 0
            self._sorted = False

    def look(self) -> None:
        """Restore every model with an impossible state to its state before the step, at rest, and log it."""
        if not self._sorted:
            self._sort()
        faulty = False
        for model in self._lively:
            faulty |= model.fault() is not None
            if model.still_for == _ASLEEP_STEPS and not _is_never_still(model):
                self._sorted = False
        self._turn = (self._turn + 1) % _TURNS
        for model in self._resting[self._turn::_TURNS]:
            faulty |= model.fault() is not None
            if model.still_for == 0:
                self._sorted = False
        if faulty:
            self._put_back()

    def _sort(self) -> None:
        moving = [model for model in self._world.models.values() if model.free or model.joint_names]
        self._lively = [model for model in moving if _is_never_still(model) or model.still_for < _ASLEEP_STEPS]
        self._resting = [model for model in moving if model not in self._lively]
        self._sorted = True

    def _put_back(self) -> None:
        world = self._world
        found = {model: model.fault() for model in (*self._lively, *self._resting)}
        faults = {model: fault for model, fault in found.items() if fault is not None}
        if all(fault.is_finite for fault in faults.values()):
            for model in faults:
                model.put_back()
        else:
            world.rebuild(list(world.models.values()), {model: model.last_good() for model in faults})
        for model, fault in faults.items():
            told = self._logged_at.get(model.name)
            if told is None or world.steps - told >= _QUIET_STEPS:
                self._logged_at[model.name] = world.steps
                self._error(
                    "model '%s': %s, at tick %d. It was put back to where it was before, at rest; look for an extreme "
                    "force, mass or inertia" % (model.name, fault.text, world.tick)
                )


def _is_never_still(model: Model) -> bool:
    """Whether the watch does not know it from the base alone when a model rests."""
    return bool(model.joint_names or model.loose)
