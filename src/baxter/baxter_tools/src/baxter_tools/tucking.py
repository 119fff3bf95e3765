# SPDX-License-Identifier: BSD-3-Clause
"""Fold both arms up and unfold them, around each other and the body."""
from __future__ import annotations

import contextlib
import itertools
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import rospy
from baxter_core_msgs.msg import CollisionAvoidanceState
from std_msgs.msg import Empty

from baxter_dataflow.ros_clock import RosClock
from baxter_dataflow.waiting import Stopwatch, Ticker
from baxter_interface import Limb
from baxter_interface.joint_motion import Move
from baxter_interface.limb import COMMAND_RATE_HZ
from baxter_interface.programs import ProgramFailed
from baxter_interface.resets import PUT_ELSEWHERE
from baxter_model import SIDES, poses
from baxter_model.readiness import NOT_ENABLED

from .path_planner import NoFreePath, PathPlanner
from .self_clearance import SelfClearance

# Least distance between parts on the path [m]; the folded arms themselves are nearer to each other.
MARGIN_M = 0.01
# Longest time for one straight segment of the path [s]; the longest possible one takes 10 s.
STRETCH_TIMEOUT_S = 30.0
# Rate of the messages that suppress the robot's own collision avoidance [Hz]; each is valid for 0.6 s.
SUPPRESS_RATE_HZ = 20.0
# Postures from which nearly every other one can be reached.
OPEN_POSES = ("untucked", "neutral")


class BothArms:
    """Both arms as one set of joints."""

    def __init__(self) -> None:
        self._limbs = [Limb(side) for side in SIDES]
        self.names = [name for limb in self._limbs for name in limb.joint_names()]
        self._switch = None

    def angles(self) -> dict[str, float]:
        """Return the joint angles as a dict of name to rad."""
        return {name: angle for limb in self._limbs for name, angle in limb.joint_angles().items()}

    def command(self, angles: Mapping[str, float], raw: bool) -> None:
        """Command joint angles, a dict of name to rad; as Limb.set_joint_positions."""
        for limb in self._limbs:
            limb.set_joint_positions({name: angles[name] for name in limb.joint_names()}, raw)

    def follow(self, way: Sequence[dict[str, float]], is_enabled: Callable[[], bool]) -> None:
        """Move both arms through the postures of `way` (dicts of name to rad), all joints in step; stop at each.

        `is_enabled` returns whether the robot is enabled. Raises ProgramFailed; the arms then stay where they are.
        """
        resets = self._resets()
        clock = RosClock(gives_up=lambda: rospy.is_shutdown() or self._resets() != resets)
        # Raw: a robot at a low speed ratio would slow the joints differently, and they would leave the path.
        try:
            for here, there in itertools.pairwise(way):
                move = Move(here, there, STRETCH_TIMEOUT_S)
                watch, ticker = Stopwatch(clock.now()), Ticker(clock, COMMAND_RATE_HZ)
                while not (step := self._step(move, watch.elapsed_s(clock.now()), is_enabled(), resets)).arrived:
                    if rospy.is_shutdown():
                        raise ProgramFailed("ROS shut down while the arms moved")
                    if step.failure:
                        raise ProgramFailed("the arms did not get there: %s" % step.failure)
                    self.command(step.command or here, raw=True)
                    ticker.sleep()
        except BaseException:
            for limb in self._limbs:
                limb.halt()
            raise
        self.command(way[-1], raw=False)

    def _resets(self):
        return [limb.resets for limb in self._limbs]

    def _step(self, move, elapsed_s, enabled: bool, resets):
        speeds = {name: speed for limb in self._limbs for name, speed in limb.joint_velocities().items()}
        return move.step(elapsed_s, self.angles(), speeds, refusal="" if enabled else NOT_ENABLED,
                         interrupted=PUT_ELSEWHERE if self._resets() != resets else "")


class Tucking:
    """Paths for the arms to named poses: "tucked", "untucked".

    Reads the robot's description from the parameter server. Raises ProgramFailed if there is none.
    """

    def __init__(self, names: list[str]) -> None:
        self._names = names
        text = rospy.get_param("robot_description", None)
        if text is None:
            raise ProgramFailed("the parameter %s is not set: only the robot's shape tells a safe way for its arms"
                                % rospy.resolve_name("robot_description"))
        self._clearance = SelfClearance(str(text), names, rospy.logwarn)

    def way(self, angles: Mapping[str, float], pose: str) -> list[dict[str, float]]:
        """Return the path from `angles` (dict of name to rad) to the named pose as a list of such dicts.

        Raises ProgramFailed if there is none.
        """
        planner = PathPlanner(self._clearance.lower, self._clearance.upper, self._clearance, MARGIN_M,
                              np.random.default_rng(1))
        start = np.array([angles[name] for name in self._names])
        try:
            way = planner.plan(start, self._posture(pose), via=[self._posture(name) for name in OPEN_POSES])
        except NoFreePath as failure:
            raise ProgramFailed("there is no way to the pose %r: %s. Move the arms a little by hand, or with "
                                "joint_position_keyboard.py" % (pose, failure)) from failure
        return [dict(zip(self._names, posture.tolist(), strict=True)) for posture in way]

    def _posture(self, pose: Any):
        angles = {name: angle for side in SIDES for name, angle in poses().angles(pose, side).items()}
        return np.array([angles[name] for name in self._names])


@contextlib.contextmanager
def own_collision_avoidance() -> Iterator[Callable[[], list[str]]]:
    """Suppress the robot's collision avoidance inside a `with` block: folded arms are too close for it.

    Yields a function that lists the parts that the robot now counts as too close.
    """
    near = {}
    subscribers = [
        rospy.Subscriber("robot/limb/%s/collision_avoidance_state" % side, CollisionAvoidanceState,
                         lambda message, side=side: near.__setitem__(side, message.collision_object), queue_size=1)
        for side in SIDES]
    publishers = [rospy.Publisher("robot/limb/%s/suppress_collision_avoidance" % side, Empty, queue_size=1)
                  for side in SIDES]
    ended = threading.Event()

    def suppress() -> None:
        # Wall time: simulation time may stand still.
        while not ended.wait(1.0 / SUPPRESS_RATE_HZ):
            for publisher in publishers:
                publisher.publish()

    thread = threading.Thread(target=suppress, daemon=True)
    thread.start()
    try:
        yield lambda: ["%s arm: %s" % (side, ", ".join(objects)) for side, objects in near.items() if objects]
    finally:
        ended.set()
        thread.join()
        for end in (*subscribers, *publishers):
            end.unregister()
