# SPDX-License-Identifier: BSD-3-Clause
"""bullet_sim compared with PyBullet's own ways of loading the same robot: load time, tick time, gravity torques.

"""

import math
import statistics
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import pybullet

from baxter_model import SIDES, joint_names
from bullet_sim import Pose, World
from urdf_model import parse_urdf
from urdf_model.transforms import axis_rotation, rigid

VENDOR_URDF = "cmeel.prefix/share/example-robot-data/robots/baxter_description/urdf/baxter.urdf"
MESH_PREFIX = "package://example-robot-data/robots/"


def vendor_urdf():
    for folder in map(Path, sys.path):
        if (folder / VENDOR_URDF).is_file():
            return folder / VENDOR_URDF
    raise SystemExit("the package example-robot-data is not installed; ./baxter.sh setup installs it")


def median_us(function, repeats):
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        function()
        times.append(time.perf_counter() - start)
    return statistics.median(times) * 1e6


def gravity_by_energy(robot, names, q, step=1e-5):
    """The slope of the unmerged model's potential energy: the reference for gravity torques."""
    below = {}
    for joint in robot.joints.values():
        below.setdefault(joint.parent, []).append(joint)

    def energy(positions):
        frames, todo, total = {robot.root: np.eye(4)}, [robot.root], 0.0
        while todo:
            link = todo.pop()
            inertial = robot.links[link].inertial
            if inertial is not None:
                total += inertial.mass * 9.81 * (frames[link] @ np.append(inertial.centre, 1.0))[2]
            for joint in below.get(link, ()):
                value = positions.get(joint.name, 0.0)
                if joint.type == "prismatic":
                    motion = rigid(np.eye(3), joint.axis * value)
                else:
                    motion = rigid(axis_rotation(joint.axis, value), (0, 0, 0)) if joint.movable else np.eye(4)
                frames[joint.child] = frames[link] @ joint.origin @ motion
                todo.append(joint.child)
        return total

    slopes = []
    for i in range(len(names)):
        ends = []
        for sign in (1, -1):
            moved = np.array(q)
            moved[i] += sign * step
            ends.append(energy(dict(zip(names, moved, strict=True))))
        slopes.append((ends[0] - ends[1]) / (2 * step))
    return np.array(slopes)


def ours(robot, find_mesh, poses, names, steps):
    start = time.perf_counter()
    world = World(find_mesh=find_mesh)
    model = world.spawn(robot, "baxter", Pose((0, 0, 0.93)), static=True)
    load_s = time.perf_counter() - start
    index = model.index(names)
    torques = []
    for q in poses:
        full = np.zeros(len(model.joint_names))
        full[index] = q
        torques.append(model.gravity_efforts(full)[index])
    model.set_joint_positions(index, poses[0])
    model.drive_position(index, poses[0], model.max_effort[index])
    step_us = median_us(world.step, steps)

    def tick():
        model.read_joints()
        model.gravity_efforts()
        model.drive_position(index, poses[0], model.max_effort[index])
        world.step()

    tick_us = median_us(tick, steps)
    world.close()
    return load_s, step_us, tick_us, np.array(torques)


def pybullets_own(path, flags, poses, names, steps):
    client = pybullet.connect(pybullet.DIRECT)
    pybullet.setAdditionalSearchPath(str(path.parents[2]), physicsClientId=client)
    pybullet.setGravity(0, 0, -9.81, physicsClientId=client)
    pybullet.setPhysicsEngineParameter(fixedTimeStep=0.002, numSolverIterations=20, physicsClientId=client)
    text = path.read_text().replace(MESH_PREFIX, str(path.parents[2]) + "/")
    flags |= pybullet.URDF_USE_INERTIA_FROM_FILE
    with tempfile.NamedTemporaryFile("w", suffix=".urdf") as local:
        local.write(text)
        local.flush()
        start = time.perf_counter()
        body = pybullet.loadURDF(local.name, useFixedBase=True, flags=flags, physicsClientId=client)
        load_s = time.perf_counter() - start
    movable = {}
    for i in range(pybullet.getNumJoints(body, physicsClientId=client)):
        info = pybullet.getJointInfo(body, i, physicsClientId=client)
        if info[2] != pybullet.JOINT_FIXED:
            movable[info[1].decode()] = (i, len(movable))
    torques = []
    for q in poses:
        full = [0.0] * len(movable)
        for name, value in zip(names, q, strict=True):
            full[movable[name][1]] = value
        zero = [0.0] * len(movable)
        efforts = pybullet.calculateInverseDynamics(body, full, zero, zero, physicsClientId=client)
        torques.append([efforts[movable[name][1]] for name in names])
    joints = [movable[name][0] for name in names]
    for joint, value in zip(joints, poses[0], strict=True):
        pybullet.resetJointState(body, joint, value, physicsClientId=client)
    pybullet.setJointMotorControlArray(
        body, joints, pybullet.POSITION_CONTROL, list(poses[0]), forces=[100.0] * len(joints), physicsClientId=client
    )
    step_us = median_us(lambda: pybullet.stepSimulation(physicsClientId=client), steps)
    pybullet.disconnect(client)
    return load_s, step_us, math.nan, np.array(torques)


def compare(steps, seed):
    """Return {way of loading: (load [s], step [us], whole tick [us], greatest error of a gravity torque [Nm])}."""
    path = vendor_urdf()
    robot = parse_urdf(path.read_text(), path.name)
    names = [name for side in SIDES for name in joint_names(side)]
    limits = [robot.joints[name].limit for name in names]
    random = np.random.default_rng(seed)
    poses = [np.array([random.uniform(limit.lower, limit.upper) for limit in limits]) for _ in range(5)]
    reference = np.array([gravity_by_energy(robot, names, q) for q in poses])

    def find_mesh(uri):
        return uri.replace(MESH_PREFIX, str(path.parents[2]) + "/")

    rows = {
        "bullet_sim": ours(robot, find_mesh, poses, names, steps),
        "loadURDF": pybullets_own(path, 0, poses, names, steps),
        "loadURDF, merged": pybullets_own(path, pybullet.URDF_MERGE_FIXED_LINKS, poses, names, steps),
    }
    return {name: (*times, np.abs(torques - reference).max()) for name, (*times, torques) in rows.items()}


def measure(report, quick, number):
    found = compare(200 if quick else 2000, number)
    load_s, step_us, tick_us, error = found.pop("bullet_sim")
    for name, (other_load_s, other_step_us, _, other_error) in found.items():
        report.add(f"load Baxter, beside {name}", load_s, "s", (name, other_load_s))
        report.add(f"physics step, beside {name}", step_us, "us", (name, other_step_us))
        report.add(f"error of gravity torques, beside {name}", error, "Nm", (name, other_error))
    report.add("tick: read, gravity, drive, step", tick_us, "us", ("its step alone", step_us))
