#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Play a recording of joint_recorder.py back, through the trajectory action servers of both arms."""
import sys

import rospy

from baxter_dataflow.ros_clock import RosClock
from baxter_dataflow.waiting import Stopwatch
from baxter_examples import recording
from baxter_examples.arguments import add_file, new_parser, parse
from baxter_examples.mounted_grippers import mounted_grippers
from baxter_examples.trajectories import TrajectoryClient
from baxter_interface import Limb
from baxter_interface.programs import EnabledRobot, run
from baxter_model import SIDES

GRIPPER_RATE_HZ = 20.0
# Parameters of the action server: speed of the move to the recording's start [rad/s], and extra time at the end [s].
SERVER = "/rsdk_joint_trajectory_action_server/"
DEFAULT_SPEED_RAD_S = 0.25
# Shortest duration of that move [s]: with zero, the first point would have the time of the start.
SHORTEST_WAY_S = 0.5
PATIENCE_S = 10.0


def lead_in_s(here: dict[str, float], row: dict[str, float]) -> float:
    """Return the time for the move from `here` to the recording's first `row` [s], both by joint name."""
    return max(SHORTEST_WAY_S, *(
        abs(row[name] - here[name]) / rospy.get_param(SERVER + name + "_default_velocity", DEFAULT_SPEED_RAD_S)
        for name in here))


class TrajectoryPlayer:
    """One recording, on the arms and grippers that it has."""

    def __init__(self, record: recording.Recording) -> None:
        self._record = record
        self._limbs = {side: Limb(side) for side in SIDES if record.side(side)[0]}
        for side in self._limbs:
            lacking = set(self._limbs[side].joint_names()) - set(record.names)
            if lacking:
                raise recording.BadRecording("the recording has only some joints of the %s arm; %s are missing"
                                             % (side, ", ".join(sorted(lacking))))
        self._clients = {side: TrajectoryClient(side) for side in self._limbs}
        self._grippers = mounted_grippers([side for side in SIDES if record.side(side)[1]], calibrate=True)

    def play(self, robot: EnabledRobot) -> None:
        """Play once. Raises ProgramFailed, RobotLost."""
        record = self._record
        here = {name: angle for limb in self._limbs.values() for name, angle in limb.joint_angles().items()}
        begin_s = lead_in_s(here, record.rows[0]) if here else 0.0
        for side, client in self._clients.items():
            names = self._limbs[side].joint_names()
            client.clear()
            client.add(0.0, [here[name] for name in names])
            for time_s, row in zip(record.times_s, record.rows, strict=True):
                client.add(begin_s + time_s - record.times_s[0], [row[name] for name in names])
            client.set_goal_time(rospy.get_param(SERVER + "goal_time", 0.0))
        clock = RosClock()
        for client in self._clients.values():
            client.send()
        try:
            watch = Stopwatch(clock.now())
            length_s = begin_s + record.duration_s - record.times_s[0]
            for _ in robot.beats(GRIPPER_RATE_HZ):
                time_s = watch.elapsed_s(clock.now())
                row = record.at(record.times_s[0] + time_s - begin_s)
                for side, gripper in self._grippers.items():
                    gripper.command_position(row[side + "_gripper"])
                if time_s >= length_s or any(client.is_done() for client in self._clients.values()):
                    break
            for client in self._clients.values():
                client.wait(length_s + PATIENCE_S)
        finally:
            for client in self._clients.values():
                client.cancel()


def play(path: str, loops: int) -> None:
    record = recording.read(path)
    with EnabledRobot() as robot:
        player = TrajectoryPlayer(record)
        done = 0
        while (loops == 0 or done < loops) and not rospy.is_shutdown():
            done += 1
            print("playing, time %d%s" % (done, " of %d" % loops if loops else ""), flush=True)
            player.play(robot)


def main() -> int:
    parser = new_parser(__doc__)
    add_file(parser, "the recording")
    parser.add_argument("-l", "--loops", type=int, default=1, help="repetitions; 0: endless (default: %(default)s)")
    arguments = parse(parser)
    return run("rsdk_joint_trajectory_file_playback", lambda: play(arguments.file, arguments.loops))


if __name__ == "__main__":
    sys.exit(main())
