# SPDX-License-Identifier: BSD-3-Clause
"""What is to be picked up or put down, and in which scenes that is checked."""
from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from motion_planning.scene import Scene, SceneError
from urdf_model.transforms import inverse


class Translation(NamedTuple):
    """A straight way of the hand. direction (3,): unit vector in the planning frame, or with ``in_hand`` in the frame
    of the task's link; desired, least: how far [m] it shall and has to go."""

    direction: np.ndarray
    in_hand: bool = False
    desired: float = 0.0
    least: float = 0.0

    def vector(self, pose):
        """The direction (3,) in the planning frame for a hand at ``pose`` (4, 4)."""
        return pose[:3, :3] @ self.direction if self.in_hand else np.asarray(self.direction, dtype=float)


@dataclass(frozen=True, eq=False)
class Candidate:
    """One way to take an object, or one place to put it.

    name: for sentences; pose (4, 4): of the task's link in the planning frame where the hand closes or opens; approach,
    retreat: Translations that lead there and away; quality: the best are tried first. before, after: {joint: value} of
    the hand on the approach and from the end of it on, empty where it stays as it is. touch: names of objects that the
    hand may touch.
    """

    name: str
    pose: np.ndarray
    approach: Translation
    retreat: Translation
    quality: float = 0.0
    before: Mapping = field(default_factory=dict)
    after: Mapping = field(default_factory=dict)
    touch: frozenset = frozenset()


class Stage(NamedTuple):
    """A part of the motion. description: plan, pre_grasp, approach, grasp or retreat. timed: timing.Timed of the
    group's joints, None where the hand moves; posture: {joint: value} of the hand; scene: in which the motion is free,
    the robot where the stage begins."""

    description: str
    timed: Any
    posture: Mapping
    scene: Scene


@dataclass(frozen=True, eq=False)
class _Task:
    """scene: Scene with the robot where it is; group: name of the arm's; link: of the arm, which candidates' poses are
    for; hand: names of the hand's links; target: id of the object. support: id of what the object stands on or shall
    stand on, or ""; hand_may_touch_support; touch_links: what may touch the held object, the hand where empty."""

    scene: Scene
    group: str
    link: str
    hand: frozenset
    target: str
    support: str = ""
    hand_may_touch_support: bool = False
    touch_links: frozenset = frozenset()

    def on_the_way(self):
        """The scene while the arm comes near."""
        entries = {(self.support, self.target): True} if self.support else {}
        return self._allowing(self.scene, entries)

    def approaching(self, candidate):
        """The scene on the approach."""
        entries = {(link, name): True for link in self.hand for name in (self.target, *candidate.touch)}
        if self.support and self.hand_may_touch_support:
            entries.update({(link, self.support): True for link in self.hand})
        scene = self._allowing(self.on_the_way(), entries)
        return _with_hand(scene, candidate.before)

    def retreating(self, candidate, state):
        """The scene from when the hand has closed or opened; ``state``: the robot's there."""
        scene = _with_hand(self.approaching(candidate).with_state(state), candidate.after)
        return self._handed_over(scene)

    def _allowing(self, scene, entries):
        return scene.with_allowed(scene.allowed.with_entries(entries)) if entries else scene


@dataclass(frozen=True, eq=False)
class PickTask(_Task):
    """Take ``target`` from the world. minimize_distance: the hand goes on from a candidate's pose along its approach as
    long as it touches nothing. Raises SceneError where the scene has no such object."""

    minimize_distance: bool = False
    verb = "picked up"

    def __post_init__(self):
        if self.target not in self.scene.objects:
            raise SceneError("the scene has no object '%s' to pick up%s" % (self.target, _known(self.scene.objects)))

    def closing_in(self, candidate):
        """The scene in which the hand may not touch the object yet."""
        scene = self.approaching(candidate)
        return scene.with_allowed(scene.allowed.with_entries({(link, self.target): False for link in self.hand}))

    def _handed_over(self, scene):
        return scene.attach(self.target, self.link, self.touch_links or self.hand)


@dataclass(frozen=True, eq=False)
class PlaceTask(_Task):
    """Put ``target``, which the robot holds, into the world. Raises SceneError where it holds none of that name."""

    minimize_distance = False
    verb = "put down"

    def __post_init__(self):
        if self.target not in self.scene.state.attached:
            raise SceneError("the robot does not hold an object '%s'%s" % (
                self.target, _known(self.scene.state.attached)))

    def hand_pose(self, object_pose):
        """The pose (4, 4) of the task's link at which the held object is at ``object_pose`` (4, 4)."""
        held = self.scene.attached_pose(self.scene.state.attached[self.target])
        return object_pose @ inverse(held) @ self.scene.frame(self.link)

    def _handed_over(self, scene):
        return scene.detach(self.target)


def hand_links(model, effector):
    """Return the names of the links of an srdf.EndEffector: those of its group and all that hangs on them."""
    found = set(model.groups[effector.group].links)
    grown = True
    while grown:
        more = {joint.child for joint in model.robot.joints.values() if joint.parent in found} - found
        found |= more
        grown = bool(more)
    return frozenset(found)


def _with_hand(scene, posture):
    """The scene with the hand's joints at ``posture``, brought into their limits; joints that mimic others follow."""
    model = scene.model
    values = {name: float(np.clip(value, *model.bounds[model.index[name]]))
              for name, value in posture.items() if name in model.index}
    return scene.with_state(scene.state.with_joints(values)) if values else scene


def _known(names):
    return "; it has %s" % ", ".join("'%s'" % name for name in list(names)[:10]) if names else "; it has none"


def by_quality(candidates):
    """The candidates, the best first, else in the order given."""
    return sorted(candidates, key=lambda candidate: -candidate.quality)


def moved(candidate, pose):
    """The candidate at another pose (4, 4)."""
    return replace(candidate, pose=pose)
