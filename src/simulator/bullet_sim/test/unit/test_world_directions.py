# SPDX-License-Identifier: BSD-3-Clause
"""Without fdir1, friction on a floor is mu along the world's y axis and mu2 along x, as ODE's dPlaneSpace has it."""
import math

import numpy as np
import pytest

from bullet_sim import Pose, World
from bullet_sim.world_directions import scales_of
from urdf_model import Surface, parse_urdf

G, PUSH = 9.81, 3.0  # of the force on 1 kg, more than the smaller friction and less than the larger one [N]
BLOCK = """<robot name="block"><link name="it"><inertial><mass value="1"/><inertia ixx="0.01" iyy="0.02" izz="0.025"
ixy="0" ixz="0" iyz="0"/></inertial><collision><geometry><box size="0.3 0.2 0.1"/></geometry></collision></link>
<gazebo reference="it">%s</gazebo></robot>"""
SLIPPERY_ALONG_Y, SLIPPERY_ALONG_X = "<mu1>0.1</mu1><mu2>0.6</mu2>", "<mu1>0.6</mu1><mu2>0.1</mu2>"


@pytest.fixture
def world():
    world = World(time_step_s=0.001, warn=pytest.fail)
    world.add_ground_plane()
    yield world
    world.close()


def upright(x, y, z, yaw=0.0):
    return Pose((x, y, z), (0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)))


def pushed(world, models, direction, seconds=0.5):
    """The speeds (k, 3) of models that the force has pushed."""
    for _ in range(round(seconds / world.time_step_s)):
        for model in models:
            centre = model.link_pose("it").position
            model.apply_wrench("it", PUSH * np.asarray(direction, dtype=float), (0, 0, 0), (*centre[:2], 0.02))
        world.step()
    return np.array([model.base_twist()[0] for model in models])


@pytest.mark.parametrize("surface, slides", [
    (SLIPPERY_ALONG_Y, (0, 1, 0)), (SLIPPERY_ALONG_X, (1, 0, 0)),
    ("<mu1>0.1</mu1>", (0, 1, 0)), ("<mu2>0.1</mu2>", (1, 0, 0))])  # Gazebo's default is 1
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_block_slides_along_one_of_the_worlds_axes_however_it_stands(world, surface, slides, sign):
    blocks = [world.spawn(parse_urdf(BLOCK % surface), "block_%d" % turn, upright(turn, 0, 0.05, turn * math.pi / 2))
              for turn in range(4)]
    pushed(world, blocks, (0, 0, 0), 0.1)
    still = pushed(world, blocks, sign * (1.0 - np.array(slides)) * (1, 1, 0))
    assert np.abs(still).max() < 0.01
    found = pushed(world, blocks, sign * np.array(slides))
    expected = sign * np.array(slides) * (PUSH - 0.1 * G) * 0.5
    assert found == pytest.approx(np.tile(expected, (4, 1)), abs=0.03)


def test_the_directions_stay_where_they_are_as_a_block_is_put_elsewhere_and_rebuilt(world):
    block = world.spawn(parse_urdf(BLOCK % SLIPPERY_ALONG_Y), "block", upright(0, 0, 0.05))
    block.set_base_pose(upright(0, 0, 0.05, math.pi / 2))
    pushed(world, [block], (0, 0, 0), 0.1)
    assert abs(pushed(world, [block], (1, 0, 0))).max() < 0.01
    block.set_inertial("it", 1.0, np.diag([0.01, 0.02, 0.025]), (0.001, 0, 0))
    assert abs(pushed(world, [block], (1, 0, 0))).max() < 0.01
    assert pushed(world, [block], (0, 1, 0))[0, 1] > 0.5


def test_a_floors_two_coefficients_hold_for_all_on_it(world):
    floor = parse_urdf('<robot name="floor"><link name="it"><collision><geometry><box size="9 9 0.1"/></geometry>'
                       "</collision></link></robot>")
    floor.links["it"].surface = Surface(friction=0.1, friction_across=0.6)
    world.spawn(floor, "floor", upright(0, 0, 0.05, math.pi / 2), static=True)
    block = world.spawn(parse_urdf(BLOCK % ""), "block", upright(0, 0, 0.15))
    pushed(world, [block], (0, 0, 0), 0.1)
    assert abs(pushed(world, [block], (1, 0, 0))).max() < 0.01
    assert pushed(world, [block], (0, 1, 0))[0, 1] == pytest.approx((PUSH - 0.1 * G) * 0.5, abs=0.05)


def test_scales_of_a_wheel_do_not_depend_on_how_far_it_has_rolled():
    for heading, at_axle in ((0.0, 0.2), (math.pi / 2, 1.0), (math.pi / 4, 0.6), (math.pi, 0.2)):
        for roll in np.linspace(0.1, 1.4, 5):
            turn = (math.cos(heading / 2) * math.cos(roll / 2), math.sin(heading / 2) * math.sin(roll / 2) * -1.0,
                    math.cos(heading / 2) * math.sin(roll / 2), math.sin(heading / 2) * math.cos(roll / 2))
            scales = scales_of(0.1, 0.5, (*turn[1:], turn[0]))  # turned about its axle, y, and then about z
            assert scales == pytest.approx([1.2 - at_axle, at_axle, 1.2 - at_axle])
