# SPDX-License-Identifier: BSD-3-Clause
"""Checks planned trajectories with PyBullet, which shares no code with the planner.

Trajectories are made as in move_group and sampled as in a controller: 10,000 states in five rounds. No state may touch
anything or exceed the limits of position, velocity and acceleration. Meshes are used as they are, not as convex hulls;
PyBullet does not check two such meshes against each other.
"""
import functools
import re
import tempfile
import time
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import planning_problems as problems
import pybullet
import rospkg

import xacro
from motion_planning.constraints import ConstraintSet, JointTarget, sampler
from motion_planning.pipeline import PlanningFailure, PlanQuery, Tools, plan
from motion_planning.planners import plan_path, prepare
from urdf_model import Box, Cylinder

# States of each of five kinds of problems in a round, time between two states [s], and greatest number of problems of a
# kind.
STATES, STEP_S, PROBLEMS = 400, 0.05, 40
# PyBullet keeps a margin of 1 mm around convex shapes: a contact is deeper than that [m].
MARGIN = 0.001


def measure(report, quick, number):
    states = STATES // 10 if quick else STATES
    baxter, probot = problems.baxter(), problems.probot()
    kinds = [("Baxter, one arm", baxter, problems.BAXTER_PLACE), ("PROBOT", probot, problems.PROBOT_PLACE)]
    some = {}
    for name, robot, place in kinds:
        prepare(robot.exact)
        for kind in (problems.table, problems.shelf):
            some["%s, %s" % (name, kind.__name__)] = map(functools.partial(kind, robot, place),
                                                         range(number * PROBLEMS, (number + 1) * PROBLEMS))
    try:
        some["both arms, bookshelf"] = problems.bookshelf(baxter)[number::97]
    except OSError as error:
        print("the bookshelf problems could not be fetched (%s); they are left out" % error)
    worlds = {id(baxter): World("baxter_description", "urdf/baxter.urdf.xacro", baxter.model),
              id(probot): World("probot_description", "urdf/probot_anno.xacro", probot.model)}
    for title, of_kind in some.items():
        look(report, title, of_kind, worlds, states)


def look(report, title, some, worlds, states):
    """Note the faults of the first ``states`` states of trajectories for ``some`` problems."""
    seen = touching = beyond = 0
    speed = acceleration = 0.0
    for problem in some:
        if seen >= states:
            break
        timed = trajectory(problem)
        if timed is None:
            continue
        world, model = worlds[id(problem.robot)], problem.robot.model
        indices = model.groups[problem.group].indices
        times = np.append(np.arange(0.0, timed.times[-1], STEP_S), timed.times[-1])
        postures, velocities, accelerations = timed.sampled(times)
        # The joints' actual motion between two states, not only the velocities in the trajectory.
        travelled = np.abs(np.diff(postures, axis=0)) / np.diff(times)[:, None].clip(1e-9)
        fastest = np.concatenate([np.abs(velocities), travelled[np.diff(times) > 1e-6]])
        speed = max(speed, float((fastest / model.velocity[indices]).max()))
        acceleration = max(acceleration, float((np.abs(accelerations) / model.acceleration[indices]).max()))
        world.furnish(problem.scene)
        for posture in postures:
            q = problem.scene.state.with_q(posture, indices).q
            touches = world.touching(model.joint_values(q))  # including joints that mimic others
            if touches:
                print("%s: %s" % (problem.name, touches))
            touching += bool(touches)
            beyond += world.beyond(dict(zip(model.groups[problem.group].joints, posture, strict=True)))
        seen += len(postures)
    if not seen:
        return
    report.add("%s: states that touch something" % title, 100.0 * touching / seen, "%", samples=seen, pooled=True,
               most=0.0)
    report.add("%s: states out of limits" % title, 100.0 * beyond / seen, "%", samples=seen, pooled=True, most=0.0)
    report.add("%s: greatest velocity" % title, speed, "of the limit", samples=seen, most=1.0001)
    report.add("%s: greatest acceleration" % title, acceleration, "of the limit", samples=seen, most=1.0001)


def trajectory(problem):
    """Return the Timed of a problem, None if there is no plan."""
    group = problem.robot.model.groups[problem.group]
    goal = ConstraintSet("goal", [JointTarget(joint, float(value), 1e-4, 1e-4)
                                  for joint, value in zip(group.joints, problem.goal, strict=True)])
    scene = problem.scene.with_state(problem.scene.state.with_q(problem.start, group.indices))
    try:
        return plan(PlanQuery(scene, problem.group, [goal]),
                    Tools(problem.robot.exact, plan_path, sampler, time.monotonic)).timed
    except PlanningFailure as error:
        print("%s: %s" % (problem.name, error))
        return None


class World:
    """A robot and the objects around it, in PyBullet."""

    def __init__(self, package, file, model):
        self.client = pybullet.connect(pybullet.DIRECT)
        packages = rospkg.RosPack()
        text = xacro.process_file(str(Path(packages.get_path(package)) / file)).toxml()
        text = re.sub(r"package://([^/\"]+)", lambda found: packages.get_path(found[1]), text)
        tree = ElementTree.fromstring(text)
        for collision in tree.iter("collision"):
            collision.set("concave", "yes")  # the mesh itself, not the convex hull of it
        ElementTree.indent(tree)  # PyBullet breaks long lines anywhere
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "robot.urdf"
            path.write_bytes(ElementTree.tostring(tree))
            self.robot = pybullet.loadURDF(str(path), useFixedBase=True, physicsClientId=self.client,
                                           flags=pybullet.URDF_USE_INERTIA_FROM_FILE)
        self.links, self.joints, self.limits = {}, {}, {}
        for number in range(pybullet.getNumJoints(self.robot, physicsClientId=self.client)):
            about = pybullet.getJointInfo(self.robot, number, physicsClientId=self.client)
            self.links[number] = about[12].decode()
            self.joints[about[1].decode()] = number
            self.limits[about[1].decode()] = about[8:10]
        self.things = {}
        self.moving = set()
        for number in self.links:  # parents come first
            about = pybullet.getJointInfo(self.robot, number, physicsClientId=self.client)
            if about[2] != pybullet.JOINT_FIXED or about[16] in self.moving:
                self.moving.add(number)
        # Pairs that the SRDF disables, and pairs of links without a moving joint between them, are not collisions.
        disabled = {frozenset(pair) for pair in model.disabled}
        shaped = [number for number in self.links
                  if pybullet.getCollisionShapeData(self.robot, number, physicsClientId=self.client)]
        self.pairs = [(a, b) for k, a in enumerate(shaped) for b in shaped[:k]
                      if frozenset((self.links[a], self.links[b])) not in disabled
                      and (a in self.moving or b in self.moving)]

    def furnish(self, scene):
        """Replace all objects by those of a Scene."""
        for thing in self.things:
            pybullet.removeBody(thing, physicsClientId=self.client)
        self.things = {}
        for item in scene.objects.values():
            for shape, inner in item.shapes:
                self.things[self._thing(shape, item.pose @ inner)] = item.id

    def _thing(self, shape, pose):
        if isinstance(shape, Box):
            made = pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=[0.5 * side for side in shape.size],
                                                 physicsClientId=self.client)
        elif isinstance(shape, Cylinder):
            made = pybullet.createCollisionShape(pybullet.GEOM_CYLINDER, radius=shape.radius, height=shape.length,
                                                 physicsClientId=self.client)
        else:
            raise TypeError("expected a box or a cylinder, found a %s" % type(shape).__name__)
        if not np.allclose(pose[:3, :3], np.eye(3), atol=1e-6):
            raise ValueError("expected an upright object, found a rotated one: %s" % pose[:3, :3].tolist())
        return pybullet.createMultiBody(0.0, made, -1, pose[:3, 3].tolist(), physicsClientId=self.client)

    def touching(self, values):
        """Return the names of two bodies that touch with the joints at ``values`` {joint: rad}, an empty tuple if none
        do."""
        for joint, value in values.items():
            if joint in self.joints:
                pybullet.resetJointState(self.robot, self.joints[joint], value, physicsClientId=self.client)
        for thing, name in self.things.items():
            for point in pybullet.getClosestPoints(self.robot, thing, 0.0, physicsClientId=self.client):
                # The robot's base link may touch the furniture that it stands on.
                if point[8] < -MARGIN and point[3] in self.moving:
                    return self.links[point[3]], name
        for a, b in self.pairs:
            for point in pybullet.getClosestPoints(self.robot, self.robot, 0.0, a, b, physicsClientId=self.client):
                if point[8] < -MARGIN:
                    return self.links[a], self.links[b]
        return ()

    def beyond(self, values):
        """Whether one of ``values`` {joint: rad} is out of the limits that the description states."""
        return any(not self.limits[joint][0] - 1e-6 <= value <= self.limits[joint][1] + 1e-6
                   for joint, value in values.items() if self.limits[joint][0] <= self.limits[joint][1])
