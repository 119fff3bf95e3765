# SPDX-License-Identifier: BSD-3-Clause
"""Tasks of picking up and putting down, and the scenes for their checks."""
from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from motion_planning.scene import Scene, SceneError
from urdf_model.transforms import inverse

if TYPE_CHECKING:
    from motion_planning.model import PlanningModel, State
    from motion_planning.srdf import EndEffector
    from motion_planning.timing import Timed


class Translation(NamedTuple):
    """A straight motion of the hand. direction (3,): unit vector in the planning frame, or with ``in_hand`` in the
    frame of the task's link; desired, least: desired and least length [m]."""

    direction: np.ndarray
    in_hand: bool = False
    desired: float = 0.0
    least: float = 0.0

    def vector(self, pose: np.ndarray) -> np.ndarray:
        """The direction (3,) in the planning frame for a hand at ``pose`` (4, 4)."""
        return pose[:3, :3] @ self.direction if self.in_hand else np.asarray(self.direction, dtype=float)


@dataclass(frozen=True, eq=False)
class Candidate:
    """One grasp of an object, or one place for it.

    name: for sentences; pose (4, 4): of the task's link in the planning frame where the hand closes or opens; approach,
    retreat: Translations to and from it; quality: the best are tried first. before, after: {joint: value} of the hand
    during the approach and after it, empty for no change. touch: names of objects that the hand may touch.
    """

    name: str
    pose: np.ndarray
    approach: Translation
    retreat: Translation
    quality: float = 0.0
    before: Mapping[str, float] = field(default_factory=dict)
    after: Mapping[str, float] = field(default_factory=dict)
    touch: frozenset[str] = frozenset()


class ManipulationStage(NamedTuple):
    """A part of the motion. description: plan, pre_grasp, approach, grasp or retreat. timed: timing.Timed of the
    group's joints, None if the hand moves; posture: {joint: value} of the hand; scene: in which the motion is free,
    with the robot at the start of the stage."""

    description: str
    timed: Timed | None
    posture: Mapping[str, float]
    scene: Scene


@dataclass(frozen=True, eq=False)
class _Task:
    """scene: Scene with the robot's present state; group: name of the arm's; link: of the arm, for candidates' poses;
    hand: names of the hand's links; target: id of the object. support: id of the support of the object, before or
    after, or ""; hand_may_touch_support; touch_links: links that may touch the held object, empty: the hand."""

    scene: Scene
    group: str
    link: str
    hand: frozenset[str]
    target: str
    support: str = ""
    hand_may_touch_support: bool = False
    touch_links: frozenset[str] = frozenset()

    def on_the_way(self) -> Scene:
        """The scene for the path to the approach."""
        entries = {(self.support, self.target): True} if self.support else {}
        return self._allowing(self.scene, entries)

    def approaching(self, candidate: Candidate) -> Scene:
        """The scene for the approach."""
        entries = {(link, name): True for link in self.hand for name in (self.target, *candidate.touch)}
        if self.support and self.hand_may_touch_support:
            entries.update({(link, self.support): True for link in self.hand})
        scene = self._allowing(self.on_the_way(), entries)
        return _with_hand(scene, candidate.before)

    def retreating(self, candidate: Candidate, state: State) -> Scene:
        """The scene after the hand has closed or opened; ``state``: the robot's at that time."""
        scene = _with_hand(self.approaching(candidate).with_state(state), candidate.after)
        return self._handed_over(scene)

    def _handed_over(self, scene: Scene) -> Scene:
        raise NotImplementedError

    def _allowing(self, scene: Scene, entries: Mapping[tuple[str, str], bool]) -> Scene:
        return scene.with_allowed(scene.allowed.with_entries(entries)) if entries else scene


@dataclass(frozen=True, eq=False)
class PickTask(_Task):
    """Take ``target`` from the world. minimize_distance: the hand continues from a candidate's pose along its approach
    until just before a contact. Raises SceneError if the scene has no such object."""

    minimize_distance: bool = False
    verb = "picked up"

    def __post_init__(self) -> None:
        if self.target not in self.scene.objects:
            raise SceneError("the scene has no object '%s' to pick up%s" % (self.target, _known(self.scene.objects)))

    def closing_in(self, candidate: Candidate) -> Scene:
        """The scene in which the hand may not touch the object yet."""
        scene = self.approaching(candidate)
        return scene.with_allowed(scene.allowed.with_entries({(link, self.target): False for link in self.hand}))

    def _handed_over(self, scene: Scene) -> Scene:
        return scene.attach(self.target, self.link, self.touch_links or self.hand)


@dataclass(frozen=True, eq=False)
class PlaceTask(_Task):
    """Put the attached ``target`` into the world. Raises SceneError if the robot does not hold it."""

    verb = "put down"

    def __post_init__(self) -> None:
        if self.target not in self.scene.state.attached:
            raise SceneError("the robot does not hold an object '%s'%s" % (
                self.target, _known(self.scene.state.attached)))

    def hand_pose(self, object_pose: np.ndarray) -> np.ndarray:
        """The pose (4, 4) of the task's link at which the held object is at ``object_pose`` (4, 4)."""
        held = self.scene.attached_pose(self.scene.state.attached[self.target])
        return object_pose @ inverse(held) @ self.scene.frame(self.link)

    def _handed_over(self, scene: Scene) -> Scene:
        return scene.detach(self.target)


def hand_links(model: PlanningModel, effector: EndEffector) -> frozenset[str]:
    """Return the names of the links of an srdf.EndEffector: those of its group and all links below them."""
    found = set(model.groups[effector.group].links)
    grown = True
    while grown:
        more = {joint.child for joint in model.robot.joints.values() if joint.parent in found} - found
        found |= more
        grown = bool(more)
    return frozenset(found)


def _with_hand(scene: Scene, posture: Mapping[str, float]) -> Scene:
    """The scene with the hand's joints at ``posture``, clamped to their limits; joints that mimic others follow."""
    model = scene.model
    values = {name: float(np.clip(value, *model.bounds[model.index[name]]))
              for name, value in posture.items() if name in model.index}
    return scene.with_state(scene.state.with_joints(values)) if values else scene


def _known(names: Collection[str]) -> str:
    return "; it has %s" % ", ".join("'%s'" % name for name in list(names)[:10]) if names else "; it has none"


def by_quality(candidates: Iterable[Candidate]) -> list[Candidate]:
    """The candidates, the best first, else in the order given."""
    return sorted(candidates, key=lambda candidate: -candidate.quality)


def moved(candidate: Candidate, pose: np.ndarray) -> Candidate:
    """The candidate at another pose (4, 4)."""
    return replace(candidate, pose=pose)
