# SPDX-License-Identifier: BSD-3-Clause
"""Groups of joints for planning."""
from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from arm_kinematics import Chain, ChainError
from motion_planning.shapes import read_only

if TYPE_CHECKING:
    from motion_planning.model import PlanningModel
    from motion_planning.srdf import EndEffector, Srdf
    from urdf_model import Joint, Robot


@dataclass(frozen=True, eq=False)
class Group:
    """Some joints of a model, as named in the SRDF. Immutable.

    joints: names of the k movable joints; indices (k,): of them in the model's variables.
    valued_joints: these and the joints that mimic others, in order: the group's variables in MoveIt.
    links: the child links of the group's joints, including fixed ones; moving_links: all links of the robot that move
    with the group, also of other groups. base, tip: ends of the group's chain, None if it is not a chain; chain: its
    kinematics, also None if nothing in it moves or a joint mimics another. Limits are the model's. subgroups: names of
    groups in it. states: name to {joint: value}. end_effector: the group's entry if it is an end effector, else None;
    end_effectors: names of those mounted on it. all_joints: including fixed and mimic joints.
    """

    name: str
    joints: tuple[str, ...]
    indices: np.ndarray
    links: tuple[str, ...]
    moving_links: tuple[str, ...]
    tip: str | None
    base: str | None
    chain: Chain | None
    subgroups: tuple[str, ...]
    states: dict[str, dict[str, float]]
    end_effector: EndEffector | None
    end_effectors: tuple[str, ...]
    all_joints: tuple[str, ...]
    valued_joints: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.joints)


def build_groups(robot: Robot, srdf: Srdf, model: PlanningModel, warnings: list[str]) -> dict[str, Group]:
    """Return {name: Group} of ``srdf``'s groups, in its order, for ``robot`` (with the limits to use).

    ``model``: has index {joint: where} and mimics. ``warnings`` (list of sentences) gets the reasons for unusable
    entries.
    """
    order = depth_first(robot)
    rank = {joint.name: number for number, joint in enumerate(order)}
    by_child = {joint.child: joint for joint in order}
    members = {}

    def members_of(name: str) -> list[str]:
        if name not in members:
            entry = srdf.groups[name]
            own = set(entry.joints) | {by_child[link].name for link in entry.links if link in by_child}
            own.update(joint.name for chain in entry.chains for joint in robot.chain(*chain))
            own.update(joint for subgroup in entry.subgroups for joint in members_of(subgroup))
            members[name] = sorted(own, key=rank.__getitem__)
        return members[name]

    groups = {}
    for name, entry in srdf.groups.items():
        joints = [robot.joints[joint] for joint in members_of(name)]
        if not joints:
            warnings.append("group '%s' holds no joint; it is left out" % name)
            continue
        active = tuple(joint.name for joint in joints if joint.name in model.index)
        valued = tuple(joint.name for joint in joints if joint.name in model.index or joint.name in model.mimics)
        base, tip = _ends(robot, joints, rank)
        effectors = [effector for effector in srdf.end_effectors if effector.group == name]
        links = tuple(joint.child for joint in joints)
        groups[name] = Group(
            name, active, read_only([model.index[joint] for joint in active], np.int64), links,
            _moving_links(robot, order, active), tip, base, _chain(robot, base, tip, active), entry.subgroups,
            _states(srdf, name, active, valued, warnings), effectors[0] if effectors else None,
            tuple(effector.name for effector in srdf.end_effectors
                  if effector.group != name and (effector.parent_group == name
                                                 or not effector.parent_group and effector.parent_link in links)),
            tuple(joint.name for joint in joints), valued)
    return groups


def depth_first(robot: Robot) -> list[Joint]:
    """Return the joints of ``robot`` (urdf_model.Robot), including fixed ones, parents first. Joints of one parent link
    are sorted by name, as in MoveIt: programs send joint values in this order.
    """
    below = {}
    for _, joint in sorted(robot.joints.items()):
        below.setdefault(joint.parent, []).append(joint)
    found, stack = [], below.get(robot.root, [])[::-1]
    while stack:
        joint = stack.pop()
        found.append(joint)
        stack.extend(below.get(joint.child, [])[::-1])
    return found


def _ends(robot: Robot, joints: list[Joint], rank: Mapping[str, int]) -> tuple[str | None, str | None]:
    """Return (base link, tip link) of the chain of ``joints``, (None, None) if they are not a chain."""
    joints = sorted(joints, key=lambda joint: rank[joint.name])
    path = {joint.name for joint in robot.chain(joints[0].parent, joints[-1].child)} if _is_below(
        robot, joints[-1].child, joints[0].parent) else set()
    names = {joint.name for joint in joints}
    if not names <= path or any(robot.joints[name].movable for name in path - names):
        return None, None
    return joints[0].parent, joints[-1].child


def _is_below(robot: Robot, link: str, ancestor: str) -> bool:
    while link != ancestor:
        joint = robot.parent_joint(link)
        if joint is None:
            return False
        link = joint.parent
    return True


def _chain(robot: Robot, base: str | None, tip: str | None, active: tuple[str, ...]) -> Chain | None:
    if base is None or tip is None or not active:
        return None
    try:
        return Chain.from_robot(robot, base, tip)
    except ChainError:
        return None


def _moving_links(robot: Robot, order: list[Joint], active: tuple[str, ...]) -> tuple[str, ...]:
    moving = set()
    for joint in order:
        mimicked = joint.mimic
        if joint.parent in moving or joint.name in active or mimicked is not None and mimicked.joint in active:
            moving.add(joint.child)
    return tuple(link for link in (joint.child for joint in order) if link in moving)


def _states(srdf: Srdf, group: str, active: tuple[str, ...], valued: tuple[str, ...],
            warnings: list[str]) -> dict[str, dict[str, float]]:
    states = {}
    for state in srdf.states:
        if state.group != group:
            continue
        foreign = [joint for joint in state.values if joint not in valued]
        if foreign:
            warnings.append("state '%s' names %s, which group '%s' does not move; ignored there"
                            % (state.name, ", ".join("'%s'" % joint for joint in foreign), group))
        states[state.name] = {joint: value for joint, value in state.values.items() if joint in active}
    return states
