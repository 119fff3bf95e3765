# SPDX-License-Identifier: BSD-3-Clause
"""The part of a group that moves one link."""
from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from arm_kinematics import Chain, ChainError, KinematicsError, Several, Target, solve, solve_all
from motion_planning.errors import PlanningError
from motion_planning.shapes import read_only
from urdf_model.transforms import inverse

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from motion_planning.model import Group, PlanningModel


class KinematicsFailure(PlanningError):
    """A request that inverse kinematics cannot handle: unknown links, links that the group does not move alone."""


class NoIkSolution(KinematicsFailure):
    """There is no solution, or no acceptable one. rejected: True if solutions were found and all refused."""

    def __init__(self, text: str, rejected: bool = False) -> None:
        super().__init__(text)
        self.rejected = rejected


class GroupLimb(NamedTuple):
    """The joints of a group between one link and the nearest link that the group does not move.

    chain: their kinematics, from link ``base`` to ``link``; indices (k,): of its joints in the model's q.
    """

    link: str
    base: str
    chain: Chain
    indices: np.ndarray

    def target(self, goal: ArrayLike, root: np.ndarray) -> Target:
        """Return the Target in the limb's base of ``goal``, a pose (4, 4) or a position (3,) with free orientation,
        both in the frame of ``root`` (4, 4), the base's pose. Raises KinematicsFailure."""
        goal = np.asarray(goal, dtype=np.float64)
        position_only = goal.shape == (3,)
        pose = np.eye(4)
        if position_only:
            pose[:3, 3] = goal
        else:
            pose = goal
        try:
            return Target(inverse(root) @ pose, position_only=position_only)
        except (KinematicsError, ValueError) as error:
            raise KinematicsFailure("the pose of link '%s' cannot be used: %s" % (self.link, error)) from None

    def nearest(self, target: Target, seed: np.ndarray) -> np.ndarray:
        """Return the joint values (k,) nearest to ``seed`` (k,). Raises NoIkSolution with the reason."""
        try:
            return solve(self.chain, target, seed).q
        except KinematicsError as error:
            raise NoIkSolution("link '%s' cannot be put there: %s" % (self.link, error)) from None

    def several(self, target: Target, seed: np.ndarray, number: int) -> list[np.ndarray]:
        """Return up to ``number`` different joint values (k,), those near ``seed`` (k,) first; an empty list if there
        are none."""
        try:
            return [result.q for result in solve_all(self.chain, target, seed, Several(number, settle=False))]
        except KinematicsError:
            return []


def limbs_of(model: PlanningModel, group: Group, links: Iterable[str]) -> list[GroupLimb]:
    """Return a list of GroupLimb, one for each of ``links`` (names), of the Group ``group``.

    Raises KinematicsFailure if a link is unknown, is not moved by the group, depends on a joint of another group in
    between, or shares a joint with another one of the links.
    """
    limbs = [_limb(model, group.name, link) for link in links]
    taken = {}
    for limb in limbs:
        for joint in limb.chain.joint_names:
            if joint in taken:
                raise KinematicsFailure("links '%s' and '%s' both hang on joint '%s'; the poses of links of one chain "
                                        "cannot be chosen each for itself" % (taken[joint], limb.link, joint))
            taken[joint] = limb.link
    return limbs


@lru_cache(maxsize=128)
def _limb(model: PlanningModel, group_name: str, link: str) -> GroupLimb:
    group = model.group(group_name)
    if link not in model.link_index:
        raise KinematicsFailure("robot '%s' has no link '%s'" % (model.name, link))
    path = model.robot.chain(model.root, link)
    own = [number for number, joint in enumerate(path) if joint.name in group.joints]
    if not own:
        raise KinematicsFailure("group '%s' does not move link '%s'; its links are %s"
                                % (group.name, link, ", ".join(group.moving_links) or "none"))
    between = [joint.name for joint in path[own[0]:] if joint.movable and joint.name not in group.joints]
    if between:
        raise KinematicsFailure("between group '%s' and link '%s' moves joint '%s', which is not the group's"
                                % (group.name, link, between[0]))
    base = path[own[0]].parent
    try:
        chain = Chain.from_robot(model.robot, base, link)
    except ChainError as error:
        raise KinematicsFailure("link '%s' cannot be moved by group '%s': %s" % (link, group.name, error)) from None
    return GroupLimb(link, base, chain, read_only([model.index[name] for name in chain.joint_names], np.int64))
