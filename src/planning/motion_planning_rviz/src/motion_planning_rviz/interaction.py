# SPDX-License-Identifier: BSD-3-Clause
"""The planning query: group, start, goal, settings; and the links of a group that can be dragged."""
from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from motion_planning.errors import PlanningError
from motion_planning.kinematics import ik
from motion_planning.model import State
from urdf_model.transforms import rotation_angle

if TYPE_CHECKING:
    from numpy.random import Generator as Random

    from motion_planning.model import PlanningModel
    from urdf_model import Robot

WHICH = ("goal", "start")


class InteractionError(PlanningError):
    """A request that cannot be fulfilled."""


class Handle(NamedTuple):
    """A link that can be dragged, and the group whose joints follow it."""

    link: str
    group: str


@dataclass(frozen=True, eq=False)
class PanelQuery:
    """The present planning query. Immutable.

    group: name. goal: State. start: State, None for the robot's present state. speed: share of the joints' limits, for
    velocity and acceleration. pipeline, planner: names, empty for move_group's own choice. avoid: whether inverse
    kinematics keeps clear of collisions.
    """

    group: str
    goal: State
    start: State | None = None
    speed: float = 1.0
    pipeline: str = ""
    planner: str = ""
    avoid: bool = False

    def state(self, which: str) -> State | None:
        """The State of "goal" or "start"; None for a start at the robot's present state."""
        return self.goal if which == "goal" else self.start

    def with_state(self, which: str, state: State | None) -> PanelQuery:
        return replace(self, **{which: state})


def plannable(model: PlanningModel) -> tuple[str, ...]:
    """Return the names of groups that something can be planned for: those with joints, ends of arms apart."""
    return tuple(name for name, group in model.groups.items() if group.joints and group.end_effector is None)


def handles_of(model: PlanningModel, group_name: str) -> tuple[Handle, ...]:
    """Return the Handles of a group: its end effector's link or its tip, or those of the groups in it; maybe none."""
    group = model.group(group_name)
    if not group.joints or group.end_effector is not None:
        return ()
    if group.tip is not None:
        mounted = [model.end_effectors[name].parent_link for name in group.end_effectors]
        link = next((link for link in mounted if link in group.moving_links), group.tip)
        return (Handle(link, group_name),) if link in group.moving_links else ()
    found = (handle for name in group.subgroups if name in model.groups for handle in handles_of(model, name))
    return tuple(dict.fromkeys(found))


def pose_of(model: PlanningModel, state: State, link: str) -> np.ndarray:
    """Return the pose (4, 4) of ``link`` in the robot's root link."""
    return model.frame_of(state.q, link)


def outwards(model: PlanningModel, state: State, link: str) -> np.ndarray:
    """Return the outward direction of the arm at ``link``, a unit vector (3,) in the root link: the link's axis that
    points most directly away from the previous link. Tool frames point either way."""
    frames = model.frames(state.q)
    here, joint = frames[model.link_index[link]], model.robot.parent_joint(link)
    way = here[:3, 2]
    while joint is not None:
        step = here[:3, 3] - frames[model.link_index[joint.parent], :3, 3]
        if np.linalg.norm(step) > 1e-3:
            way = step
            break
        joint = model.robot.parent_joint(joint.parent)
    along = here[:3, :3].T @ way
    axis = int(np.abs(along).argmax())
    return np.copysign(1.0, along[axis]) * here[:3, axis]


def is_at(pose: np.ndarray, other: np.ndarray, position_m: float = 1e-3, angle_rad: float = 1e-2) -> bool:
    """Whether two poses (4, 4) look the same."""
    return bool(np.linalg.norm(pose[:3, 3] - other[:3, 3]) < position_m
                and rotation_angle(pose[:3, :3].T @ other[:3, :3]) < angle_rad)


def named_state(model: PlanningModel, state: State, group_name: str, name: str) -> State:
    """Return ``state`` with the joints of a group's named state. Raises InteractionError."""
    states = model.group(group_name).states
    if name not in states:
        raise InteractionError("group '%s' has no state '%s'; its states are %s"
                               % (group_name, name, ", ".join(states) or "none"))
    return state.with_joints(states[name])


def random_state(model: PlanningModel, state: State, group_name: str, generator: Random) -> State:
    """Return ``state`` with the joints of a group anywhere within their limits. generator: numpy.random.Generator."""
    indices = model.group(group_name).indices
    low, high = model.bounds[indices].T
    return state.with_q(generator.uniform(low, high), indices)


def with_known(state: State, values: Mapping[str, float]) -> State:
    """Return ``state`` with those of ``values`` {joint: value} that are variables of the robot and finite."""
    known = {name: value for name, value in values.items() if name in state.variables and np.isfinite(value)}
    return state.with_joints(known)


def group_values(model: PlanningModel, state: State, group_name: str) -> dict[str, float]:
    """Return {joint: value} of a group's joints."""
    group = model.group(group_name)
    return dict(zip(group.joints, state.q[group.indices].tolist(), strict=True))


def why_unreachable(model: PlanningModel, handle: Handle, pose: np.ndarray, state: State) -> str | None:
    """Return the reason why no joint values put a handle's link to ``pose`` (4, 4) in the root link; None if some
    do."""
    try:
        ik(model, handle.group, {handle.link: pose}, state.with_base(np.eye(4)), timeout_s=0.0)
    except PlanningError as error:
        return str(error)
    return None


def rigid_links(robot: Robot, link: str) -> list[str]:
    """Return the links of ``robot`` (urdf_model.Robot) that move as one with ``link``, itself too, sorted."""
    found, new = {link}, [link]
    while new:
        here = new.pop()
        joint = robot.parent_joint(here)
        near = [joint.parent] if joint is not None and not joint.movable else []
        near += [below.child for below in robot.joints.values() if below.parent == here and not below.movable]
        new += [one for one in near if one not in found]
        found.update(near)
    return sorted(found)


def touch_links(model: PlanningModel, handle: Handle) -> list[str]:
    """Return the links that may touch what a handle's link holds: those fixed to it, and its end effectors'."""
    links = set(rigid_links(model.robot, handle.link))
    for effector in model.end_effectors.values():
        if effector.parent_link == handle.link and effector.group in model.groups:
            links.update(model.groups[effector.group].links)
    return sorted(links)
