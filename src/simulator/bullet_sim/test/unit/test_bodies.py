# SPDX-License-Identifier: BSD-3-Clause
"""Pushing, weighing and touching single bodies; bodies that sleep and wake up."""

import math

import numpy as np
import pybullet
import pytest

from bullet_sim import BulletSimError, Pose, World
from urdf_model import Joint, Limit, Link, Plane, Robot, Shape, Surface, parse_urdf
from urdf_model.transforms import pose_matrix

BOX = """<robot name="box"><link name="box"><inertial><mass value="1"/>
  <inertia ixx="0.0017" iyy="0.0017" izz="0.0017"/></inertial>
  <collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision></link>%s</robot>"""
ROD = """<robot name="rod"><link name="post"/>
  <link name="rod"><inertial><origin xyz="0.5 0 0"/><mass value="2"/>
    <inertia ixx="0.01" iyy="0.2" izz="0.2"/></inertial></link>
  <joint name="pivot" type="continuous"><parent link="post"/><child link="rod"/><axis xyz="0 0 1"/></joint></robot>"""
SLIDER = """<robot name="slider"><link name="rail"/><link name="pusher"><inertial><mass value="1"/>
    <inertia ixx="0.0017" iyy="0.0017" izz="0.0017"/></inertial>
    <collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision></link>
  <joint name="slide" type="prismatic"><parent link="rail"/><child link="pusher"/><axis xyz="1 0 0"/>
    <limit lower="0" upper="1" velocity="1" effort="50"/></joint></robot>"""
ASLEEP_AFTER = 2500  # ticks


@pytest.fixture
def sleeping_box(world):
    world.add_ground_plane()
    box = world.spawn(parse_urdf(BOX % ""), "box", Pose((0, 0, 0.05)))
    step(world, ASLEEP_AFTER)
    return box


def step(world, ticks):
    for _ in range(ticks):
        world.step()


@pytest.mark.parametrize("touch, moved", [
    (lambda world, box: box.set_base_pose(Pose((0, 0, 2))), lambda box: box.base_pose().position[2] < 1.99),
    (lambda world, box: box.set_base_twist((0, 0, 2), (0, 0, 0)), lambda box: box.base_pose().position[2] > 0.1),
    (lambda world, box: box.apply_wrench("box", (0, 0, 2000)), lambda box: box.base_pose().position[2] > 0.1),
    (lambda world, box: world.set_gravity((0, 0, 5)), lambda box: box.base_pose().position[2] > 0.06),
])
def test_a_sleeping_body_wakes_up_when_it_is_touched(world, sleeping_box, touch, moved):
    touch(world, sleeping_box)
    step(world, 50)
    assert moved(sleeping_box)


def bullet_passes_it_over(world, box):
    """Whether Bullet ignores a push, as it does for a sleeping body: World itself wakes the bodies that it pushes."""
    before = box.base_pose()
    pybullet.applyExternalForce(
        box.body, -1, (0, 0, 2000), before.position, pybullet.WORLD_FRAME, physicsClientId=world._client)
    world.step()
    return box.base_pose() == before


@pytest.mark.parametrize("hit", ["by another body", "by a robot's joint"])
def test_sleeping_bodies_wake_up_when_something_runs_into_them(world, sleeping_box, hit):
    others = [world.spawn(parse_urdf(BOX % ""), "box_%d" % i, Pose((0.5 * i + 1.0, 0, 0.05))) for i in range(9)]
    step(world, ASLEEP_AFTER)
    resting = [box.base_pose() for box in others]
    assert bullet_passes_it_over(world, sleeping_box)
    start = sleeping_box.base_pose()
    if hit == "by another body":
        other = world.spawn(parse_urdf(BOX % ""), "other", Pose((-0.15, 0, 0.051)))
        other.set_base_twist((2.0, 0, 0), (0, 0, 0))
    else:
        robot = world.spawn(parse_urdf(SLIDER), "robot", Pose((-0.3, 0, 0.06)), static=True)
        robot.drive_velocity(robot.index(["slide"]), np.array([0.5]), np.array([50.0]))
    step(world, 400)
    assert sleeping_box.base_pose().position[0] > start.position[0] + 0.02
    # A body that is not hit sleeps on.
    assert [box.base_pose() for box in others] == resting


def test_a_push_in_its_sleep_gives_a_body_the_whole_impulse(world):
    """Without weight nor floor, so that nothing but the push moves it."""
    world.set_gravity((0, 0, 0))
    box = world.spawn(parse_urdf(BOX % ""), "box")
    step(world, ASLEEP_AFTER)
    for _ in range(5):
        box.apply_wrench("box", (1.0, 0, 0))
        world.step()
    step(world, 5)
    assert box.base_twist()[0][0] == pytest.approx(5 * 0.002, rel=1e-6)


@pytest.mark.parametrize("take_away", [
    lambda world: world.delete("support"),
    lambda world: world.models["support"].set_base_pose(Pose((9, 9, 9)))])
def test_a_sleeping_body_falls_when_its_support_goes(world, take_away):
    world.spawn(parse_urdf(BOX % ""), "support", Pose((0, 0, 0.05)), static=True)
    box = world.spawn(parse_urdf(BOX % ""), "box", Pose((0, 0, 0.15)))
    step(world, ASLEEP_AFTER)
    take_away(world)
    step(world, 50)
    assert box.base_pose().position[2] < 0.14


@pytest.mark.parametrize("friction, slides", [(None, False), (0.7, False), (0.3, True), (1000.0, False)])
def test_friction_holds_a_box_up_to_its_coefficient(world, friction, slides):
    """Pushed with half of its weight, on a floor without friction values."""
    world.add_ground_plane()
    robot = parse_urdf(BOX % "")
    robot.links["box"].surface = Surface(friction=friction)
    box = world.spawn(robot, "box", Pose((0, 0, 0.05)))
    for _ in range(250):
        box.apply_wrench("box", (0.5 * 9.81, 0, 0))
        world.step()
    travelled = box.base_pose().position[0]
    # 0.5 s at (0.5 - mu) g
    assert travelled == pytest.approx(0.5 * 0.2 * 9.81 * 0.25 if slides else 0.0, abs=0.02)


def test_friction_stands_in_the_gazebo_element_of_a_urdf(world):
    xml = BOX % '<gazebo reference="box"><mu1>0.2</mu1><kp>1e5</kp><kd>1</kd><material>Gazebo/Red</material></gazebo>'
    assert parse_urdf(xml).links["box"].surface == Surface(0.2, 1e5, 1.0, friction_across=1.0)


def test_a_soft_contact_gives_way(world):
    world.add_ground_plane()
    robot = parse_urdf(BOX % "")
    robot.links["box"].surface = Surface(stiffness=1000.0, damping=10.0)
    box = world.spawn(robot, "box", Pose((0, 0, 0.05)))
    step(world, 1500)
    # Four corners, all with the same spring: between m g / k and a quarter of it.
    assert 0.05 - 0.011 < box.base_pose().position[2] < 0.0485


def test_a_part_of_a_body_without_weight_is_not_pulled(world):
    """Two links of 1 kg, 1 m apart; only one has weight: g/2, and g/2 m of moment on 0.5 m + 2 * 0.01 kg m^2."""
    link = '<link name="%s"><inertial><mass value="1"/><inertia ixx=".01" iyy=".01" izz=".01"/></inertial></link>'
    body = world.spawn(parse_urdf(
        '<robot name="r">%s%s<joint name="j" type="fixed"><parent link="a"/><child link="b"/><origin xyz="1 0 0"/>'
        '</joint><gazebo reference="j"><preserveFixedJoint>true</preserveFixedJoint></gazebo><gazebo reference="b">'
        '<gravity>0</gravity></gazebo></robot>' % (link % "a", link % "b")), "r", Pose((0.0, 0.0, 5.0)))
    assert body.has_weight("a")
    step(world, 50)
    time_s = 50 * world.time_step_s
    linear, angular = np.mean([body.link_twist(link) for link in "ab"], axis=0)
    assert linear[2] == pytest.approx(world.gravity[2] / 2.0 * time_s, rel=0.01)
    assert angular[1] == pytest.approx(world.gravity[2] * 0.5 / 0.52 * time_s, rel=0.02)


def test_a_link_without_weight_floats_and_gets_it_back(world):
    xml = BOX % '<gazebo reference="box"><turnGravityOff>true</turnGravityOff></gazebo>'
    box = world.spawn(parse_urdf(xml), "box", Pose((0, 0, 1)))
    assert not box.has_weight("box")
    step(world, 500)
    assert box.base_pose().position[2] == pytest.approx(1.0, abs=1e-6)
    box.set_weight("box", True)
    step(world, 100)
    assert box.base_pose().position[2] == pytest.approx(1.0 - 0.5 * 9.81 * 0.04, abs=0.01)
    box.set_weight("box", False)
    world.delete("box")
    world.step()


def test_mass_and_inertia_can_be_set(world):
    box = world.spawn(parse_urdf(BOX % ""), "box", Pose((0, 0, 1)))
    world.set_gravity((0, 0, 0))
    box.set_inertial("box", 4.0, np.diag((0.02, 0.04, 0.05)))
    assert box.inertial("box").mass == 4.0
    for _ in range(100):
        box.apply_wrench("box", (4.0, 0, 0), (0, 0, 0.05))
        world.step()
    linear, angular = box.base_twist()
    assert linear[0] == pytest.approx(0.2, rel=1e-3) and angular[2] == pytest.approx(0.2, rel=1e-3)


def test_the_centre_of_mass_can_be_moved(world):
    box = world.spawn(parse_urdf(BOX % ""), "box", Pose((0, 0, 1)))
    world.set_gravity((0, 0, 0))
    box.set_base_twist((0.0, 0.0, 0.0), (0.0, 0.0, 0.5))
    inertia = np.array([[0.03, 0.01, 0.0], [0.01, 0.03, 0.0], [0.0, 0.0, 0.05]])
    box.set_inertial("box", 2.0, inertia, (0.1, 0.0, 0.0))
    found = box.inertial("box")
    np.testing.assert_allclose(found.centre, (0.1, 0.0, 0.0), atol=1e-9)
    np.testing.assert_allclose(found.inertia, inertia, atol=1e-9)
    pose, (linear, angular) = box.base_pose(), box.base_twist()
    np.testing.assert_allclose((*pose.position, *linear, *angular), (0, 0, 1, 0, 0, 0, 0, 0, 0.5), atol=1e-6)
    # A force through the frame's origin now turns the box: 2 N at an arm of 0.1 m, 0.05 kg m2.
    box.set_base_twist((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    for _ in range(10):
        box.apply_wrench("box", (0.0, 2.0, 0.0), position=box.base_pose().position)
        world.step()
    assert box.base_twist()[1][2] == pytest.approx(-10 * world.time_step_s * 2.0 * 0.1 / 0.05, rel=0.01)


def test_the_centre_of_mass_of_a_link_on_a_joint_can_be_moved(world):
    rod = world.spawn(parse_urdf(ROD), "rod", static=True)
    rod.set_joint_positions(np.array([0]), np.array([0.3]), np.array([0.2]))
    before = rod.inertial("rod")
    rod.set_inertial("rod", before.mass, before.inertia, before.centre + (0.0, 0.0, 0.05))
    np.testing.assert_allclose(rod.inertial("rod").centre, before.centre + (0.0, 0.0, 0.05))
    assert (rod.read_joints()[0][0], rod.read_joints()[1][0]) == pytest.approx((0.3, 0.2), abs=1e-6)
    world.step()


@pytest.mark.parametrize("mass, inertia, message", [
    (0.0, np.eye(3), "mass of 0 kg"), (math.nan, np.eye(3), "expected a positive"),
    (1.0, np.diag((1.0, -1.0, 1.0)), "not positive"), (1.0, np.diag((1.0, math.nan, 1.0)), "the inertia of link 'rod'"),
    (1.0, np.array([[1.0, 2.0, 0], [2.0, 1.0, 0], [0, 0, 1.5]]), "not positive")])
def test_an_impossible_inertia_is_refused(world, mass, inertia, message):
    rod = world.spawn(parse_urdf(ROD), "rod", static=True)
    with pytest.raises(BulletSimError, match=message):
        rod.set_inertial("rod", mass, inertia)


def test_an_effort_adds_to_what_drives_the_joint(world):
    rod = world.spawn(parse_urdf(ROD), "rod", static=True)
    index = np.array([0])
    rod.drive_velocity(index, np.zeros(1), np.array([0.3]))
    for _ in range(100):
        rod.add_effort(index, np.array([1.0]))
        world.step()
    # 0.7 Nm left on 2 kg * 0.25 m^2 + 0.2 kg m^2
    assert rod.read_joints()[1][0] == pytest.approx(0.7 / 0.7 * 0.2, rel=1e-2)


def test_limits_can_be_set(world):
    rod = world.spawn(parse_urdf(ROD), "rod", static=True)
    rod.set_limits(0, -0.1, 0.25)
    for _ in range(2000):
        rod.drive_effort(np.array([0]), np.array([1.0]))
        world.step()
    assert rod.read_joints()[0][0] == pytest.approx(0.25, abs=1e-2)
    with pytest.raises(BulletSimError, match="not below"):
        rod.set_limits(0, 1.0, 1.0)


def test_frames_of_model_and_joint_need_not_be_those_of_the_links(world):
    """The root stands 1 m beside the model's frame, and a joint 0.5 m beside its child's, as SDF may have it."""
    link = parse_urdf(BOX % "").links["box"]
    hinge = Joint("hinge", "continuous", "a", "b", pose_matrix((0.5, 0, 0)), np.array([0.0, 0.0, 1.0]), Limit(),
                  child_offset=pose_matrix((0.5, 0, 0)))
    robot = Robot("r", {"a": link, "b": Link("b", link.inertial)}, {"hinge": hinge}, "a",
                  root_origin=pose_matrix((0, 1, 0)))
    world.set_gravity((0, 0, 0))
    model = world.spawn(robot, "r", Pose((10, 0, 0)))
    model.set_joint_positions(np.array([0]), np.array([math.pi / 2]))
    assert model.base_pose().position == pytest.approx((10, 0, 0))
    assert model.link_pose("a").position == pytest.approx((10, 1, 0), abs=1e-6)
    assert model.link_pose("b").position == pytest.approx((10.5, 1.5, 0), abs=1e-6)
    model.set_base_pose(Pose((0, 0, 5)))
    assert model.link_pose("a").position == pytest.approx((0, 1, 5), abs=1e-6)
    model.set_base_twist((0, 0, 0), (0, 0, 1))
    np.testing.assert_allclose(model.link_twist("a")[0], (-1, 0, 0), atol=1e-6)
    np.testing.assert_allclose(model.base_twist()[0], (0, 0, 0), atol=1e-6)


@pytest.mark.parametrize("origin, height", [
    (np.eye(4), 0.0), (pose_matrix((0, 0, 0.3)), 0.3), (pose_matrix((0, 0, 0.5), (0, 0.4, 0)), 0.5)])
def test_a_plane_may_be_raised_and_tilted(world, origin, height):
    floor = Robot("f", {"l": Link("l", collisions=[Shape(Plane(), origin)])}, {}, "l")
    world.spawn(floor, "floor", static=True)
    hit = world.ray_test_batch([(0, 0, 2), (1, 0, 2)], [(0, 0, -2), (1, 0, -2)])
    slope = -origin[0, 2] / origin[2, 2]
    np.testing.assert_allclose(2.0 - 4.0 * hit, (height, height + slope), atol=1e-3)


def test_solver_iterations_are_checked(world):
    world.set_solver_iterations(50)
    with pytest.raises(BulletSimError, match="expected 1 to 1000"):
        world.set_solver_iterations(0)


def test_each_world_looks_ahead_as_far_as_it_was_told():
    """Two drums of 1 m, 10 mm apart, in worlds that take turns."""
    drum = """<robot name="drum"><link name="drum">
      <inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial>
      <collision><geometry><cylinder radius="0.5" length="1"/></geometry></collision></link></robot>"""
    worlds = [World(gravity=(0.0, 0.0, 0.0)), World(gravity=(0.0, 0.0, 0.0), contact_ahead_m=0.02)]
    for world in worlds:
        world.spawn(parse_urdf(drum), "here", static=True)
        world.spawn(parse_urdf(drum), "there", Pose((1.01, 0.0, 0.0)))
    for look in (World.step, World.detect_contacts):
        for world in worlds * 2:
            look(world)
            assert bool(world.contacts()) == (world is worlds[1])
    for world in worlds:
        world.close()


FINGER = """<link name="%(n)s"><inertial><mass value="0.1"/><inertia ixx="0.001" iyy="0.001" izz="0.001"/></inertial>
<collision><origin xyz="%(x)g 0 0"/><geometry><box size="0.1 0.1 0.1"/></geometry></collision></link>
<joint name="%(n)s" type="prismatic"><parent link="rail"/><child link="%(n)s"/><axis xyz="1 0 0"/>
<limit lower="-1" upper="1" velocity="1" effort="5"/></joint>
<gazebo reference="%(n)s"><selfCollide>%(own)s</selfCollide></gazebo>"""


def gripper(world, collide, places=(-0.2, 0.2)):
    fingers = "".join(FINGER % {"n": n, "x": x, "own": own} for n, x, own in zip("lr", places, collide, strict=True))
    return world.spawn(parse_urdf('<robot name="gripper"><link name="rail"/>%s</robot>' % fingers), "gripper",
                       Pose((0, 0, 1)), static=True)


@pytest.mark.parametrize(("collide", "closed"), [(("true", "true"), 0.15), (("true", "false"), 0.2)])
def test_links_that_both_ask_for_it_collide_with_each_other(world, collide, closed):
    fingers = gripper(world, collide)
    for _ in range(500):
        fingers.drive_velocity(np.arange(2), np.array([0.2, -0.2]), np.full(2, 5.0))
        world.step()
    assert fingers.read_joints()[0] == pytest.approx((closed, -closed), abs=0.01)


def test_rough_shapes_that_overlap_at_the_start_do_not_push_each_other(world, monkeypatch):
    told = []
    monkeypatch.setattr(world, "_warn", told.append)
    monkeypatch.setattr("bullet_sim.world._has_mesh", lambda link: True)
    fingers = gripper(world, ("true", "true"), (-0.04, 0.04))
    step(world, 100)
    assert np.abs(fingers.read_joints()[0]).max() < 1e-6
    assert len(told) == 1 and "l and r" in told[0]


@pytest.mark.parametrize(("upper", "lower", "lands"), [
    (None, None, True), (1, None, True), (1, 3, True), (1, 2, False), (0, None, False), (0x8000, 0x8000, True)])
def test_links_collide_where_they_share_a_bit(world, upper, lower, lands):
    table, box = parse_urdf(BOX % ""), parse_urdf(BOX % "")
    table.links["box"].surface, box.links["box"].surface = Surface(bitmask=lower), Surface(bitmask=upper)
    world.spawn(table, "table", Pose((0, 0, 0)), static=True)
    falling = world.spawn(box, "falling", Pose((0, 0, 0.11)))
    falling.renew_contacts("box")
    step(world, 200)
    assert (falling.base_pose().position[2] > 0.09) is lands


# Two feet at the ends of a plank, fixed to it, of which each may have a block: friction of the whole, in weights.
@pytest.mark.parametrize("first, second, expected", [
    ("<mu1>0.6</mu1>", "<mu1>0</mu1>", 0.3), ("<mu1>0</mu1>", "<mu1>0.6</mu1>", 0.3), ("", "<mu1>0.2</mu1>", 0.6),
    ("<mu1>0.4</mu1>", "<mu1>0.4</mu1>", 0.4),
    ("<mu1>0.2</mu1>", "<mu1>0.8</mu1><mu2>0.5</mu2><fdir1>0 1 0</fdir1>", 0.5)])
@pytest.mark.parametrize("jointed", [False, True])
def test_links_that_are_fixed_to_each_other_keep_their_surfaces(world, first, second, expected, jointed):
    world.add_ground_plane()
    inertial = '<inertial><mass value="%g"/><inertia ixx="%g" iyy="%g" izz="%g"/></inertial>'
    feet = "".join(
        '<link name="{0}"><collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision></link>'
        '<joint name="to_{0}" type="fixed"><parent link="plank"/><child link="{0}"/><origin xyz="{1} 0 0"/></joint>'
        '<gazebo reference="{0}">{2}</gazebo>'.format(*foot) for foot in (("a", -1, first), ("b", 1, second)))
    mast = ('<link name="mast">%s</link><joint name="turn" type="continuous"><parent link="plank"/><child link="mast"/>'
            '<axis xyz="0 0 1"/></joint>' % (inertial % (0.01, 1e-4, 1e-4, 1e-4)) if jointed else "")
    plank = world.spawn(parse_urdf('<robot name="r"><link name="plank">%s</link>%s%s</robot>' % (
        inertial % (4.0, 1.0, 1.0, 99.0), feet, mast)), "plank", Pose((0, 0, 0.05)))
    step(world, 200)
    plank.set_base_twist((0, 2, 0), (0, 0, 0))
    step(world, 100)
    lost = 2.0 - np.mean([plank.link_twist(link)[0][1] for link in "ab"])
    assert lost == pytest.approx(-expected * world.gravity[2] * 100 * world.time_step_s, rel=0.1)
    contacts = world.contacts()
    assert {touch.link_a if touch.model_a == "plank" else touch.link_b for touch in contacts} == {"plank"}


@pytest.mark.parametrize("first, second, patches", [
    ("<mu1>1</mu1>", "<mu1>100</mu1>", 0), ("", "<mu1>1</mu1><mu2>3</mu2><kp>1e9</kp><kd>5</kd>", 0),
    ("<mu1>0.5</mu1><mu2>0.2</mu2>", "<mu1>0.5</mu1>", 1),
    ("<mu1>0.5</mu1>", "<mu1>0.5</mu1><mu2>1</mu2>", 0), ("<maxVel>1</maxVel>", "<kp>1e12</kp>", 0),
    ("<mu1>0.5</mu1>", "<mu1>0.4</mu1>", 1), ("<kp>1e6</kp>", "", 1), ("", "<maxVel>0.1</maxVel>", 1),
    ("", "<mu1>0.5</mu1><fdir1>0 1 0</fdir1>", 1), ("<mu1>2</mu1><mu2>4</mu2><fdir1>0 1 0</fdir1>", "", 0)])
def test_surfaces_that_act_alike_are_no_further_link(world, first, second, patches):
    """A link more in a multibody costs about a microsecond in each step."""
    shape = '<link name="%s"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>'
    joint = '<joint name="to_%s" type="fixed"><parent link="base"/><child link="%s"/></joint>'
    block = '<gazebo reference="%s">%s</gazebo>'
    base = '<link name="base"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial></link>'
    parts = "".join(shape % name + joint % (name, name) + block % (name, said)
                    for name, said in (("a", first), ("b", second), ("c", second)))
    model = world.spawn(parse_urdf('<robot name="r">%s%s</robot>' % (base, parts)), "r")
    assert sum(map(len, model.parts.patches.values())) == patches


def test_surfaces_of_some_links_leave_all_joints_where_they_are(world):
    """Bullet numbers links depth first, unless it is told not to: a further link of the first arm shifted the second
    one's."""
    inertial = '<inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1"/></inertial>'
    arm = "".join(
        '<link name="{0}{1}">%s<collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision></link>'
        '<joint name="to_{0}{1}" type="revolute"><parent link="{2}"/><child link="{0}{1}"/><origin xyz="0.2 {3} 0"/>'
        '<limit lower="-3" upper="3" effort="9" velocity="9"/></joint>'
        '<link name="tip_{0}{1}"><collision><geometry><sphere radius="0.01"/></geometry></collision></link>'
        '<joint name="fix_{0}{1}" type="fixed"><parent link="{0}{1}"/><child link="tip_{0}{1}"/></joint>'
        '<gazebo reference="tip_{0}{1}"><mu1>0.1</mu1></gazebo>'.format(*link) % inertial
        for link in (("a", 1, "base", 1), ("a", 2, "a1", 0), ("b", 1, "base", -1), ("b", 2, "b1", 0)))
    robot = parse_urdf('<robot name="r"><link name="base">%s</link>%s</robot>' % (inertial, arm))
    model = world.spawn(robot, "r", Pose((0, 0, 5)))
    for link, place in {"a1": (0.2, 1, 5), "a2": (0.4, 1, 5), "b1": (0.2, -1, 5), "b2": (0.4, -1, 5)}.items():
        np.testing.assert_allclose(model.link_pose(link).position, place, atol=1e-6)
    model.drive_velocity(model.index(["to_b2"]), np.array([1.0]), np.array([9.0]))
    step(world, 5)
    velocity = dict(zip(model.joint_names, model.read_joints()[1], strict=True))
    assert velocity["to_b2"] == pytest.approx(1.0, abs=0.05)
    assert model.link_twist("b2")[1][0] - model.link_twist("b1")[1][0] == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize("joints, feet, kept", [(0, 200, 127), (100, 40, 27), (3, 20, 19)])
def test_surfaces_for_which_bullet_has_no_room_are_named(world, monkeypatch, joints, feet, kept):
    told = []
    monkeypatch.setattr(world, "_warn", told.append)
    inertial = '<inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1"/></inertial>'
    chain = "".join('<link name="c%d">%s</link><joint name="j%d" type="continuous"><parent link="%s"/>'
                    '<child link="c%d"/></joint>' % (k, inertial, k, "c%d" % (k - 1) if k else "base", k)
                    for k in range(joints))
    balls = "".join(
        '<link name="f{0}"><collision><geometry><sphere radius="0.1"/></geometry></collision></link><joint name="k{0}" '
        'type="fixed"><parent link="base"/><child link="f{0}"/><origin xyz="{0} 0 0"/></joint><gazebo reference="f{0}">'
        '<mu1>{1}</mu1></gazebo>'.format(k, k / 1000) for k in range(feet))
    world.add_ground_plane()
    robot = parse_urdf('<robot name="r"><link name="base">%s</link>%s%s</robot>' % (inertial, chain, balls))
    model = world.spawn(robot, "r", Pose((0, 0, 0.0995)))
    assert len(model.parts.patches[-1]) == kept
    assert [text for text in told if "no room for all different surfaces of link 'base'" in text] == told
    assert len(told) == (kept < feet - 1)
    step(world, 1)
    assert {round(touch.position[0]) for touch in world.contacts(model)} >= set(range(feet))
