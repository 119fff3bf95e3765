# SPDX-License-Identifier: BSD-3-Clause
"""Scenes with an analytical solution, at steps of 1 and 2 ms. The README's table repeats these tolerances."""
import math

import numpy as np
import pytest

from bullet_sim import Pose, World
from bullet_sim.sliding_wheels import fixed_wheels
from urdf_model import Box, Link, Loop, Robot, Shape, parse_urdf
from urdf_model.transforms import pose_matrix

G = 9.81
SOLID = """<robot name="%(name)s"><link name="it"><inertial><mass value="%(mass)g"/><inertia ixx="%(ixx)g" iyy="%(iyy)g"
izz="%(izz)g"/></inertial><collision><geometry>%(shape)s</geometry></collision></link>
<gazebo reference="it"><mu1>%(mu)g</mu1><mu2>%(mu)g</mu2></gazebo></robot>"""
PENDULUM = """<robot name="pendulum"><link name="world"/><link name="rod"><inertial><origin xyz="0 0 -1"/>
<mass value="1"/><inertia ixx="0.02" iyy="0.02" izz="0.02"/></inertial></link><joint name="swing" type="continuous">
<parent link="world"/><child link="rod"/><axis xyz="0 1 0"/></joint></robot>"""
FINGER = """<link name="%(n)s"><inertial><mass value="0.02"/><inertia ixx="1e-5" iyy="1e-5" izz="1e-5"/></inertial>
<collision><origin xyz="0 %(y)g 0"/><geometry><box size="0.04 0.01 0.04"/></geometry></collision></link>
<joint name="%(n)s" type="prismatic"><parent link="carrier"/><child link="%(n)s"/><axis xyz="0 1 0"/>
<limit lower="%(lower)g" upper="%(upper)g" effort="20" velocity="1"/></joint>
<gazebo reference="%(n)s"><kp>1e5</kp><kd>1</kd></gazebo>"""
SHAKER = """<robot name="shaker"><link name="world"/><link name="carrier"><inertial><mass value="1"/><inertia ixx="0.01"
iyy="0.01" izz="0.01"/></inertial></link><joint name="lift" type="prismatic"><parent link="world"/>
<child link="carrier"/>
<axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1000" velocity="10"/></joint>%s%s</robot>""" % (
    FINGER % {"n": "l", "y": 0.02, "lower": 0.0, "upper": 0.05},
    FINGER % {"n": "r", "y": -0.02, "lower": -0.05, "upper": 0.0})
WHEEL = """<link name="%(n)s"><inertial><mass value="0.5"/><inertia ixx="0.0014" iyy="0.0014" izz="0.0025"/></inertial>
<collision><geometry><cylinder radius="0.1" length="0.04"/></geometry></collision></link><joint name="%(n)s"
type="continuous"><parent link="base"/><child link="%(n)s"/><origin xyz="%(x)g %(y)g 0" rpy="-1.5707963 0 0"/>
<axis xyz="0 0 1"/></joint>"""
CART = """<robot name="cart"><link name="base"><inertial><mass value="5"/><inertia ixx="0.05" iyy="0.08" izz="0.1"/>
</inertial></link>%s</robot>""" % "".join(WHEEL % {"n": "%s%s" % (end, side), "x": x, "y": y}
                                         for end, x in (("front", 0.2), ("rear", -0.2))
                                         for side, y in (("left", 0.15), ("right", -0.15)))
SLIDER = """<robot name="slider"><link name="world"/><link name="it"><inertial><mass value="2"/><inertia ixx="0.02"
iyy="0.02" izz="0.02"/></inertial></link><joint name="rail" type="prismatic"><parent link="world"/><child link="it"/>
<axis xyz="1 0 0"/><limit lower="-9" upper="9" effort="5" velocity="3"/><dynamics friction="%g"/></joint></robot>"""
BAR = """<robot name="bars"><link name="world"/>%s</robot>""" % "".join("""<link name="%s"><inertial><origin xyz="%s"
rpy="0.3 0.2 0"/><mass value="1"/><inertia ixx="0.05" iyy="0.06" izz="0.04"/></inertial></link><joint name="%s"
type="continuous"><parent link="%s"/><child link="%s"/><origin xyz="%s"/><axis xyz="0 1 0"/></joint>""" % (
    link, centre, joint, parent, link, place) for link, centre, joint, parent, place in (
        ("left", "0 0 -0.25", "a", "world", "0 0 0"), ("right", "0 0 -0.25", "b", "world", "1 0 0"),
        ("rod", "0.5 0 0", "c", "left", "0 0 -0.5")))
TWO_WHEELER = """<robot name="two_wheeler"><link name="base"><inertial><origin xyz="0 0 0.1"/><mass value="15"/>
<inertia ixx="0.1" iyy="0.1" izz="0.1"/></inertial>%s</link>%s</robot>""" % (
    "".join('<collision><origin xyz="%g 0 -0.05"/><geometry><sphere radius="0.05"/></geometry></collision>' % x
            for x in (0.15, -0.15)),
    "".join((WHEEL % {"n": n, "x": 0.0, "y": y}).replace('value="0.5"', 'value="5"') for n, y in (
        ("left", 0.15), ("right", -0.15))))


@pytest.fixture(params=[0.001, 0.002], ids=["1ms", "2ms"])
def world(request):
    world = World(time_step_s=request.param)
    yield world
    world.close()


def run(world, seconds, each=lambda time_s: None):
    begin = world.time_s
    for _ in range(round(seconds / world.time_step_s)):
        each(world.time_s - begin)
        world.step()


def solid(world, name, shape, mass, moments, mu=1.0, pose=None):
    text = SOLID % {"name": name, "shape": shape, "mass": mass, "mu": mu,
                    **dict(zip(("ixx", "iyy", "izz"), moments, strict=True))}
    return world.spawn(parse_urdf(text), name, pose or Pose())


def cube(world, name, mu, pose, side=0.2):
    return solid(world, name, '<box size="%g %g %g"/>' % (side, side, side), 1.0, [side * side / 6.0] * 3, mu, pose)


def ball(world, pose, radius=0.1, mass=2.0):
    return solid(world, "ball", '<sphere radius="%g"/>' % radius, mass, [0.4 * mass * radius * radius] * 3, 1.0, pose)


def slope(world, angle):
    """A ramp that falls towards x, its surface through the origin; returns (along (3,), normal (3,))."""
    place = pose_matrix((0.0, 0.0, 0.0), (0.0, angle, 0.0))
    normal = place[:3, 2]
    place[:3, 3] = -0.5 * normal
    link = Link("link", collisions=[Shape(Box((60.0, 4.0, 1.0)), place, "c", None, "link")])
    world.spawn(Robot("ramp", {"link": link}, {}, "link"), "ramp", static=True)
    return place[:3, 0], normal


def laid(angle, height, normal):
    """The pose of something whose middle is ``height`` above the ramp."""
    return Pose(tuple((height * normal).tolist()), (0.0, math.sin(angle / 2.0), 0.0, math.cos(angle / 2.0)))


def test_free_fall(world):
    box = cube(world, "box", 1.0, Pose((0, 0, 100)))
    run(world, 2.0)
    assert 100.0 - box.base_pose().position[2] == pytest.approx(G * 2.0 ** 2 / 2.0, abs=G * 2.0 * world.time_step_s)
    assert box.base_twist()[0][2] == pytest.approx(-G * 2.0, rel=1e-6)


def test_a_fall_goes_on_when_the_step_changes(world):
    box = cube(world, "box", 1.0, Pose((0, 0, 100)))
    run(world, 1.0)
    world.set_time_step(0.0005)
    run(world, 1.0)
    assert world.time_s == pytest.approx(2.0, abs=1e-9)
    assert box.base_twist()[0][2] == pytest.approx(-G * 2.0, rel=1e-6)
    world.reset_time()
    world.step()
    assert world.time_s == pytest.approx(0.0005)


def test_a_throw_keeps_its_horizontal_speed(world):
    box = cube(world, "box", 1.0, Pose((0, 0, 100)))
    box.set_base_twist((3.0, 0, 5.0), (0, 0, 2.0))
    run(world, 1.0)
    (x, _, z), (linear, angular) = box.base_pose().position, box.base_twist()
    assert x == pytest.approx(3.0, rel=1e-6) and linear[0] == pytest.approx(3.0, rel=1e-6)
    assert z == pytest.approx(100.0 + 5.0 - G / 2.0, abs=G * world.time_step_s)
    assert angular[2] == pytest.approx(2.0, rel=1e-6)


def test_what_moves_slowly_is_not_stopped(world):
    world.add_ground_plane()
    box = cube(world, "box", 0.0, Pose((0, 0, 0.1)))
    box.set_base_twist((0.01, 0, 0), (0, 0, 0.01))
    run(world, 3.0)
    assert box.base_pose().position[0] == pytest.approx(0.03, rel=1e-3)
    assert box.base_twist()[1][2] == pytest.approx(0.01, rel=1e-2)


def test_what_rests_falls_asleep_unless_it_has_joints(world):
    world.add_ground_plane()
    box, cart = cube(world, "box", 0.8, Pose((0, 0, 0.1))), world.spawn(parse_urdf(CART), "cart", Pose((0, 5, 0.1)))
    run(world, 2.2)
    assert not any(box.base_twist()[0])
    cart.add_effort(np.arange(4), np.full(4, 0.5))
    world.step()
    assert (cart.read_joints()[1] > 0.01).all(), "an effort moves it in the same step"


@pytest.mark.parametrize("mu", [0.1, 0.2, 0.3])
def test_a_block_slides_down_a_slope(world, mu):
    angle = math.radians(25.0)
    along, normal = slope(world, angle)
    box = cube(world, "box", mu, laid(angle, 0.1, normal))
    run(world, 1.0)
    expected = G * (math.sin(angle) - mu * math.cos(angle))
    assert np.dot(box.base_twist()[0], along) == pytest.approx(expected, rel=0.02)
    assert np.dot(box.base_pose().position, along) == pytest.approx(expected / 2.0, rel=0.03)


def test_a_block_stays_on_a_slope_below_its_friction(world):
    angle = math.radians(25.0)
    along, normal = slope(world, angle)
    box = cube(world, "box", 0.6, laid(angle, 0.1, normal))
    run(world, 1.0)
    before = np.dot(box.base_pose().position, along)
    run(world, 5.0)
    # tan 25 degrees is 0.47.
    assert np.dot(box.base_pose().position, along) == pytest.approx(before, abs=5e-5)


def test_a_pendulum_has_its_period_and_keeps_its_energy(world):
    pendulum = world.spawn(parse_urdf(PENDULUM), "pendulum")
    amplitude, inertia = 0.3, 1.0 + 0.02
    pendulum.set_joint_positions(np.arange(1), np.array([amplitude]))
    crossings, last = [], [amplitude]

    def look(time_s):
        angle = pendulum.read_joints()[0][0]
        if last[0] > 0.0 >= angle:
            crossings.append(time_s - world.time_step_s * angle / (angle - last[0]))
        last[0] = angle

    run(world, 30.0, look)
    period = np.diff(crossings).mean()
    # Of a large swing, to the fourth power of the amplitude.
    expected = 2.0 * math.pi * math.sqrt(inertia / G) * (1.0 + amplitude ** 2 / 16.0 + 11.0 * amplitude ** 4 / 3072.0)
    assert period == pytest.approx(expected, rel=1e-3)
    position, velocity, _ = pendulum.read_joints()
    energy = 0.5 * inertia * velocity[0] ** 2 + G * (1.0 - math.cos(position[0]))
    assert energy == pytest.approx(G * (1.0 - math.cos(amplitude)), rel=0.02)


def test_friction_in_a_joint_stops_it_and_holds_it(world):
    it, rail = world.spawn(parse_urdf(SLIDER % 1.0), "slider"), np.arange(1)
    it.parts.put(rail, [0.0], [1.0])
    run(world, 4.0)
    # 1 N against 2 kg at 1 m/s.
    assert it.read_joints()[0][0] == pytest.approx(1.0, abs=2.0 * world.time_step_s)
    assert [reading[0] for reading in it.read_joints()[1:]] == pytest.approx([0.0, 0.0], abs=1e-9), "no drive works"
    run(world, 1.0, lambda time_s: it.drive_effort(rail, np.array([0.99])))
    assert it.read_joints()[0][0] == pytest.approx(1.0, abs=2.0 * world.time_step_s)
    run(world, 1.0, lambda time_s: it.add_effort(rail, np.array([-2.0])))
    assert it.read_joints()[1][0] == pytest.approx(-0.5, rel=0.01)


def test_the_pose_of_a_model_on_the_world_is_that_of_its_first_link(world):
    robot = parse_urdf((SLIDER % 0.0).replace('xyz="1 0 0"', 'xyz="0 0 1"').replace(
        '<child link="it"/>', '<child link="it"/><origin xyz="0 0 3" rpy="0 0 1.5707963"/>'))
    it = world.spawn(robot, "lift", Pose((1, 2, 0)))
    run(world, 1.0)
    fallen = G / 2.0
    assert it.model_pose().position == pytest.approx((1.0, 2.0, -fallen), abs=G * world.time_step_s)
    assert it.model_pose().quaternion == pytest.approx((0.0, 0.0, 0.0, 1.0), abs=1e-6)
    assert it.model_twist()[0] == pytest.approx((0.0, 0.0, -G), rel=1e-3)
    assert it.base_pose().position == (1.0, 2.0, 0.0)


@pytest.mark.parametrize("kind", ["revolute", "ball"])
def test_a_parallelogram_of_bars_is_closed_by_a_joint(world, kind):
    robot, at_rod, at_right = parse_urdf(BAR), np.eye(4), np.eye(4)
    at_rod[0, 3], at_right[2, 3] = 1.0, -0.5
    robot.loops.append(Loop("d", kind, "rod", "right", at_rod, at_right, np.array([0.0, 1.0, 0.0])))
    bars = world.spawn(robot, "bars")
    drive = bars.index(["a"])
    run(world, 1.0, lambda time_s: bars.drive_velocity(drive, np.array([0.5]), np.array([100.0])))
    a, b, c = bars.read_joints()[0][bars.index(["a", "b", "c"])]
    assert (a, b, c) == pytest.approx((0.5, 0.5, -0.5), abs=0.01)
    world.rebuild([bars])
    run(world, 1.0, lambda time_s: bars.drive_velocity(drive, np.array([-0.5]), np.array([100.0])))
    assert bars.read_joints()[0] == pytest.approx(np.zeros(3), abs=0.01)
    world.delete("bars")
    world.step()


def test_velocities_decay_by_a_part_in_each_step(world):
    robot = parse_urdf(SOLID % {"name": "it", "shape": '<box size="1 1 1"/>', "mass": 2.0, "mu": 1.0, "ixx": 0.1,
                                "iyy": 0.2, "izz": 0.3})
    robot.links["it"].decay = (0.01, 0.002)
    it = world.spawn(robot, "it")
    world.set_gravity((0.0, 0.0, 0.0))
    it.set_base_twist((1.0, 0, 0), (0, 0, 2.0))
    for _ in range(100):
        world.step()
    linear, angular = it.base_twist()
    assert (linear[0], angular[2]) == pytest.approx((0.99 ** 100, 2.0 * 0.998 ** 100), rel=0.01)


def test_a_spring_in_a_joint_swings(world):
    robot = parse_urdf(SLIDER % 0.0)
    robot.joints["rail"].spring_stiffness, robot.joints["rail"].spring_reference = 50.0, 0.2
    it, way = world.spawn(robot, "slider"), []
    run(world, 10.0, lambda time_s: way.append(it.read_joints()[0][0]))
    assert (min(way), max(way)) == pytest.approx((0.0, 0.4), abs=0.002)
    middle = np.flatnonzero((np.array(way[:-1]) < 0.2) & (np.array(way[1:]) >= 0.2))
    assert np.diff(middle).mean() * world.time_step_s == pytest.approx(2.0 * math.pi * math.sqrt(2.0 / 50.0), rel=0.005)


def test_a_spring_too_stiff_for_the_step_is_bounded():
    told = []
    world = World(time_step_s=0.001, warn=told.append)
    robot = parse_urdf(SLIDER % 0.0)
    robot.joints["rail"].spring_stiffness, robot.joints["rail"].spring_reference = 1e9, 0.1
    it = world.spawn(robot, "slider")
    run(world, 1.0)
    assert abs(it.read_joints()[0][0]) < 0.3
    assert len(told) == 1 and "1e+09" in told[0] and "2e+06" in told[0]
    world.close()


def test_efforts_are_cut_to_the_limits_of_the_joint(world):
    it, rail = world.spawn(parse_urdf(SLIDER % 0.0), "slider"), np.arange(1)
    assert it.limited_effort(rail, np.array([-8.0])) == pytest.approx([-5.0])
    it.carry(rail, np.zeros(1), np.array([3.1]))
    world.step()
    assert [it.limited_effort(rail, np.array([effort]))[0] for effort in (4.0, -4.0)] == [0.0, -4.0]


def test_a_stack_of_ten_boxes_stands_for_a_minute(world):
    world.add_ground_plane()
    boxes = [cube(world, "box%d" % i, 0.8, Pose((0, 0, 0.1 + 0.2 * i))) for i in range(10)]
    run(world, 60.0)
    for i, box in enumerate(boxes):
        x, y, z = box.base_pose().position
        assert (x, y, z) == pytest.approx((0.0, 0.0, 0.1 + 0.2 * i), abs=0.001 + world.time_step_s), box.name


def test_a_ball_rolls_down_a_slope(world):
    angle = math.radians(10.0)
    along, normal = slope(world, angle)
    it = ball(world, laid(angle, 0.1, normal))
    run(world, 2.0)
    speed = np.dot(it.base_twist()[0], along)
    assert speed == pytest.approx(5.0 / 7.0 * G * math.sin(angle) * 2.0, rel=0.01)
    assert it.base_twist()[1][1] * 0.1 == pytest.approx(speed, rel=0.01)


def test_a_ball_that_slips_comes_to_roll(world):
    world.add_ground_plane()
    it = ball(world, Pose((0, 0, 0.1)))
    it.set_base_twist((2.0, 0, 0), (0, 0, 0))
    run(world, 2.0)
    assert it.base_twist()[0][0] == pytest.approx(5.0 / 7.0 * 2.0, rel=0.02)
    assert it.base_twist()[1][1] * 0.1 == pytest.approx(it.base_twist()[0][0], rel=0.01)


@pytest.mark.parametrize(("acceleration", "holds"), [(15.0, True), (50.0, False)])
def test_a_closed_gripper_is_shaken(world, acceleration, holds):
    shaker = world.spawn(parse_urdf(SHAKER), "shaker", Pose((0, 0, 1)))
    fingers, lift = shaker.index(["l", "r"]), shaker.index(["lift"])
    shaker.set_joint_positions(fingers, np.array([0.005, -0.005]))
    box = solid(world, "box", '<box size="0.04 0.04 0.04"/>', 0.2, [1e-4] * 3, 1.0, Pose((0, 0, 1)))
    turn = 2.0 * math.pi * 5.0  # 5 Hz

    def squeeze(time_s):
        # 4 N at two sides carry 8 N by friction, that is 40 m/s2 of 0.2 kg; weight takes 9.81 of it.
        shaker.drive_effort(fingers, np.array([-4.0, 4.0]))

    def hold(time_s):
        squeeze(time_s)
        shaker.drive_velocity(lift, np.zeros(1), np.array([1000.0]))

    def shake(time_s):
        squeeze(time_s)
        shaker.drive_velocity(lift, np.array([acceleration / turn * math.sin(turn * time_s)]), np.array([1000.0]))

    run(world, 0.2, hold)
    run(world, 2.0, shake)
    slipped = box.base_pose().position[2] - 1.0 - shaker.read_joints()[0][lift[0]]
    assert (abs(slipped) < 0.001) == holds


def test_wheels_count_how_far_a_cart_goes(world):
    world.add_ground_plane()
    cart = world.spawn(parse_urdf(CART), "cart", Pose((0, 0, 0.1)))
    wheels = np.arange(4)
    run(world, 3.0, lambda time_s: cart.drive_velocity(wheels, np.full(4, min(time_s, 1.0) * 5.0), np.full(4, 5.0)))
    travelled = cart.base_pose().position[0]
    assert travelled == pytest.approx(0.1 * cart.read_joints()[0].mean(), rel=0.005)
    assert travelled == pytest.approx(0.5 * 2.0 + 0.25, rel=0.02)
    assert abs(cart.base_pose().position[1]) < 0.01


@pytest.mark.parametrize("step_s", [0.001, 0.01])
def test_casters_with_friction_do_not_hold_a_vehicle(step_s):
    # Two wheels and two casters touch the floor at the same height, all with a friction of 1.
    world = World(time_step_s=step_s)
    world.add_ground_plane()
    cart = world.spawn(parse_urdf(TWO_WHEELER), "cart", Pose((0.0, 0.0, 0.1)))
    run(world, 1.0, lambda time_s: cart.drive_velocity(np.arange(2), np.zeros(2), np.full(2, 10.0)))
    run(world, 2.0, lambda time_s: cart.drive_velocity(np.arange(2), np.full(2, 3.0), np.full(2, 10.0)))
    assert cart.base_pose().position[0] == pytest.approx(0.6, rel=0.1)
    world.close()


@pytest.mark.parametrize(("kind", "holds"), [("continuous", True), ("revolute", False)])
def test_only_wheels_have_a_friction_above_one(world, kind, holds):
    # A slope of 60° needs a friction of tan 60° = 1.7. The cart's wheels are braked; gravity is tilted in its place.
    text = CART.replace('type="continuous"', 'type="%s"' % kind).replace(
        "</joint>", '<limit lower="-9" upper="9" effort="99" velocity="9"/></joint>')
    wheels = [end + side for end in ("front", "rear") for side in ("left", "right")]
    rough = '<gazebo reference="%s"><mu1>200</mu1><mu2>200</mu2></gazebo>'
    text = text.replace("</robot>", "".join(rough % name for name in wheels) + "</robot>")
    world.add_ground_plane()
    cart = world.spawn(parse_urdf(text), "cart", Pose((0.0, 0.0, 0.1)))
    index = cart.index(wheels)
    world.set_gravity((G * math.sin(math.radians(60.0)), 0.0, -G * math.cos(math.radians(60.0))))
    run(world, 1.0, lambda time_s: cart.drive_velocity(index, np.zeros(4), np.full(4, 50.0)))
    assert (abs(cart.base_pose().position[0]) < 0.02) is holds


@pytest.mark.parametrize("mu, mu2", [(0.5, 0.5), (1.0, 1.0), (0.5, 0.501)])  # the last has the world's directions
def test_a_vehicle_with_fixed_wheels_turns_against_coulombs_friction(world, mu, mu2):
    # Base 0.4 m, track 0.3 m: it turns as if its track were 1 + (base / track)^2 times as large, by friction of the
    # same size in all directions.
    wheels = [end + side for end in ("front", "rear") for side in ("left", "right")]
    surfaces = "".join('<gazebo reference="%s"><mu1>%g</mu1><mu2>%g</mu2></gazebo>' % (name, mu, mu2)
                       for name in wheels)
    world.add_ground_plane()
    cart = world.spawn(parse_urdf(CART.replace("</robot>", surfaces + "</robot>")), "cart", Pose((0.0, 0.0, 0.1)))
    speeds, efforts = np.array([-1.0, 1.0, -1.0, 1.0]) * 0.3 / 0.1, np.full(4, 20.0)
    angles = []
    run(world, 0.5, lambda time_s: cart.drive_velocity(cart.index(wheels), np.zeros(4), efforts))

    def drive(time_s):
        cart.drive_velocity(cart.index(wheels), speeds, efforts)
        turned = cart.base_pose().matrix()
        angles.append(math.atan2(turned[1, 0], turned[0, 0]))

    run(world, 2.0, drive)
    way = np.unwrap(angles)
    rate = (way[-1] - way[len(way) // 2]) / 1.0
    assert 2.0 * 0.3 / rate == pytest.approx(0.3 * (1.0 + (0.4 / 0.3) ** 2), rel=0.01 if mu == mu2 else 0.03)
    assert math.hypot(*cart.base_pose().position[:2]) < (0.005 if mu == mu2 else 0.01), "it turns on the spot"


def test_fixed_wheels_are_those_of_several_axles():
    cart = list(parse_urdf(CART).joints.values())
    assert fixed_wheels(cart) == [0, 1, 2, 3]
    assert fixed_wheels(cart[:2]) == [] == fixed_wheels(list(parse_urdf(PENDULUM).joints.values()))
