# SPDX-License-Identifier: BSD-3-Clause
"""Right values of worlds that Gazebo's own integration tests look at: {file name: Check}."""
import math
from typing import NamedTuple

import numpy as np


class Check(NamedTuple):
    """``seconds``: when the world is looked at; ``errors(world)`` -> [(what, found, right, tolerance)]."""

    seconds: float
    errors: object


def _links(world, begins):
    """(model, link) of all links whose model, or model in a model, has a name that begins with ``begins``."""
    for model in world.models.values():
        for link in model.gazebo_links:
            names = (model.name + "::" + link).split("::")
            if any(name.startswith(begins) for name in names[:-1]):
                yield model, link


def _friction_demo(world):
    """Coulomb: a box accelerates by the difference of gravity across and friction."""
    for model, link in _links(world, "box_0"):
        mu = model.robot.links[link].surface.friction
        speed = 0.0 if mu >= 1.0 else (world.gravity[1] + mu) * world.time_s
        yield "vy of %s" % model.name, model.link_twist(link)[0][1], speed, 0.02


def _radial(world):
    """Boxes that start outwards at 9 m/s keep their direction."""
    for model, link in _links(world, "box_"):
        start = model.merged.frames[link].offset[:2, 3] if model.name == "boxes" else model._start[0].position[:2]
        x, y, _ = model.link_pose(link).position
        turn = math.remainder(math.atan2(y, x) - math.atan2(start[1], start[0]), 2.0 * math.pi)
        yield "direction of %s" % link, turn, 0.0, 0.01
        yield "way of %s" % link, math.hypot(x, y), 9.0 + 9.0 * 1.5 - 0.3 * 9.8 * 1.5 ** 2 / 2.0, 0.3


def _directions(world):
    """Boxes slide across fdir1 alone, as fast as gravity there makes them."""
    for model, link in _links(world, "box_"):
        x, y = model._start[0].position[:2]
        angle = math.atan2(y, x)
        speed = world.gravity[1] * math.sin(angle) * world.time_s * np.array([math.cos(angle), math.sin(angle)])
        found = model.link_twist(link)[0]
        for axis, name in enumerate("xy"):
            yield "v%s of %s" % (name, model.name), found[axis], speed[axis], 0.03


def _damping(world):
    """Gazebo's recorded values after 1.5 s."""
    model = world.models["model_4_mass_1_ixx_1_damping_10"]
    link = model.gazebo_links[0]
    centre = np.asarray(model.link_pose(link).position)
    inertial = model.inertial(link)
    arm = model.link_pose(link).matrix()[:3, :3] @ inertial.centre
    linear, angular = model.link_twist(link)
    speed = np.asarray(linear) + np.cross(angular, arm)
    yield "vy", speed[1], -10.2009, 0.02
    yield "vz", speed[2], -6.51755, 0.02
    yield "z", centre[2], 10.099, 0.01


def _self_collide(world):
    """Three of the four models' boxes stand on each other or pass through."""
    for model, link in _links(world, ""):
        if model.name != "ground_plane":
            yield "vz of %s::%s" % (model.name, link), model.link_twist(link)[0][2], 0.0, 0.01


def _bitmask(world):
    for name, z in (("box1", 0.5), ("box2", 0.5), ("box3", 1.5)):
        yield "z of %s" % name, world.models[name].model_pose().position[2], z, 2e-3
        yield "vz of %s" % name, world.models[name].model_twist()[0][2], 0.0, 2e-3
    yield "vz of box4", world.models["box4"].model_twist()[0][2], world.gravity[2] * world.time_s, 0.15


CHECKS = {
    "friction_demo.world": Check(2.0, _friction_demo),
    "friction_cone.world": Check(1.5, _radial),
    "friction_pyramid.world": Check(1.5, _radial),
    "friction_dir_test.world": Check(1.5, _directions),
    "damp_test.world": Check(1.5, _damping),
    "model_self_collide.world": Check(3.2, _self_collide),
    "collide_bitmask.world": Check(1.5, _bitmask),
}


def outcome(name, world):
    """"" for a world that is not looked at, "within" or the largest of its errors."""
    if name not in CHECKS:
        return ""
    rows = list(CHECKS[name].errors(world))
    what, found, right, tolerance = max(rows, key=lambda row: abs(row[1] - row[2]) / row[3])
    if abs(found - right) <= tolerance:
        return "%d values, the farthest: %s %.4g for %.4g" % (len(rows), what, found, right)
    return "OFF: %s is %.4g, expected %.4g within %g" % (what, found, right, tolerance)
