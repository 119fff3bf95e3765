# SPDX-License-Identifier: BSD-3-Clause
"""Conversion of a command's goal constraints to one posture, or one pose of one link."""
from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from command_line.options import counted
from motion_planning.errors import PlanningError
from motion_planning.kinematics import ik
from motion_planning.pipeline import Code, PlanningFailure
from urdf_model.transforms import rigid

if TYPE_CHECKING:
    from motion_planning.constraints import ConstraintSet
    from motion_planning.pipeline import PlanQuery, Tools

# Time limit of the search for a free goal posture [s].
_IK_TIMEOUT_S = 0.1


class Goal(NamedTuple):
    """q (k,): the group's joints, None for LIN and CIRC, whose joints follow from the path; link: the moved one, None
    if the group is not a chain; pose (4, 4): of the link in the planning frame, None for PTP."""

    q: np.ndarray | None
    link: str | None
    pose: np.ndarray | None


def goal_of(query: PlanQuery, tools: Tools) -> Goal:
    """Return the :class:`Goal` of a PlanQuery. Raises PlanningFailure."""
    if len(query.goals) != 1:
        raise _bad("%s needs exactly one goal, got %d" % (query.planner_id, len(query.goals)))
    goal = query.goals[0]
    if goal.joints and (goal.positions or goal.orientations):
        raise _bad("%s needs a goal of joints or a pose of a link, got both" % query.planner_id)
    model, group = query.scene.model, query.scene.model.groups[query.group]
    if goal.joints:
        q = _posture(query, goal)
        if query.planner_id == "PTP":
            return Goal(q, group.tip, None)
        pose = None if group.tip is None else _frame(query, q, group.tip)
        return Goal(None, group.tip, pose)
    link, pose = _pose(query, goal)
    if link not in model.link_index:
        raise PlanningFailure(Code.INVALID_LINK_NAME, "the robot has no link '%s'" % link)
    if query.planner_id != "PTP":
        return Goal(None, link, pose)
    return Goal(_reached(query, tools, link, pose), link, None)


def _posture(query: PlanQuery, goal: ConstraintSet) -> np.ndarray:
    model, group = query.scene.model, query.scene.model.groups[query.group]
    wanted = {one.joint: one.position for one in goal.joints}
    foreign = [joint for joint in wanted if joint not in group.joints]
    if foreign:
        raise _bad("joint '%s' of the goal is not in group '%s'" % (foreign[0], group.name))
    if query.planner_id != "PTP" and len(wanted) != len(group.joints):
        raise _bad("the goal names %s; %s needs all %d of group '%s'"
                   % (counted(len(wanted), "joint"), query.planner_id, len(group.joints), group.name))
    state = query.scene.state.with_joints(wanted)
    beyond = model.beyond_limits(state.q, 1e-9, [model.index[joint] for joint in wanted])
    if beyond:
        raise _bad("joint '%s' of the goal is %.4f; its limits are %.4f and %.4f" % beyond[0])
    return state.q[group.indices]


def _pose(query: PlanQuery, goal: ConstraintSet) -> tuple[str, np.ndarray]:
    """(link, pose (4, 4) in the planning frame) of position and orientation."""
    if len(goal.positions) != 1 or len(goal.orientations) != 1:
        raise _bad("%s needs one position and one orientation of a link, got %d and %d"
                   % (query.planner_id, len(goal.positions), len(goal.orientations)))
    if not goal.positions[0].link or not goal.orientations[0].link:
        raise _bad("the goal's position and orientation need a link_name")
    if goal.positions[0].link != goal.orientations[0].link:
        raise _bad("the goal's position is of link '%s', its orientation of link '%s'; both have to be of one link"
                   % (goal.positions[0].link, goal.orientations[0].link))
    try:
        goal = goal.resolved(query.scene)  # the pose of the link that holds the object
    except PlanningError as error:
        raise PlanningFailure(Code.INVALID_LINK_NAME, str(error)) from None
    position, orientation = goal.positions[0], goal.orientations[0]
    rotation = np.asarray(orientation.rotation)
    return position.link, rigid(rotation, position.regions[0][1][:3, 3] - rotation @ position.offset)


def _reached(query: PlanQuery, tools: Tools, link: str, pose: np.ndarray) -> np.ndarray:
    """The group's joints (k,) nearest to the start that put the link there without collision; where none do, the
    nearest without a collision of the robot with itself, whose motion is then found invalid, as by Pilz's planner."""
    scene, group = query.scene, query.scene.model.groups[query.group]
    alone, fallback = replace(scene, objects={}, octomap=None), []

    def accept(q: np.ndarray) -> str | None:
        state = scene.state.with_q(q)
        if tools.exact.free(scene, state, query.group):
            return None
        if not fallback and tools.exact.free(alone, state, query.group):
            fallback.append(q)
        return "; ".join(map(str, tools.exact.contacts(scene, state, query.group, 1)))

    try:
        return ik(scene.model, group, {link: pose}, scene.state, _IK_TIMEOUT_S, accept, tools.clock)[group.indices]
    except PlanningError as error:
        if fallback:
            return fallback[0][group.indices]
        touching = tools.exact.contacts(scene, scene.state, query.group)
        if touching:
            raise PlanningFailure(Code.INVALID_MOTION_PLAN, "the start is in collision: %s" % "; ".join(
                map(str, touching[:3])), touching) from None
        raise PlanningFailure(Code.NO_IK_SOLUTION, "no posture of group '%s' puts link '%s' there: %s"
                              % (group.name, link, error)) from None


def _frame(query: PlanQuery, q: np.ndarray, link: str) -> np.ndarray:
    scene = query.scene
    state = scene.state.with_q(q, scene.model.groups[query.group].indices)
    return scene.model.frame_of(state.q, link, state.base)


def _bad(text: str) -> PlanningFailure:
    return PlanningFailure(Code.INVALID_GOAL_CONSTRAINTS, text)
