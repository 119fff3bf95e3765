# SPDX-License-Identifier: BSD-3-Clause
"""Cost of Baxter's self-collision: the physics step with it, without it, and while parts press on each other.

The worlds take turns, step by step, so that other load on the machine affects all of them.
"""
import statistics
import time

import numpy as np
import rospkg

import xacro
from baxter_model import SIDES, joint_names, poses
from baxter_sim_hardware.plugin import BaxterPlugin
from bullet_sim import Pose, World
from bullet_sim.solids import with_solids
from model_files.resources import ResourceFinder
from urdf_model import parse_urdf

NAMES = [name for side in SIDES for name in joint_names(side)]
PRESSING = {  # the arms' start, and their targets, behind each other or the body
    "arm on arm": (dict.fromkeys(NAMES, 0.0), {"left_s0": -1.5, "right_s0": 1.5}),
    "hand on body": ("neutral", {"left_s0": -1.7, "left_s1": -0.3, "left_e1": 2.6}),
    "both hands": ("neutral", {"left_s0": -1.7, "left_s1": -0.3, "left_e1": 2.6,
                               "right_s0": 1.7, "right_s1": -0.3, "right_e1": 2.6}),
}


class Lab:
    """Baxter with its arms held, with or without self-collision."""

    def __init__(self, robot, with_pairs):
        options = BaxterPlugin.spawn_options(robot, None)
        robot = with_solids(robot, options.pop("solids"))
        if not with_pairs:
            options["self_collision_pairs"] = ()
        self.world = World(find_mesh=ResourceFinder())
        self.model = self.world.spawn(robot, "baxter", Pose((0.0, 0.0, 0.93)), **options)
        self.everything = np.arange(len(self.model.joint_names))
        self.times = []

    def place(self, angles):
        index = self.model.index(list(angles))
        wanted = np.clip(list(angles.values()), self.model.lower[index], self.model.upper[index])
        self.model.set_joint_positions(index, wanted)
        self.aim(self.model.read_joints()[0])

    def aim(self, position):
        self.model.drive_position(self.everything, position, self.model.max_effort)

    def go(self, goal, seconds=4.0):
        """Ramp the joints to {joint: angle}; obstacles stop them, and they keep pushing."""
        start = self.model.read_joints()[0]
        end = start.copy()
        end[self.model.index(list(goal))] = list(goal.values())
        ticks = round(seconds / self.world.time_step_s)
        for tick in range(ticks):
            here = self.model.read_joints()[0]
            self.aim(np.clip(start + (end - start) * tick / ticks, here - 1e-2, here + 1e-2))
            self.world.step()

    def step(self):
        begin = time.perf_counter()
        self.world.step()
        self.times.append(time.perf_counter() - begin)

    def touches(self):
        return sum(contact.model_a == contact.model_b for contact in self.world.contacts(self.model)
                   if contact.distance <= 0.0)


def step_times(labs, steps):
    for lab in labs:
        lab.times = []
    for _ in range(steps):
        for lab in labs:
            lab.step()
    return [1e6 * statistics.median(lab.times) for lab in labs]


def measure(report, quick, number):
    steps = 200 if quick else 2000
    file = rospkg.RosPack().get_path("baxter_description") + "/urdf/baxter.urdf.xacro"
    robot = parse_urdf(xacro.process_file(file).toxml(), source=file)

    def angles(pose):
        return {name: poses().angles(pose, name.split("_")[0])[name] for name in NAMES}

    bare, whole = Lab(robot, False), Lab(robot, True)
    for pose in poses().names:
        for lab in (bare, whole):
            lab.place(angles(pose))
            lab.step()
        off, on = step_times((bare, whole), steps)
        report.add("step, %s" % pose, on, "us", ("without self-collision", off))
    for title, (start, goal) in PRESSING.items():
        start = start if isinstance(start, dict) else angles(start)
        for lab in (bare, whole):
            lab.place(start)
        whole.go(goal)
        off, on = step_times((bare, whole), steps)
        if not whole.touches():
            raise SystemExit("%s: there are no contacts, so the figure is invalid" % title)
        report.add("step, %s" % title, on, "us", ("without self-collision", off))
