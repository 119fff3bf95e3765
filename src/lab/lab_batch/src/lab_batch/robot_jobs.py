# SPDX-License-Identifier: BSD-3-Clause
"""Jobs about robots, on cores that need no ROS. What a job needs is imported when it starts."""
from __future__ import annotations

import math
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .job import Job

if TYPE_CHECKING:
    import numpy as np
    from numpy.random import Generator

    from arm_kinematics.chain import Chain
    from motion_planning.model.group import Group
    from motion_planning.scene.scene import Scene


def _package_file(package: str, file: str) -> Path:
    import rospkg
    return Path(rospkg.RosPack().get_path(package)) / file


def _expanded(package: str, file: str) -> str:
    from urdf_model import description_text
    return description_text(_package_file(package, file))


class ReachPart(Job):
    """Computes a part of a map of reach, 128 cells, into the folder `out`, which all machines must see.

    The seed is the number of the part. `reach` with the same options and `--out` makes the map of the parts.
    """

    def __init__(self, out: str = "", side: str = "left", cell: float = 0.08, orientations: int = 50,
                 tool: str | None = None, starts: int = 40, self_collision: bool = True) -> None:
        self._folder = out
        words = ["--side", str(side), "--cell", str(cell), "--orientations", str(orientations), "--starts", str(starts)]
        if tool is not None:
            words += ["--tool", *map(str, tool)]
        self._words = [*words, *["--self-collision"] * bool(self_collision), "--out", str(out)]

    def start(self) -> None:
        from baxter_sim_kinematics import reach_commands

        if not self._folder:
            raise ValueError("set out, the folder of the map: --set out=FOLDER")
        self._parts = reach_commands.map_of(self._words)

    def run(self, seed: int) -> dict[str, float]:
        firsts = list(self._parts.settings.parts())
        if seed >= len(firsts):
            raise ValueError("the map has %d parts, 0 to %d" % (len(firsts), len(firsts) - 1))
        values = self._parts.compute(firsts[seed])
        return {"parts": len(firsts), "cells": len(values.reached), "reached_poses": int(values.reached.sum()),
                "reached_percent": float(100.0 * values.reached.mean())}


class Planning(Job):
    """Plans a path of one of Baxter's arms between two random postures among random boxes on a table."""

    def __init__(self, side: str = "left", boxes: int = 7, time_limit_s: float = 10.0) -> None:
        self._group, self._boxes, self._limit_s = side + "_arm", boxes, time_limit_s

    def start(self) -> None:
        from model_files.resources import ResourceFinder
        from motion_planning.exact import ExactChecker
        from motion_planning.model import MeshReader, PlanningModel
        from motion_planning.planners.planning import prepare

        self._model = PlanningModel.from_xml(_expanded("baxter_description", "urdf/baxter.urdf.xacro"),
                                             _expanded("baxter_moveit_config", "config/baxter.srdf.xacro"))
        if self._group not in self._model.groups:
            raise ValueError("side must be left or right")
        self._exact = ExactChecker(self._model, MeshReader(ResourceFinder()))
        prepare(self._exact)

    def run(self, seed: int) -> dict[str, Any]:
        import numpy as np

        from motion_planning.planners.errors import NoPath
        from motion_planning.planners.planning import SearchOptions, plan_path

        rng = np.random.default_rng(seed)
        scene, group = self._scene(rng), self._model.groups[self._group]
        start, goal = (self._free_posture(scene, group, rng) for _ in range(2))
        search = SearchOptions(self._exact, seed, self._limit_s, time.process_time)
        try:
            path = plan_path(scene, self._group, start, goal[None], search)
        except NoPath as failure:
            return {"planned": False, "reason": str(failure), "straight_rad": float(np.linalg.norm(goal - start))}
        steps = np.linalg.norm(np.diff(path.points, axis=0), axis=1)
        return {"planned": True, "length_rad": float(steps.sum()), "corners": len(path.points),
                "straight_rad": float(np.linalg.norm(goal - start))}

    def _scene(self, rng: Generator) -> Scene:
        """A table before the robot, with boxes on it."""
        import numpy as np

        from motion_planning.scene import Scene, WorldObject
        from urdf_model import Box
        from urdf_model.transforms import rigid, rpy_matrix

        top = rng.uniform(-0.2, 0.0)
        things = [("table", Box((0.7, 1.4, 0.04)), rigid(np.eye(3), (0.85, 0.0, top - 0.02)))]
        for number in range(self._boxes):
            size = rng.uniform((0.04, 0.04, 0.08), (0.12, 0.12, 0.35))
            place = (rng.uniform(0.6, 1.1), rng.uniform(-0.6, 0.6), top + 0.5 * size[2] + 0.002)
            things.append(("box%d" % number, Box(tuple(size)), rigid(rpy_matrix(0, 0, rng.uniform(0, 3)), place)))
        return Scene(self._model).with_objects(
            [WorldObject(name, pose, ((shape, np.eye(4)),)) for name, shape, pose in things])

    def _free_posture(self, scene: Scene, group: Group, rng: Generator) -> np.ndarray:
        state: Any = scene.state
        for _ in range(10_000):
            q = rng.uniform(*self._model.bounds[group.indices].T)
            if self._exact.free(scene, state.with_q(q, group.indices), group.name):
                return q
        raise ValueError("no random posture is free of collisions")


class PidTuning(Job):
    """Tries random gains of a PID on one joint of a PROBOT that is driven by efforts: a step, simulated.

    Gains are drawn on a logarithmic scale between the bounds. The other joints are held in place.
    """

    def __init__(self, joint: str = "joint_2", step_rad: float = 0.3, seconds: float = 2.0,
                 p: tuple[float, float] = (10.0, 3000.0), i: tuple[float, float] = (0.1, 300.0),
                 d: tuple[float, float] = (0.1, 100.0)) -> None:
        self._joint, self._step, self._seconds, self._bounds = joint, step_rad, seconds, {"p": p, "i": i, "d": d}

    def start(self) -> None:
        from bullet_sim import World
        from model_files.resources import ResourceFinder
        from urdf_model import parse_urdf

        for name, (low, high) in self._bounds.items():
            if not 0.0 < low <= high < math.inf:
                raise ValueError("bounds of %s are (%s, %s); the first must be above 0 and at most the second"
                                 % (name, low, high))
        self._world = World(find_mesh=ResourceFinder())
        self._arm = self._world.spawn(parse_urdf(_expanded("probot_description", "urdf/probot_anno.xacro")), "arm",
                                      static=True)
        if self._joint not in self._arm.joint_names:
            raise ValueError("joint is %r; the robot has %s" % (self._joint, ", ".join(self._arm.joint_names)))

    def run(self, seed: int) -> dict[str, Any]:
        import numpy as np

        from controller_manager.pid import Gains, Pid

        rng = np.random.default_rng(seed)
        gains = {name: math.exp(rng.uniform(math.log(low), math.log(high)))
                 for name, (low, high) in self._bounds.items()}
        arm, dt = self._arm, self._world.time_step_s
        index = arm.index([self._joint])
        limit = arm.max_effort[index]
        arm.reset()
        arm.set_joint_positions(np.arange(len(arm.joint_names)), np.zeros(len(arm.joint_names)))
        others = np.setdiff1d(np.arange(len(arm.joint_names)), index)
        arm.drive_position(others, np.zeros(len(others)), arm.max_effort[others])
        pid = Pid(Gains(gains["p"], gains["i"], gains["d"], -limit, limit, False))
        errors = []
        for _ in range(round(self._seconds / dt)):
            error = self._step - arm.read_joints()[0][index]
            arm.drive_effort(index, np.clip(pid.update(error, dt), -limit, limit))
            self._world.step()
            errors.append(float(error[0]))
        return {**gains, **_step_figures(np.array(errors), self._step, dt)}

    def end(self) -> None:
        self._world.close()


def _step_figures(errors: np.ndarray, step: float, dt: float) -> dict[str, Any]:
    """Figures of a step's answer, from its errors (n,) [rad] every ``dt`` [s]: overshoot, settling time to 5 % (the
    whole time where it does not settle), integral of time times error, error at the end."""
    import numpy as np

    outside = np.flatnonzero(np.abs(errors) > 0.05 * abs(step))
    settled = (outside[-1] + 1) * dt if len(outside) else 0.0
    times = dt * np.arange(len(errors))
    return {"overshoot_percent": float(max(0.0, -errors.min() / step * 100.0)), "settling_s": float(settled),
            "settles": bool(settled < dt * len(errors)), "itae": float((times * np.abs(errors)).sum() * dt),
            "final_error_rad": float(errors[-1])}


class Serials(Job):
    """How far the hands of the robot with a serial number, which is the seed, are from where the drawing has them.

    Over random postures, seen in the robot's base: what a program meets that trusts the drawing.
    """

    def __init__(self, postures: int = 500) -> None:
        self._postures = postures

    def start(self) -> None:
        import numpy as np

        from baxter_model import SIDES
        from baxter_sim_hardware import effects

        self._xml = _expanded("baxter_description", "urdf/baxter.urdf.xacro")
        self._rows = effects.read(effects.physical_robot())["serial"]
        self._drawing = {side: self._chain(self._xml, side) for side in SIDES}
        rng = np.random.default_rng(0)
        self._q = {side: rng.uniform(chain.lower, chain.upper, (self._postures, len(chain)))
                   for side, chain in self._drawing.items()}

    @staticmethod
    def _chain(xml: str, side: str) -> Chain:
        from arm_kinematics import Chain
        from baxter_model import BASE_FRAME, tip_of
        from urdf_model import parse_urdf

        return Chain.from_robot(parse_urdf(xml, source="robot"), BASE_FRAME, tip_of(side))

    def run(self, seed: int) -> dict[str, float]:
        import numpy as np

        from baxter_sim_hardware import individual

        xml, found = individual.described(self._xml, individual.checked(seed), self._rows), {}
        for side, drawing in self._drawing.items():
            own = self._chain(xml, side)
            pairs = [(drawing.fk(q), own.fk(q)) for q in self._q[side]]
            off = 1e3 * np.array([np.linalg.norm(a[:3, 3] - b[:3, 3]) for a, b in pairs])
            turned = [math.acos(min(1.0, max(-1.0, 0.5 * (np.trace(a[:3, :3].T @ b[:3, :3]) - 1.0)))) for a, b in pairs]
            found.update({side + "_hand_off_mean_mm": float(off.mean()), side + "_hand_off_most_mm": float(off.max()),
                          side + "_hand_turned_deg": math.degrees(max(turned))})
        return found
