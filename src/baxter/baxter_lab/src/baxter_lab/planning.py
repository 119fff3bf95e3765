# SPDX-License-Identifier: BSD-3-Clause
"""Paths around the things of a lab, by `motion_planning`; exact geometry decides."""
from __future__ import annotations

import time
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from baxter_model import JOINTS, finger_prefix, tip_of
from baxter_sim_hardware.arms.joint_command import Mode

from .descriptions import baxter_srdf, joint_limits

if TYPE_CHECKING:
    from motion_planning.timing import Timed

    from .lab import Lab

FLOOR, _UNDER_FLOOR_M = "floor", 0.01  # the pedestal stands on it, which is no collision
_SETTLE_S = 5.0  # [simulated s] for the last millimetres behind a path


def _lowered(pose):
    lower = pose.copy()
    lower[2, 3] -= _UNDER_FLOOR_M
    return lower


class LabPlanner:
    """The planner of a Lab; made at the first plan, which takes seconds. lab: `lab.Lab`."""

    def __init__(self, lab: Lab) -> None:
        self._lab, self._exact = lab, None
        self._limits: dict[str, dict[str, float]] = {}

    def _checker(self):
        if self._exact is None:
            from motion_planning.exact import ExactChecker
            from motion_planning.model import MeshReader, PlanningModel
            from motion_planning.planners.planning import prepare

            lab = self._lab
            model = PlanningModel.from_xml(lab.robot_urdf, baxter_srdf(lab.options.arguments()))
            self._exact = ExactChecker(model, MeshReader(lab.find_mesh))
            prepare(self._exact)
            self._limits = joint_limits()["joint_limits"]
        return self._exact

    def _scene(self, side, held):
        from motion_planning.scene import Scene, WorldObject

        lab, model = self._lab, self._checker().model
        things = [WorldObject(name, _lowered(thing.pose) if name == FLOOR else thing.pose, ((thing.shape, np.eye(4)),))
                  for name, thing in lab.things.items() if thing.shape is not None]
        scene = Scene(model).with_objects(things)
        simulated = lab.robot.simulated
        found = zip(simulated.model.joint_names, simulated.model.read_joints()[0].tolist(), strict=True)
        scene = scene.with_state(scene.state.with_joints({name: q for name, q in found if name in model.index}))
        if held is not None:
            hand = [link for link in model.links if link.startswith((finger_prefix(side), side + "_gripper"))]
            scene = scene.attach(held, tip_of(side), touch_links=["%s_hand" % side, *hand])
        return scene

    def plan(self, side: str, goal: npt.ArrayLike, held: str | None, time_limit_s: float, seed: int) -> Timed:
        """As `Lab.plan`."""
        from motion_planning.planners.planning import SearchOptions, plan_path
        from motion_planning.timing import time_path

        arm, group = self._lab.robot.arms[side], "%s_arm" % side
        goal = np.asarray(goal, dtype=float)
        target = goal if goal.shape == (len(JOINTS),) else arm.ik(goal)
        exact = self._checker()
        search = SearchOptions(exact, seed, time_limit_s, time.monotonic)
        path = plan_path(self._scene(side, held), group, arm.angles, target[None], search)
        limits = [self._limits[name] for name in arm.joint_names]
        return time_path(path.points, np.array([row["max_velocity"] for row in limits]),
                         np.array([row["max_acceleration"] for row in limits]))

    def follow(self, side: str, timed: Timed) -> None:
        """As `Lab.follow`."""
        lab, arm = self._lab, self._lab.robot.arms[side]
        begin, end = lab.time_s, timed.positions[-1]
        while lab.time_s - begin < timed.duration:
            positions = timed.sampled(np.array([lab.time_s - begin]))[0][0]
            arm.command(Mode.RAW_POSITION, positions)
            lab.step()
        arm.command(Mode.POSITION, end)
        lab.wait(lambda: arm.is_at(end), _SETTLE_S, "the end of the %s arm's path" % side)
