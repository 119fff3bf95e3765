# SPDX-License-Identifier: BSD-3-Clause
"""Free models that are put into other things come out without gaining speed."""
import numpy as np
import pytest

from bullet_sim import Pose, World
from bullet_sim.quiet_pybullet import pybullet
from urdf_model import Box, Link, Robot, Shape, parse_urdf

BOX = """<robot name="box"><link name="it"><inertial><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.01"/>
</inertial><collision><geometry><box size="0.2 0.2 0.2"/></geometry></collision></link>%s</robot>"""
# As many vehicles' wheels: their contacts correct an overlap within one step.
STIFF = '<gazebo reference="it"><kp>1e7</kp><kd>1</kd></gazebo>'


@pytest.fixture(params=[0.001, 0.002], ids=["1ms", "2ms"])
def world(request):
    world = World(time_step_s=request.param)
    yield world
    world.close()


def wall(world, name, x):
    """A fixed wall of 0.2 m, its middle at ``x``."""
    link = Link("link", collisions=[Shape(Box((0.2, 4.0, 4.0)), np.eye(4), "c", None, "link")])
    world.spawn(Robot(name, {"link": link}, {}, "link"), name, Pose((x, 0.0, 0.0)), static=True)


def highest(world, model, seconds=1.0):
    heights = []
    for _ in range(round(seconds / world.time_step_s)):
        world.step()
        heights.append(model.base_pose().position[2])
    return max(heights)


@pytest.mark.parametrize("surface", ["", STIFF], ids=["rigid", "stiff"])
def test_a_model_spawned_in_the_ground_stands_on_it(world, surface):
    world.add_ground_plane()
    box = world.spawn(parse_urdf(BOX % surface), "box", Pose((0.0, 0.0, -0.03)))
    assert highest(world, box) < 0.102
    assert box.base_pose().position == pytest.approx((0.0, 0.0, 0.1), abs=0.002)


def test_a_model_put_into_the_ground_keeps_its_velocity(world):
    world.add_ground_plane()
    box = world.spawn(parse_urdf(BOX % STIFF), "box", Pose((0.0, 0.0, 2.0)))
    box.set_base_pose(Pose((0.0, 0.0, 0.05)))
    box.set_base_twist((0.0, 0.0, 1.0), (0.0, 0.0, 0.0))
    assert box.base_pose().position[2] == 0.05  # as it was put, while no time passes
    assert highest(world, box, 0.5) == pytest.approx(0.1 + 1.0 / (2.0 * 9.81), abs=0.003)


@pytest.mark.parametrize("deep", [0.0003, 0.0009])
def test_a_soft_surface_is_not_a_spring_that_throws_its_body(world, deep):
    """Of ODE's it comes apart at max_vel, by default 0.01 m/s, and not at all up to min_depth. It left with 0.6 m/s."""
    world.add_ground_plane()
    soft = '<gazebo reference="it"><kp>1e6</kp><kd>1</kd><minDepth>0.001</minDepth></gazebo>'
    box = world.spawn(parse_urdf(BOX % soft), "box", Pose((0.0, 0.0, 0.1 - deep)))
    assert highest(world, box) < 0.1001
    assert box.base_pose().position[2] == pytest.approx(0.1, abs=1e-4)


def test_a_body_that_rests_in_a_soft_surface_stays_when_it_is_put_there_again(world):
    world.add_ground_plane()
    soft = '<gazebo reference="it"><kp>5e4</kp><kd>100</kd></gazebo>'
    box = world.spawn(parse_urdf(BOX % soft), "box", Pose((0.0, 0.0, 0.1)))
    highest(world, box)
    rest = box.base_pose()
    assert 5e-5 < 0.1 - rest.position[2] < 9.81 / 5e4
    box.set_base_pose(rest)
    world.step()
    assert box.base_pose().position[2] == pytest.approx(rest.position[2], abs=2e-5)


def test_a_shallow_overlap_stays(world):
    world.set_gravity((0.0, 0.0, 0.0))
    world.add_ground_plane()
    box = world.spawn(parse_urdf(BOX % ""), "box", Pose((0.0, 0.0, 0.0995)))
    world.step()
    assert box.base_pose().position[2] < 0.0999


def test_a_model_in_a_corner_comes_out_of_both_walls(world):
    world.add_ground_plane()
    wall(world, "wall", 0.0)
    box = world.spawn(parse_urdf(BOX % STIFF), "box", Pose((0.15, 0.0, 0.05)))
    for _ in range(round(1.0 / world.time_step_s)):
        world.step()
    assert box.base_pose().position == pytest.approx((0.2, 0.0, 0.1), abs=0.002)


def test_a_model_between_two_walls_stays_where_it_was_put(world):
    wall(world, "left", 0.0)
    wall(world, "right", 0.35)
    world.set_gravity((0.0, 0.0, 0.0))
    box = world.spawn(parse_urdf(BOX % ""), "box", Pose((0.175, 0.0, 0.0)))
    world.step()
    assert box.base_pose().position == pytest.approx((0.175, 0.0, 0.0), abs=0.01)


@pytest.mark.parametrize("speed, fastest", [(None, 10.0), (0.01, 0.01), (0.1, 0.1), (0.0, 0.001)])
@pytest.mark.parametrize("contact", ["", "<kp>1e6</kp><kd>1</kd>"])
def test_what_was_pressed_into_the_board_leaves_it_no_faster_than_max_vel(speed, fastest, contact):
    """A chess piece of 1 g, 2 mm deep."""
    world = World(time_step_s=0.001)
    world.add_ground_plane()
    said = "" if speed is None else "<maxVel>%g</maxVel>" % speed
    piece = world.spawn(parse_urdf("""<robot name="piece"><link name="it"><inertial><mass value="0.001"/>
        <inertia ixx="1e-7" iyy="1e-7" izz="1e-7" ixy="0" ixz="0" iyz="0"/></inertial><collision><geometry>
        <box size="0.02 0.02 0.04"/></geometry></collision></link><gazebo reference="it">%s%s</gazebo></robot>"""
                                   % (contact, said)), "piece", Pose((0, 0, 0.02)))
    world.step()
    pybullet.resetBasePositionAndOrientation(piece.body, (0, 0, 0.018), (0, 0, 0, 1), physicsClientId=world._client)
    speeds = []
    for _ in range(300):
        world.step()
        speeds.append(piece.base_twist()[0][2])
    assert max(speeds) <= fastest and (speed is not None or max(speeds) > 0.1)
    if speed:
        assert piece.base_pose().position[2] > 0.0181
    world.close()


def test_what_passes_through_is_not_moved_out(world):
    """As the crossed beams of Gazebo's collide_bitmask.world, of which one was put on the other."""
    mask = '<gazebo reference="it"><collision><surface><contact><collide_bitmask>%d</collide_bitmask></contact>' \
           "</surface></collision></gazebo>"
    world.set_gravity((0, 0, 0))
    for x, bits, deep in ((0.0, 2, 0.15), (5.0, 3, 0.0)):
        one, two = (world.spawn(parse_urdf(BOX % (mask % each)), "%d at %g" % (number, x), Pose((x, 0.0, z)))
                    for number, (each, z) in enumerate(((1, 0.1), (bits, 0.15))))
        world.step()
        overlap = 0.2 - abs(two.base_pose().position[2] - one.base_pose().position[2])
        assert overlap == pytest.approx(deep, abs=2e-3)
