# SPDX-License-Identifier: BSD-3-Clause
"""Where the arms would be for a pose of a hand, for pages that drag one; nothing moves. No ROS."""
from __future__ import annotations

import threading
from typing import TYPE_CHECKING

from arm_kinematics import Budget, Chain, KinematicsError, NoSolution, pose_from_quaternion, solve, warm_up
from urdf_model import UrdfError
from urdf_model.transforms import inverse, quaternion_from_matrix

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from typing import Any

    import numpy as np

    from lab_web.scene import SceneText
    from sensor_renderer.mirror import DrawnModel
    from urdf_model import Robot

# The nearest of 16 postures: 1 ms, and a hand that is dragged steadily does not make the elbow jump.
_BUDGET = Budget(candidates=16)
_LONGEST_REASON = 300


class HandAnswers:
    """Answers the newest question of each page about each hand, one after the other in a thread (``run``).

    ``measured()``: {joint: [rad]}; ``ghost(chain, joints)``: what the page draws, or None; ``answer(client,
    operation)``.
    """

    def __init__(self, measured: Callable[[], dict[str, float]],
                 ghost: Callable[[Chain, dict[str, float]], dict[str, Any] | None],
                 answer: Callable[[int, dict[str, Any]], object]) -> None:
        self._measured = measured
        self._ghost = ghost
        self._answer = answer
        self._chains = {}
        self._questions = {}
        self._asked = threading.Condition()

    @property
    def sides(self) -> list[str]:
        """The hands that can be asked about."""
        return list(self._chains)

    def know(self, robot: Robot, links: Mapping[str, tuple[str, str]], warn: Callable[[str], object]) -> None:
        """The arms of an urdf_model.Robot; ``links``: {side: (base link, tip link)}; ``warn(text)`` of arms without."""
        chains = {}
        for side, (base, tip) in links.items():
            try:
                chains[side] = Chain.from_robot(robot, base, tip)
                warm_up(chains[side])
            except (KinematicsError, UrdfError) as error:
                warn("the page cannot move the %s hand: %s" % (side, error))
        self._chains = chains

    def base(self, picture: SceneText | None) -> np.ndarray | None:
        """The pose of the arms' base frame in the scene ``picture`` (4 x 4), or None."""
        measured = self._measured()
        for chain in self._chains.values():
            if all(name in measured for name in chain.joint_names):
                return base_of(picture, chain, {name: measured[name] for name in chain.joint_names})
        return None

    def pose(self, side: str, measured: Mapping[str, float]) -> np.ndarray | None:
        """The pose (4, 4) of a hand in its arm's base frame at ``measured`` {joint: [rad]}, or None."""
        chain = self._chains.get(side)
        if chain is None or not all(name in measured for name in chain.joint_names):
            return None
        return chain.fk([measured[name] for name in chain.joint_names])

    def ask(self, client: int, question: dict[str, Any]) -> None:
        """An operation "reach" of a page: ``side``, ``number``, and ``position`` [m], ``orientation`` (x, y, z, w) of
        the hand in the robot's base frame; without them, the hand as it is. Does not wait.
        """
        with self._asked:
            # In the place of an older one: where pages ask faster than this machine computes, each gets its newest.
            self._questions[client, str(question.get("side"))] = question
            self._asked.notify()

    def run(self, ends: Callable[[], bool]) -> None:
        """Answer until ``ends()``."""
        while not ends():
            with self._asked:
                if not self._questions and not self._asked.wait(0.2):
                    continue
                (client, side), question = next(iter(self._questions.items()))
                del self._questions[client, side]
            self._answer(client, {"op": "reach", "side": side, "number": question.get("number"),
                                  **self.reached(side, question)})

    def reached(self, side: str, question: dict[str, Any]) -> dict[str, Any]:
        """The answer: ``why`` ("" if the hand gets there, else a key of the page's texts), ``text``, and where known
        ``position``, ``orientation``, ``joints`` {name: [rad]} (the nearest posture where it does not), ``ghost``.
        """
        chain = self._chains.get(side)
        if chain is None:
            return {"why": "invalid", "text": "there is no hand '%s' to move; there are %s"
                                              % (side, ", ".join(self._chains) or "none yet")}
        why = text = ""
        try:
            measured = self._measured()
            seed = chain.posture_by_name(list(measured), list(measured.values()))
            if "position" in question:
                pose = pose_from_quaternion(question["position"], question.get("orientation", ()))
                q = solve(chain, pose, seed, budget=_BUDGET).q
            else:
                q, pose = seed, chain.fk(seed)
        except NoSolution as error:
            q, why, text = error.best, error.reason.name.lower(), error.detail
        except (KinematicsError, TypeError, ValueError, OverflowError) as error:
            # The error quotes the page's numbers, however many there are.
            return {"why": "invalid", "text": str(error)[:_LONGEST_REASON]}
        joints = dict(zip(chain.joint_names, q.tolist(), strict=True))
        return {"why": why, "text": text, "joints": joints, "position": pose[:3, 3].tolist(),
                "orientation": quaternion_from_matrix(pose[:3, :3]).tolist(), "ghost": self._ghost(chain, joints)}


def ghost(picture: SceneText | None, chain: Chain, joints: Mapping[str, float]) -> dict[str, Any] | None:
    """Drawing of an arm of the scene ``picture`` (:class:`lab_web.scene.SceneText`, or None) at other ``joints``:
    ``revision``; ``base``, the pose of the chain's base in the world, and ``links`` {number in the scene: pose}, as the
    upper three rows, 12 numbers. None where the scene has no such arm.
    """
    found = _body_of(picture, joints)
    if picture is None or found is None:
        return None
    first, body = found
    moved = body.moved(joints)
    return {"revision": picture.revision, "base": _rows(_base(body, moved, chain, joints)),
            "links": {first + number: _rows(pose) for number, pose in moved.items()}}


def base_of(picture: SceneText | None, chain: Chain, joints: Mapping[str, float]) -> np.ndarray | None:
    """The pose of the chain's base in the scene ``picture`` (4 x 4), or None where the scene has no such arm."""
    found = _body_of(picture, joints)
    return None if found is None else _base(found[1], {}, chain, joints)


def _body_of(picture: SceneText | None, joints: Mapping[str, float]) -> tuple[int, DrawnModel] | None:
    """(number of its first link in the scene, body) of the robot with these joints, or None."""
    first = 0
    for body in picture.bodies.values() if picture else ():
        if set(joints) <= set(body.joint_names):
            return first, body
        first += len(body.parts)
    return None


def _base(body: DrawnModel, moved: Mapping[int, np.ndarray], chain: Chain, joints: Mapping[str, float]) -> np.ndarray:
    frames = chain.link_frames([joints[name] for name in chain.joint_names])
    # The one that is nearest to the base.
    link = next(name for name in chain.link_names if name in body.link_names)
    number = body.link_names.index(link)
    return moved.get(number, body.matrices[number]) @ inverse(frames[link])


def _rows(pose: np.ndarray) -> list[float]:
    return [round(float(value), 5) for value in pose[:3].ravel()]
