# SPDX-License-Identifier: BSD-3-Clause
"""Let a robot of a ROS master do an episode of a set again."""
from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import rospy
from baxter_core_msgs.msg import AssemblyState, EndEffectorCommand, EndEffectorState, JointCommand
from sensor_msgs.msg import JointState

from baxter_model import SIDES, joint_names
from command_line.options import MAX_SEED, Parser, number

from ..frames import DemonstrationError
from ..reading import DataSet
from ..replaying import Replay, ReplayLimits, actions_of, reason_to_stop
from .messages import joints

#: Set-points a second, and the wall time in which the robot must be heard [s].
_STREAM_HZ, _FOUND_WITHIN_S = 100, 10.0
#: A change of a gripper that is sent [%], and what counts as closed or open.
_NEAR = 1.0


def parse(argv: Sequence[str]) -> argparse.Namespace:
    """The command line's options."""
    parser = Parser(
        prog="rosrun demonstrations replay", description=__doc__,
        epilog="Both arms go straight to the episode's start first: see that nothing is in the way. Ctrl-C, the "
               "robot's stop, and a joint that does not follow end it. Exit status: 0 done, 1 stopped or broken, 2 "
               "wrong options.")
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="a set of `rosrun demonstrations record`")
    parser.add_argument("--episode", type=number(int, 0, MAX_SEED), default=0, metavar="N", help="default: the first")
    parser.add_argument("--speed", type=number(float, 0.0, 1.5, above=True), default=ReplayLimits.speed_rad_s,
                        metavar="RAD_S", help="on the way to the start (default: %(default)s rad/s)")
    return parser.parse_args(argv)


class ReplayRobot:
    """Both arms and grippers of a master. Raises DemonstrationError where it is not heard."""

    def __init__(self) -> None:
        self.state: AssemblyState | None = None
        self.angles: np.ndarray | None = None
        self._seen_s = 0.0
        self._ids: dict[str, int] = {}
        self._openings: dict[str, float] = {}
        self._arms = {side: rospy.Publisher("/robot/limb/%s/joint_command" % side, JointCommand, queue_size=1,
                                            tcp_nodelay=True) for side in SIDES}
        grippers = {side: "/robot/end_effector/%s_gripper/" % side for side in SIDES}
        self._grippers = {side: rospy.Publisher(name + "command", EndEffectorCommand, queue_size=10)
                          for side, name in grippers.items()}
        self._kept = [rospy.Subscriber("/robot/state", AssemblyState, lambda message: setattr(self, "state", message)),
                      rospy.Subscriber("/robot/joint_states", JointState, self._on_joints, queue_size=1)]
        self._kept += [rospy.Subscriber(name + "state", EndEffectorState,
                                        lambda message, side=side: self._ids.__setitem__(side, message.id))
                       for side, name in grippers.items()]
        end = time.monotonic() + _FOUND_WITHIN_S
        while self.state is None or self.angles is None or any(
                not publisher.get_num_connections() for publisher in self._arms.values()):
            if rospy.is_shutdown() or time.monotonic() > end:
                raise DemonstrationError("no robot is heard on /robot/state and /robot/joint_states")
            time.sleep(0.02)  # simulated time may not go on

    @property
    def silent_s(self) -> float:
        """For how long no joint states have come [s]. Not by their stamps: a robot's clock is another one."""
        return rospy.get_time() - self._seen_s

    def _on_joints(self, message: JointState) -> None:
        found = joints(message)
        if found is not None:
            self.angles, self._seen_s = np.array(found), rospy.get_time()

    def send(self, set_points: np.ndarray, openings: np.ndarray) -> None:
        """One message of each arm, and of each gripper that is to change."""
        for side, part, opening in zip(SIDES, np.split(set_points, len(SIDES)), openings, strict=True):
            self._arms[side].publish(JointCommand(mode=JointCommand.POSITION_MODE, names=joint_names(side),
                                                  command=part.tolist()))
            if side in self._ids and abs(opening - self._openings.get(side, np.inf)) >= _NEAR:
                self._openings[side] = float(opening)
                self._grippers[side].publish(_gripper(self._ids[side], float(opening)))


def _gripper(id_, opening):
    if opening <= _NEAR:
        return EndEffectorCommand(id=id_, command=EndEffectorCommand.CMD_GRIP, sender="replay")
    if opening >= 100.0 - _NEAR:
        return EndEffectorCommand(id=id_, command=EndEffectorCommand.CMD_RELEASE, sender="replay")
    return EndEffectorCommand(id=id_, command=EndEffectorCommand.CMD_GO, args=json.dumps({"position": opening}),
                              sender="replay")


def run(options: argparse.Namespace) -> None:
    """Raises DemonstrationError, also where it is stopped."""
    data = DataSet(options.folder)
    actions = actions_of(data, options.episode)
    rospy.init_node("demonstrations_replay")
    robot, limits = ReplayRobot(), ReplayLimits(options.speed)
    assert robot.angles is not None
    replay = Replay(actions, data.schema.rate_hz, robot.angles, limits)
    print("%.1f s to the start, then %d frames in %.1f s" % (
        replay.begins_s, len(actions), replay.ends_s - replay.begins_s), flush=True)
    begin, rate, furthest, told = rospy.get_time(), rospy.Rate(_STREAM_HZ), 0.0, robot.angles
    while not rospy.is_shutdown():
        now = rospy.get_time()
        state, off = robot.state, float(np.abs(told - robot.angles).max())
        if state is not None and (why := reason_to_stop(limits, state.enabled, bool(state.stopped or state.error),
                                                        robot.silent_s, off)):
            raise DemonstrationError("stopped after %.1f s: %s" % (now - begin, why))
        furthest = max(furthest, off)
        told = replay.joints(min(now - begin, replay.ends_s))
        robot.send(told, replay.openings(now - begin))
        if now - begin >= replay.ends_s:
            print("done; no joint was more than %.3f rad from its set-point" % furthest)
            return
        rate.sleep()
    raise DemonstrationError("stopped")


def main() -> None:
    """The program."""
    options = parse(rospy.myargv()[1:])
    try:
        run(options)
    except DemonstrationError as error:
        sys.exit("replay: %s" % error)
    except rospy.ROSInterruptException:
        sys.exit("replay: stopped")
