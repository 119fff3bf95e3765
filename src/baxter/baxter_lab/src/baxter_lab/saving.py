# SPDX-License-Identifier: BSD-3-Clause
"""The state of a whole lab, to return to it as often as needed: physics, control logic, chance, time."""
from __future__ import annotations

import weakref
from collections.abc import Callable
from typing import TYPE_CHECKING, NoReturn

import numpy as np

from bullet_sim.quiet_pybullet import pybullet

from .errors import LabError

if TYPE_CHECKING:
    from .lab import Lab

_LOGIC = ("baxter_sim_hardware", "sim_time")
_OF_MODEL = ("_good", "still_for", "_any_effort_driven")
_OF_WORLD = ("tick", "steps", "_step_since")


def restorer(found: object, seen: dict | None = None) -> Callable[[], object]:
    """A function that gives an object, and all that it holds of the control logic, its present state again, in place,
    and returns it. Other things, such as the physics and names, are left alone."""
    seen = {} if seen is None else seen
    if id(found) in seen:
        return seen[id(found)][1]
    seen[id(found)] = found, lambda: found  # for a circle
    restore = _restorer_of(found, seen)
    seen[id(found)] = found, restore
    return restore


def _restorer_of(found, seen):
    if isinstance(found, np.ndarray) and found.flags.writeable:
        values = found.copy()
        return lambda: _written(found, values)
    if isinstance(found, np.random.Generator):
        state = found.bit_generator.state
        return lambda: setattr(found.bit_generator, "state", state) or found
    if isinstance(found, (list, tuple)):
        parts = [restorer(part, seen) for part in found]
        if isinstance(found, tuple):
            return lambda: [part() for part in parts] and found or found
        return lambda: found.__setitem__(slice(None), [part() for part in parts]) or found
    if isinstance(found, dict):
        items = {key: restorer(value, seen) for key, value in found.items()}
        return lambda: _refilled(found, items)
    if isinstance(found, set):
        members = set(found)
        return lambda: (found.clear(), found.update(members)) and found
    if type(found).__module__.partition(".")[0] in _LOGIC:
        return _restorer_of_attributes(found, seen)
    return lambda: found


def _restorer_of_attributes(found, seen):
    names = [*getattr(found, "__dict__", ())]
    names += [name for kind in type(found).__mro__ for name in getattr(kind, "__slots__", ()) if hasattr(found, name)]
    if not names or isinstance(found, type) or callable(found):
        return lambda: found
    attributes = {name: restorer(getattr(found, name), seen) for name in names}

    def restore():
        for name in [name for name in getattr(found, "__dict__", ()) if name not in attributes]:
            delattr(found, name)
        for name, attribute in attributes.items():
            object.__setattr__(found, name, attribute())
        return found

    return restore


def _written(array, values):
    array[...] = values
    return array


def _refilled(found, items):
    values = {key: item() for key, item in items.items()}
    found.clear()
    found.update(values)
    return found


class SavedState:
    """The state of a Lab at one moment; made by ``Lab.save``. It holds as long as no object is added or removed, and in
    its own process alone. Bullet's copy is freed after the last reference to it."""

    def __init__(self, lab: Lab) -> None:
        world = lab.world
        while lab.forgotten_states:
            pybullet.removeState(lab.forgotten_states.pop(), physicsClientId=world._client)
        self._lab, self._client = lab, world._client
        self._models = {name: (model, {key: getattr(model, key) for key in _OF_MODEL}, model._effort_driven.copy(),
                               model._commanded_effort.copy()) for name, model in world.models.items()}
        self._world = {key: getattr(world, key) for key in _OF_WORLD}
        self._random = world.random.bit_generator.state
        self._logic = restorer(lab.robot.simulated)
        self._forget_contacts()
        self._number = pybullet.saveState(physicsClientId=self._client)
        # At the next save: the last reference may end in any thread, and one thread alone uses PyBullet.
        weakref.finalize(self, lab.forgotten_states.append, self._number).atexit = False

    def is_of(self, lab: Lab) -> bool:
        """Whether a Lab has made it."""
        return self._lab is lab

    def __reduce__(self) -> NoReturn:
        raise LabError("a saved state is of one lab, and cannot be copied or leave its process; save the actions that "
                       "led to it instead")

    def restore(self) -> bool:
        """Return to it; False if objects have been added or removed since."""
        lab, world = self._lab, self._lab.world
        if {name: model for name, (model, *_) in self._models.items()} != world.models:
            return False
        self._forget_contacts()
        pybullet.restoreState(self._number, physicsClientId=self._client)
        for key, value in self._world.items():
            setattr(world, key, value)
        world.random.bit_generator.state = self._random
        world._touched, world._placed = [], []
        for model, values, driven, efforts in self._models.values():
            for key, value in values.items():
                setattr(model, key, value)
            model._effort_driven[:], model._commanded_effort[:], model._reading = driven, efforts, None
        self._logic()
        # Bullet's joint motors are no part of its states. The arms' are set in each tick.
        lab.robot.simulated.drive_again()
        return True

    def _forget_contacts(self):
        """The next step finds all contacts again.

        Bullet keeps the points of contact that are there when a state returns, and its states have one patch of points
        for two bodies; where several parts of one lie on the other there are more. So what follows a return would
        depend on what was before.
        """
        self._lab.world.renew_contacts()
