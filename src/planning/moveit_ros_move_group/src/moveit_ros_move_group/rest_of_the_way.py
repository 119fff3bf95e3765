# SPDX-License-Identifier: BSD-3-Clause
"""Whether what is left of a running trajectory is still free; where it is not, another way, or a gentle stop."""
from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import rospy
from moveit_msgs.msg import RobotTrajectory

from motion_planning.errors import PlanningError
from motion_planning.planners import first_touching
from motion_planning.replanning import Running, stopped
from motion_planning.timing import Timed
from moveit_ros_move_group.convert.scene_out import trajectory_message

if TYPE_CHECKING:
    from motion_planning.exact import Contact, ExactChecker
    from motion_planning.model import Group
    from motion_planning.replanning import Redirection
    from motion_planning.scene import Scene

# Greatest distance between two checked states [rad or m, in any joint].
_APART = 0.05
# Greatest delay of a controller behind the trajectory [s].
_BEHIND_S = 0.2
#: A trajectory that takes another's place begins at most so much later [s].
LATER_S = 0.5


@dataclass(frozen=True)
class NewWay:
    """trajectory: takes the place of the running one at its header's stamp, where its positions, velocities and
    accelerations are that one's; it has no point at its start, so that a controller leads to its first one from where
    it really is. begins: the stamp [s]. stops: why the joints come to rest on it, empty where it leads to the goal."""

    trajectory: RobotTrajectory
    begins: float
    stops: str = ""


class RestOfTheWay:
    """Looks whether a change of the scene stands in what is left of a trajectory. contacts: of the last look."""

    def __init__(self, exact: ExactChecker, group: Group, timed: Timed, changed_scene: Callable[[], Scene | None],
                 onward: Callable[[Scene, Running], Redirection] | None = None,
                 began: Callable[[], float | None] = lambda: None) -> None:
        """exact: ExactChecker; group: Group; timed: timing.Timed of its joints. changed_scene(): the Scene if it has
        changed since it was last asked for, else None. onward(scene, replanning.Running): a replanning.Redirection;
        raises PlanningError; None: there is no other way. began(): ROS time [s] at which the controller says that the
        trajectory began, None if it does not."""
        self._exact, self._group, self._timed = exact, group, timed
        self._changed_scene, self._onward, self._began = changed_scene, onward, began
        self._begin: float | None = None
        self.contacts: list[Contact] = []

    def hit(self) -> str | NewWay | None:
        """None, a NewWay, or the sentence what is so near that the joints have to stop at once. The first call is when
        the trajectory begins."""
        now = rospy.get_time()
        # Time may have been set back, as by a reset of the simulation.
        begin = self._begin = now if self._begin is None else min(self._begin, now + LATER_S)
        scene = self._changed_scene()
        if scene is None:
            return None
        begin = self._begin = self._began() or begin
        times = self._timed.spaced(_APART)
        times = times[times >= min(now - begin - _BEHIND_S, self._timed.duration)]
        states = self._timed.sampled(times)[0]
        first = first_touching(self._exact, scene, self._group, states)
        if first is None:
            return None
        state = scene.state.with_q(states[first], self._group.indices)
        self.contacts = self._exact.contacts(scene, state, self._group.name)
        reason = "in the way of what is left: %s" % self.contacts[0] if self.contacts else "something is in the way"
        blocked_from = float(times[first])
        if self._onward is not None:
            found = self._around(self._onward, scene, begin, blocked_from)
            if isinstance(found, NewWay):
                return found
            reason = "%s; %s" % (reason, found)
            self._onward = None  # joints that stop go nowhere else
        stop = stopped(self._exact, scene, self._group, self._running(begin, blocked_from))
        return reason if stop is None else self._new_way(scene, stop.timed, begin + stop.begin, reason)

    def _running(self, begin: float, blocked_from: float) -> Running:
        return Running(self._timed, lambda: rospy.get_time() - begin, blocked_from)

    def _around(self, onward: Callable[[Scene, Running], Redirection], scene: Scene, begin: float,
                blocked_from: float) -> str | NewWay:
        """A NewWay to the goal, or the sentence why there is none."""
        try:
            found = onward(scene, self._running(begin, blocked_from))
        except PlanningError as error:
            return "no other way while the joints move: %s" % error
        begins = begin + found.begin
        late = rospy.get_time() - begins
        if late > 0.0:
            return "another way was found %.3f s too late" % late
        return self._new_way(scene, found.timed, begins)

    def _new_way(self, scene: Scene, timed: Timed, begins: float, stops: str = "") -> NewWay:
        self._timed, self._begin = timed, begins
        later = Timed(*(column[1:] for column in (timed.times, timed.positions, timed.velocities, timed.accelerations)))
        return NewWay(trajectory_message(self._group.joints, later, scene.model.frame, rospy.Time.from_sec(begins)),
                      begins, stops)
