# SPDX-License-Identifier: BSD-3-Clause
"""Pick and place among clutter by MoveIt's interface: tells move_group what stands there, and asks for grasps and
places."""
from __future__ import annotations

import math

from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion
from moveit_msgs.msg import Grasp, MoveItErrorCodes, PlaceLocation
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from moveit_commander import MoveGroupCommander, PlanningSceneInterface

from .clutter import clutter, grasps, held_otherwise, landings
from .gazebo_scene import BLOCK, TABLE, GazeboScene
from .pick_and_place import aside_angles
from .scene import BASE_HEIGHT_M, BLOCK_SIZE_M, TABLE_SIZE_M, TABLE_TOP_M, TABLE_XY_M, Trial

ARM, READY, FINGER = "left_arm", "left_neutral", "l_gripper_l_finger_joint"
OTHER_ARM = "right_arm"
# Length of the hand's approach and retreat, desired and least [m].
_WAY_M, _MIN_WAY_M = 0.12, 0.06
# Beyond the joint's limits: as wide as the fingers go, and as far as the block lets them [m].
_OPEN_M, _CLOSED_M = 1.0, -1.0
_PLANNING_S = 20.0
# move_group starts beside the program, and takes its time on a busy machine [s, wall].
_SERVERS_S = 120.0
_LIFTED_M = 0.05
# How far from its target the block may end, and a thing from where it stood [m].
MISS_M, TOUCHED_M = 0.01, 0.001
# Codes of a place at which the hand, as it holds the block, touches something or does not get.
_NO_ROOM = (MoveItErrorCodes.GOAL_IN_COLLISION, MoveItErrorCodes.NO_IK_SOLUTION, MoveItErrorCodes.PLANNING_FAILED)
_CODES = {value: name for name, value in vars(MoveItErrorCodes).items() if isinstance(value, int) and name.isupper()}


class TrialFailed(Exception):
    """The trial failed; the text is a sentence."""


class MoveItTrials:
    """The left arm, asked for one trial after the other; the right arm waits aside. Raises TrialFailed."""

    def __init__(self) -> None:
        self._arm, self._scene = MoveGroupCommander(ARM, wait_for_servers=_SERVERS_S), PlanningSceneInterface()
        self._arm.set_planning_time(_PLANNING_S)
        self._arm.set_support_surface_name(TABLE)
        self._scene.clear()
        if not MoveGroupCommander(OTHER_ARM, wait_for_servers=_SERVERS_S).go(aside_angles("right")):
            raise TrialFailed("the right arm did not go aside")

    def run(self, seed: int) -> float:
        """Carry the block of a seed to its target. Returns how far from there it ends [m]; raises TrialFailed."""
        trial, things = Trial.from_seed(seed), clutter(seed)
        self._scene.clear()
        self._go_ready("before the trial")
        with GazeboScene(trial, things) as world:
            self._tell(trial, things)
            try:
                miss = self._carry(trial, world)
            except TrialFailed as failure:
                touched = world.touched(TOUCHED_M)
                raise TrialFailed("%s; the robot touched %s" % (failure, touched)) if touched else failure from None
            touched = world.touched(TOUCHED_M)
            if touched:
                raise TrialFailed("the robot touched %s" % touched)
            return miss

    def _carry(self, trial, world):
        offered = grasps(trial.source)
        while True:
            self._expect(self._arm.pick(BLOCK, [_grasp(one) for one in offered]), "pick")
            if world.height() < trial.source.z + _LIFTED_M:
                raise TrialFailed("the hand came up without the block")
            code = self._place(trial.target)
            if code not in _NO_ROOM:
                break
            # There is no room for the hand at the block's target: take it in another way.
            turn = self._arm.get_current_pose().pose.orientation
            offered = held_otherwise(offered, (turn.x, turn.y, turn.z, turn.w))
            if not offered:
                break
            self._expect(self._place(trial.source), "place where it was")
        self._expect(code, "place")
        self._go_ready("after the block was put down")
        miss = world.distance(trial.target)
        if miss > MISS_M:
            raise TrialFailed("the block is %.1f mm from where it should be" % (1e3 * miss))
        return miss

    def _place(self, spot):
        return self._arm.place(BLOCK, [_place(one) for one in landings(spot)])

    def _go_ready(self, when):
        if not self._arm.go(READY):
            raise TrialFailed("the arm did not get ready %s" % when)

    def _expect(self, code, what):
        if code != MoveItErrorCodes.SUCCESS:
            raise TrialFailed("%s: %s" % (what, _CODES.get(code, code)))

    def _tell(self, trial, things):
        """Tell move_group what stands there."""
        thickness = 0.05
        self._scene.add_box(TABLE, _pose((*TABLE_XY_M, TABLE_TOP_M - BASE_HEIGHT_M - 0.5 * thickness), 0.0),
                            (TABLE_SIZE_M, TABLE_SIZE_M, thickness))
        self._scene.add_box(BLOCK, _at(trial.source), (BLOCK_SIZE_M,) * 3)
        for thing in (thing.with_margin() for thing in things):
            if thing.is_round:
                self._scene.add_cylinder(thing.name, _at(thing.spot), thing.height, 0.5 * thing.width)
            else:
                self._scene.add_box(thing.name, _at(thing.spot), (thing.width, thing.width, thing.height))


def _grasp(one):
    message = Grasp(grasp_quality=one.quality)
    message.grasp_pose.header.frame_id = "base"
    message.grasp_pose.pose = Pose(Point(*one.position), Quaternion(*one.orientation))
    _way(message.pre_grasp_approach, "left_gripper", 1.0)
    _way(message.post_grasp_retreat, "base", 1.0)
    message.pre_grasp_posture, message.grasp_posture = _fingers(_OPEN_M), _fingers(_CLOSED_M)
    return message


def _place(spot):
    message = PlaceLocation(place_pose=_at(spot), post_place_posture=_fingers(_OPEN_M))
    _way(message.pre_place_approach, "base", -1.0)
    _way(message.post_place_retreat, "left_gripper", -1.0)
    return message


def _way(message, frame, direction):
    message.direction.header.frame_id, message.direction.vector.z = frame, direction
    message.desired_distance, message.min_distance = _WAY_M, _MIN_WAY_M


def _fingers(opening):
    return JointTrajectory(joint_names=[FINGER], points=[JointTrajectoryPoint(positions=[opening])])


def _at(spot):
    return _pose((spot.x, spot.y, spot.z), spot.yaw)


def _pose(position, yaw):
    message = PoseStamped(pose=Pose(Point(*position), Quaternion(0.0, 0.0, math.sin(yaw / 2.0), math.cos(yaw / 2.0))))
    message.header.frame_id = "base"
    return message
