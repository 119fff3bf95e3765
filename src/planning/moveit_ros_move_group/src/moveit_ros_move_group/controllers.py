# SPDX-License-Identifier: BSD-3-Clause
"""Which controllers there are and which of them move given joints. Free of ROS."""
from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Container, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from motion_planning.errors import PlanningError

FOLLOW, GRIPPER, FAKE = "FollowJointTrajectory", "GripperCommand", "fake"
_FAKE_TYPES = ("interpolate", "via points", "last point")
# Greatest number of sets of controllers to try one by one; above it, the search is greedy.
_MAX_TO_COMBINE = 12


# What serves well-known actions, for configurations that do not say it: (beginning, end of the action's name, command).
_SERVERS = (
    ("robot/limb/", "/follow_joint_trajectory", "rosrun baxter_interface joint_trajectory_action_server.py"),
    ("robot/end_effector/", "/gripper_action", "rosrun baxter_interface gripper_action_server.py"))


class NoControllers(PlanningError):
    """No set of controllers fits; the sentence names the joints."""


@dataclass(frozen=True)
class ControllerEntry:
    """One entry of a controller_list.

    name: its namespace, may be empty; kind: FOLLOW, GRIPPER or FAKE; joints: those that it moves; action: name of its
    action, empty for a fake one; default: whether it is preferred; options: the entry's other keys.
    """

    name: str
    kind: str
    joints: tuple[str, ...]
    action: str = ""
    default: bool = False
    options: dict[str, Any] = field(default_factory=dict)

    def __str__(self) -> str:
        return "'%s'" % (self.action or self.name)

    @property
    def remedy(self) -> str:
        """Advice where the action does not answer, the command that starts its server if that is known."""
        action = self.action.lstrip("/")
        command = self.options.get("started_by") or next(
            (line for begin, end, line in _SERVERS if action.startswith(begin) and action.endswith(end)), None)
        if command:
            return "start its server: %s" % command
        return "start the controller that serves it, or correct its name in controller_list"


def read_list(entries: object, fake: bool = False) -> tuple[list[ControllerEntry], list[str]]:
    """Return (list of Controllers, list of sentences on entries that were left out) of a ``controller_list``."""
    controllers, complaints = [], []
    for number, entry in enumerate(entries if isinstance(entries, list) else [], 1):
        needed = ("name", "joints") if fake else ("name", "action_ns", "type", "joints")
        missing = [key for key in needed if not isinstance(entry, dict) or key not in entry]
        if missing:
            complaints.append("entry %d of controller_list has no %s; it is left out" % (number, ", ".join(missing)))
            continue
        joints = entry["joints"]
        if not isinstance(joints, list) or not all(isinstance(joint, str) for joint in joints):
            complaints.append("controller '%s' has joints %r, expected a list of names; it is left out"
                              % (entry["name"], joints))
            continue
        options = {key: value for key, value in entry.items() if key not in ("name", "action_ns", "type", "joints")}
        if fake:
            kind = str(entry.get("type", _FAKE_TYPES[0]))
            if kind not in _FAKE_TYPES:
                complaints.append("fake controller '%s' is of type '%s', expected one of %s; it interpolates"
                                  % (entry["name"], kind, ", ".join(_FAKE_TYPES)))
                kind = _FAKE_TYPES[0]
            controllers.append(ControllerEntry(entry["name"], FAKE, tuple(joints), options={**options, "type": kind}))
        elif entry["type"] not in (FOLLOW, GRIPPER):
            complaints.append("controller '%s' is of type '%s', expected %s or %s; it is left out"
                              % (entry["name"], entry["type"], FOLLOW, GRIPPER))
        else:
            action = "/".join(part for part in (entry["name"], entry["action_ns"]) if part)
            controllers.append(ControllerEntry(entry["name"], entry["type"], tuple(joints), action,
                                               bool(entry.get("default", False)), options))
    if not isinstance(entries, list):
        complaints.append("controller_list is %r, expected a list" % (entries,))
    return controllers, complaints


def choose(controllers: Sequence[ControllerEntry], joints: Iterable[str],
           alive: Callable[[ControllerEntry], bool] = lambda controller: True) -> list[ControllerEntry]:
    """Return the fewest Controllers that together move all ``joints``; those that answer and defaults are preferred.

    alive(controller): whether its action answers. Raises NoControllers, which names the joints without a controller.
    """
    joints = set(joints)
    useful = [controller for controller in controllers if joints & set(controller.joints)]
    orphans = sorted(joints - {joint for controller in useful for joint in controller.joints})
    if orphans:
        raise NoControllers(
            "Unable to identify any set of controllers that can actuate the specified joints: [%s]. No controller "
            "moves %s; %s" % (" ".join(sorted(joints)), ", ".join(orphans), _known(controllers)))
    answering = {controller.action: alive(controller) for controller in useful}

    def cost(chosen: Sequence[ControllerEntry]) -> tuple[int, ...]:
        moved = [joint for controller in chosen for joint in controller.joints]
        return (sum(not answering[controller.action] for controller in chosen), len(chosen),
                len(moved) - len(set(moved)), sum(not controller.default for controller in chosen), len(moved))

    if len(useful) > _MAX_TO_COMBINE:
        return _greedy(useful, joints)
    best: tuple[ControllerEntry, ...] | None = None
    for size in range(1, len(useful) + 1):
        for chosen in itertools.combinations(useful, size):
            moved = {joint for controller in chosen for joint in controller.joints}
            if joints <= moved and (best is None or cost(chosen) < cost(best)):
                best = chosen
    return list(best or ())


def _greedy(useful: Sequence[ControllerEntry], joints: Iterable[str]) -> list[ControllerEntry]:
    chosen, left = [], set(joints)
    while left:
        most = max(useful, key=lambda controller: len(left & set(controller.joints)))
        chosen.append(most)
        left -= set(most.joints)
    return chosen


def _known(controllers: Sequence[ControllerEntry]) -> str:
    if not controllers:
        return "there are no controllers: the parameter controller_list is empty or missing"
    return "the controllers are %s" % ", ".join(
        "%s (%s)" % (controller, ", ".join(controller.joints)) for controller in controllers)


def start_deviation(names: Sequence[str], positions: Sequence[float], current: Mapping[str, float],
                    tolerance: float | dict[str, float], continuous: Container[str] = ()) -> tuple[str, float] | None:
    """Return (joint, by how much) of the joint that is furthest from where a trajectory starts; None if all are near.

    names, positions: of the first point; current: {joint: value}; tolerance: [rad or m] or {joint: value}, where 0
    disables the check; continuous: joints that turn without end. A joint without a value deviates by infinity.
    """
    worst = None
    for name, position in zip(names, positions, strict=True):
        limit = tolerance.get(name, 0.0) if isinstance(tolerance, dict) else tolerance
        if limit <= 0.0:
            continue
        off = abs(position - current[name]) if name in current else math.inf
        if name in continuous and math.isfinite(off):
            off = abs(math.remainder(off, 2.0 * math.pi))
        if off > limit and (worst is None or off > worst[1]):
            worst = (name, off)
    return worst


def allowed_duration(duration: float, controllers: Sequence[ControllerEntry], scaling: float, margin: float) -> float:
    """How long [s] the controllers may take for a trajectory of ``duration``: the most generous of them decides."""
    def number(controller: ControllerEntry, key: str, usual: float) -> float:
        value = controller.options.get(key, usual)
        return value if isinstance(value, (int, float)) and math.isfinite(value) else usual

    return max(duration * number(controller, "allowed_execution_duration_scaling", scaling)
               + number(controller, "allowed_goal_duration_margin", margin) for controller in controllers)
