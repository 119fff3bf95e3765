# SPDX-License-Identifier: BSD-3-Clause
"""Friction along fdir1 is mu, across it mu2: the scene of Gazebo's test/worlds/friction_dir_test.world."""
import math

import numpy as np
import pytest

from bullet_sim import Pose, World
from bullet_sim.directions import turned
from urdf_model import parse_urdf

SIDEWAYS = 1.0  # of gravity [m/s²]
BOX = """<robot name="box"><link name="it"><inertial><mass value="1"/><inertia ixx="%(ixx)g" iyy="0.02416666667" ixy="0"
ixz="0" iyz="0" izz="0.04166666667"/></inertial><collision><origin rpy="0 0 %(turn)g"/><geometry>
<box size="0.5 0.5 0.2"/></geometry></collision></link><gazebo reference="it"><mu1>%(mu)g</mu1><mu2>%(mu2)g</mu2>
<fdir1>%(x).15g %(y).15g 0</fdir1></gazebo></robot>"""
BALL = """<robot name="ball"><link name="it"><inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0"
ixz="0" iyz="0"/></inertial><collision><geometry><sphere radius="0.5"/></geometry></collision></link>
<gazebo reference="it"><mu1>100</mu1><mu2>0</mu2><fdir1>1 0 0</fdir1></gazebo></robot>"""


@pytest.fixture
def world():
    world = World(time_step_s=0.001, gravity=(0.0, SIDEWAYS, -9.81), warn=pytest.fail)
    world.add_ground_plane()
    yield world
    world.close()


def box(angle=0.0, turn=0.0, mu=100.0, mu2=0.0, ixx=0.02416666667):
    return parse_urdf(BOX % {"ixx": ixx, "turn": turn, "mu": mu, "mu2": mu2, "x": math.cos(angle),
                             "y": math.sin(angle)})


def run(world, seconds):
    for _ in range(round(seconds / world.time_step_s)):
        world.step()


def test_boxes_slide_across_their_direction_alone(world):
    """As Gazebo's: 1.5 s, the direction given by fdir1, by the collision's pose, or by the box's own."""
    boxes = {}
    for number in range(11):
        angle = math.pi * number / 10  # of where it can slide
        along = angle + math.pi / 2
        for row, (robot, yaw) in enumerate((
                (box(along), 0.0), (box(math.pi / 2, angle), 0.0), (box(math.pi / 2), angle), (box(0.0, along), 0.0))):
            place = Pose((3.0 * number, 3.0 * row, 0.1), (0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)))
            boxes[world.spawn(robot, "box_%d_%d" % (row, number), place)] = angle
    run(world, 1.5)
    for model, angle in boxes.items():
        speed = SIDEWAYS * math.sin(angle) * 1.5 * np.array([math.cos(angle), math.sin(angle)])
        assert model.base_twist()[0][:2] == pytest.approx(speed, abs=0.02), model.name


def test_a_ball_that_spins_about_the_vertical_starts_to_roll(world):
    """The direction turns with the body."""
    ball = world.spawn(parse_urdf(BALL), "ball", Pose((0, 0, 0.5)))
    ball.set_base_twist((0, 0, 0), (0, 0, 1.0))
    run(world, 1.5)
    still = world.spawn(parse_urdf(BALL), "still", Pose((5, 0, 0.5)))
    run(world, 0.5)
    assert ball.base_twist()[1][0] < -1.0 and abs(still.base_twist()[1][0]) < 0.05


@pytest.mark.parametrize("mu, mu2", [(0.5, 0.05), (0.05, 0.5)])
def test_either_coefficient_may_be_the_larger_one(world, mu, mu2):
    along, across = (0.0 if least > 0.1 else SIDEWAYS - least * 9.81 for least in (mu, mu2))
    one = world.spawn(box(math.pi / 2, mu=mu, mu2=mu2), "along", Pose((0, 0, 0.1)))
    other = world.spawn(box(0.0, mu=mu, mu2=mu2), "across", Pose((3, 0, 0.1)))
    run(world, 1.0)
    assert one.base_twist()[0][1] == pytest.approx(along, abs=0.02)
    assert other.base_twist()[0][1] == pytest.approx(across, abs=0.02)


def test_a_direction_between_the_axes_of_inertia_is_told():
    said = []
    world = World(time_step_s=0.001, warn=said.append)
    world.spawn(box(math.radians(20.0), ixx=0.01), "box")
    world.spawn(box(math.radians(90.0), ixx=0.01), "straight")
    assert len(said) == 1 and "20 degrees" in said[0]
    world.close()


def test_axes_turn_where_moments_are_the_same():
    direction = np.array([0.6, 0.8, 0.0])
    _, axes, off = turned(np.array([1.0, 1.0, 2.0]), np.eye(3), direction)
    assert off == 0.0 and axes[:, 0] == pytest.approx(direction) and np.linalg.det(axes) == pytest.approx(1.0)
    _, axes, off = turned(np.array([2.0, 2.0, 2.0]), np.eye(3), np.array([0.6, 0.0, 0.8]))
    assert off == 0.0 and axes[:, 0] == pytest.approx((0.6, 0.0, 0.8)) and np.linalg.det(axes) == pytest.approx(1.0)
    assert turned(np.array([1.0, 2.0, 3.0]), np.eye(3), direction)[2] == pytest.approx(math.acos(0.8))
