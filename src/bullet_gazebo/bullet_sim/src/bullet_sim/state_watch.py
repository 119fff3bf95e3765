# SPDX-License-Identifier: BSD-3-Clause
"""After each step, put models with an impossible state back to where they were, before anything reads it."""

# Of one model at most one line in so many steps: what keeps failing would fill the log.
_QUIET_STEPS = 5000
# A body without joints that has not moved at all for so many steps has fallen asleep, and then is looked at in every
# fiftieth step only: what a NaN touches it touches in the step in which it is found, and then all are looked at.
_ASLEEP_STEPS = 50
_TURNS = 50


class StateWatch:
    """Looks at the models of a World after each step.

    A force, mass or inertia that Bullet cannot compute with gives NaN, which spreads to what is touched. And one NaN in
    Bullet's search tree of boxes has nothing in the world collide with anything any more, however well all states are
    made again: so all bodies are then made anew. It takes some ms a robot, once.
    """

    def __init__(self, world, error):
        self._world = world
        self._error = error
        self._told = {}  # model's name -> steps
        self._lively, self._resting = [], []
        self._sorted = False
        self._turn = 0

    def models_changed(self):
        """A model has come or gone."""
        self._sorted = False

    def note_touched(self, model):
        """Something was done to ``model``."""
        if model.still_for >= _ASLEEP_STEPS:
            model.still_for = 0
            self._sorted = False

    def look(self):
        """Put every model whose state cannot be back to where it was before the step, at rest, and say so."""
        if not self._sorted:
            self._sort()
        faulty = False
        for model in self._lively:
            faulty |= model.fault() is not None
            if model.still_for == _ASLEEP_STEPS and not model.joint_names:
                self._sorted = False
        self._turn = (self._turn + 1) % _TURNS
        for model in self._resting[self._turn::_TURNS]:
            faulty |= model.fault() is not None
            if model.still_for == 0:
                self._sorted = False
        if faulty:
            self._put_back()

    def _sort(self):
        moving = [model for model in self._world.models.values() if not model.static or model.joint_names]
        self._lively = [model for model in moving if model.joint_names or model.still_for < _ASLEEP_STEPS]
        self._resting = [model for model in moving if not model.joint_names and model.still_for >= _ASLEEP_STEPS]
        self._sorted = True

    def _put_back(self):
        world = self._world
        found = {model: model.fault() for model in (*self._lively, *self._resting)}
        faults = {model: fault for model, fault in found.items() if fault is not None}
        if all(fault.is_finite for fault in faults.values()):
            for model in faults:
                model.put_back()
        else:
            world.make_anew(list(world.models.values()), {model: model.last_good() for model in faults})
        for model, fault in faults.items():
            told = self._told.get(model.name)
            if told is None or world.steps - told >= _QUIET_STEPS:
                self._told[model.name] = world.steps
                self._error(
                    "model '%s': %s, at tick %d. It was put back to where it was before, at rest; look for an extreme "
                    "force, mass or inertia" % (model.name, fault.text, world.tick)
                )
