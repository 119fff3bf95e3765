# SPDX-License-Identifier: BSD-3-Clause
"""Whether what is left of a running trajectory is still free."""
import rospy

# Greatest distance between two checked states [rad or m, in any joint].
_APART = 0.05
# Greatest delay of a controller behind the trajectory [s].
_BEHIND_S = 0.2


class RestOfTheWay:
    """Looks whether a change of the scene stands in what is left of a trajectory. contacts: of the last look."""

    def __init__(self, exact, group, timed, changed_scene):
        """exact: ExactChecker; group: Group; timed: timing.Timed of its joints. changed_scene(): the Scene if it has
        changed since it was last asked for, else None."""
        self._exact, self._group, self._timed = exact, group, timed
        self._changed_scene = changed_scene
        self._begin = None
        self.contacts = []

    def hit(self):
        """None, or the sentence what is in the way. The first call is when the trajectory begins."""
        now = rospy.get_time()
        # Time may have been set back, as by a reset of the simulation.
        self._begin = now if self._begin is None else min(self._begin, now)
        scene = self._changed_scene()
        if scene is None:
            return None
        times = self._timed.spaced(_APART)
        times = times[times >= min(now - self._begin - _BEHIND_S, self._timed.duration)]
        states = self._timed.sampled(times)[0]
        first = self._exact.first_blocked(scene, states, self._group.name)
        if first is None:
            return None
        state = scene.state.with_q(states[first], self._group.indices)
        self.contacts = self._exact.contacts(scene, state, self._group.name)
        return "in the way of what is left: %s" % self.contacts[0] if self.contacts else "something is in the way"
