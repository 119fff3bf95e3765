# SPDX-License-Identifier: BSD-3-Clause
"""Whether what is left of a running trajectory is still free; where it is not, another way, or a gentle stop."""
from __future__ import annotations

import threading
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import rospy
from moveit_msgs.msg import RobotTrajectory

from motion_planning.errors import PlanningError
from motion_planning.planners import first_touching
from motion_planning.replanning import Running, last_stop, stopped
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
# A look waits so long for a search, which ends within one mostly [s, wall time].
_LOOK_S = 0.02
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


@dataclass(frozen=True)
class Onward:
    """How another way is found while the joints move. search(scene, replanning.Running, stop): a
    replanning.Redirection, in a thread; raises PlanningError, soon after stop() is true. begins(): called before a
    search; follows(Redirection, wall time of the search [s]): before its way is followed."""

    search: Callable[[Scene, Running, Callable[[], bool]], Redirection]
    begins: Callable[[], None] = lambda: None
    follows: Callable[[Redirection, float], None] = lambda found, seconds: None


class _Search:
    """A search under way, in a thread: whoever waits for it goes on looking at the scene, and can do without it.
    latest [s]: on the running trajectory, when the joints have to begin to stop."""

    def __init__(self, onward: Onward, scene: Scene, running: Running, latest: float) -> None:
        self.scene, self.running, self.latest = scene, running, latest
        self.found: Redirection | None = None
        self.flaw, self.seconds = "", 0.0
        self._onward, self._done, self._given_up = onward, threading.Event(), threading.Event()
        onward.begins()
        threading.Thread(target=self._run, name="another way", daemon=True).start()

    def _run(self) -> None:
        begin = time.monotonic()
        try:
            self.found = self._onward.search(self.scene, self.running, self._given_up.is_set)
        except PlanningError as error:
            self.flaw = str(error)
        except Exception as error:  # whatever it is, the joints are stopped
            rospy.logerr("move_group: %s", traceback.format_exc())
            self.flaw = "the search failed: %s: %s" % (type(error).__name__, error)
        self.seconds = time.monotonic() - begin
        self._done.set()

    def ended(self) -> bool:
        """Whether it has, within a short time from now."""
        return self._done.wait(_LOOK_S)

    def give_up(self) -> None:
        """Nobody wants it any more."""
        self._given_up.set()


class RestOfTheWay:
    """Looks whether a change of the scene stands in what is left of a trajectory. contacts: of the last look."""

    def __init__(self, exact: ExactChecker, group: Group, timed: Timed, changed_scene: Callable[[], Scene | None],
                 onward: Onward | None = None, began: Callable[[], float | None] = lambda: None) -> None:
        """exact: ExactChecker; group: Group; timed: timing.Timed of its joints. changed_scene(): the Scene if it has
        changed since it was last asked for, else None. onward: None: there is no other way. began(): ROS time [s] at
        which the controller says that the trajectory began, None if it does not."""
        self._exact, self._group, self._timed = exact, group, timed
        self._changed_scene, self._onward, self._began = changed_scene, onward, began
        self._begin: float | None = None
        self._scene: Scene | None = None
        self._blocked_from, self._reason = 0.0, ""
        self._search: _Search | None = None
        self.contacts: list[Contact] = []

    @property
    def searching(self) -> bool:
        """Whether another way is searched for now."""
        return self._search is not None

    def hit(self) -> str | NewWay | None:
        """None, a NewWay, or the sentence what is so near that the joints have to stop at once. The first call is when
        the trajectory begins; while another way is searched for, calls return None and look at what else changes."""
        now = rospy.get_time()
        # Time may have been set back, as by a reset of the simulation.
        begin = self._begin = now if self._begin is None else min(self._begin, now + LATER_S)
        scene = self._changed_scene()
        if scene is not None:
            begin = self._begin = self._began() or begin
            before = self._blocked_from
            if not self._is_blocked(scene, now - begin):
                self.end_search()
                return None
            if self._onward is None:
                return self._stop(scene, begin)
            if self._search is None or self._blocked_from < before:
                self._begin_search(self._onward, scene, begin)
        if self._search is None or self._onward is None or self._scene is None:
            return None
        return self._searched(self._search, self._onward, self._scene, begin)

    def _is_blocked(self, scene: Scene, now: float) -> bool:
        """Whether something in a scene is in the way of what is left at a time on the trajectory [s]."""
        times = self._timed.spaced(_APART)
        times = times[times >= min(now - _BEHIND_S, self._timed.duration)]
        states = self._timed.sampled(times)[0]
        first = first_touching(self._exact, scene, self._group, states)
        if first is None:
            return False
        state = scene.state.with_q(states[first], self._group.indices)
        self.contacts = self._exact.contacts(scene, state, self._group.name)
        self._reason = ("in the way of what is left: %s" % self.contacts[0] if self.contacts
                        else "something is in the way")
        self._scene, self._blocked_from = scene, float(times[first])
        return True

    def _running(self, begin: float) -> Running:
        return Running(self._timed, lambda: rospy.get_time() - begin, self._blocked_from)

    def _begin_search(self, onward: Onward, scene: Scene, begin: float) -> None:
        self.end_search()
        running = self._running(begin)
        self._search = _Search(onward, scene, running, last_stop(self._exact, scene, self._group, running))

    def end_search(self) -> None:
        """Give up a search that is under way, as when its motion has ended."""
        if self._search is not None:
            self._search.give_up()
        self._search = None

    def _searched(self, search: _Search, onward: Onward, scene: Scene, begin: float) -> str | NewWay | None:
        """The outcome of a search in the scene as it is now; None while it lasts."""
        if not search.ended():
            if search.running.now() < search.latest:
                return None
            return self._stop(scene, begin, "no other way was found before the joints have to stop")
        found = search.found
        if found is None:
            return self._stop(scene, begin, "no other way while the joints move: %s" % search.flaw)
        begins = begin + found.begin
        late = rospy.get_time() - begins
        if late > 0.0:
            return self._stop(scene, begin, "another way was found %.3f s too late" % late)
        if scene is not search.scene and first_touching(
                self._exact, scene, self._group, found.timed.sampled(found.timed.spaced(_APART))[0]) is not None:
            self._begin_search(onward, scene, begin)
            return None
        self.end_search()
        onward.follows(found, search.seconds)
        return self._new_way(scene, found.timed, begins)

    def _stop(self, scene: Scene, begin: float, why: str = "") -> str | NewWay:
        """The way to rest, or the sentence why the joints have to stop at once. Joints that stop go nowhere else."""
        self.end_search()
        self._onward = None
        reason = "%s; %s" % (self._reason, why) if why else self._reason
        stop = stopped(self._exact, scene, self._group, self._running(begin))
        return reason if stop is None else self._new_way(scene, stop.timed, begin + stop.begin, reason)

    def _new_way(self, scene: Scene, timed: Timed, begins: float, stops: str = "") -> NewWay:
        self._timed, self._begin = timed, begins
        later = Timed(*(column[1:] for column in (timed.times, timed.positions, timed.velocities, timed.accelerations)))
        return NewWay(trajectory_message(self._group.joints, later, scene.model.frame, rospy.Time.from_sec(begins)),
                      begins, stops)
