# SPDX-License-Identifier: BSD-3-Clause
"""Links pulled by a spring: they go where the pointer is, calmly, and are let go when nobody asks any more."""
import numpy as np
import pytest

from bullet_sim import Pose, World
from gazebo_ros.dragging import FORGET_S, Drag, Drags, masses_of, push, spring_wrench
from urdf_model import parse_urdf

INERTIAL = '<inertial><mass value="%g"/><inertia ixx="%g" iyy="%g" izz="%g" ixy="0" ixz="0" iyz="0"/></inertial>'
BOX = '<visual><geometry>{0}</geometry></visual><collision><geometry>{0}</geometry></collision>'


def cube(mass, side):
    moment = mass * side ** 2 / 6.0
    return '<robot name="cube"><link name="body">%s%s</link></robot>' % (
        INERTIAL % (mass, moment, moment, moment), BOX.format('<box size="%g %g %g"/>' % (side, side, side)))


# A heavy base with a feather-light flag on a hinge.
FLAG = """<robot name="flag"><link name="%s">%s%s</link><link name="cloth">%s</link>
<joint name="hinge" type="continuous"><parent link="%s"/><child link="cloth"/><origin xyz="0 0 0.3"/><axis xyz="0 0 1"/>
</joint></robot>"""


def flag(root):
    return FLAG % (root, INERTIAL % (5.0, 0.05, 0.05, 0.05), BOX.format('<box size="0.2 0.2 0.2"/>'),
                   INERTIAL % (0.01, 1e-5, 1e-5, 1e-5), root)


@pytest.fixture(params=[0.001, 0.002])
def world(request):
    world = World(time_step_s=request.param)
    world.add_ground_plane()
    yield world
    world.close()


def pull(world, model, link, grip, target, seconds):
    """The largest speed of the model's frame meanwhile."""
    fastest = 0.0
    for _ in range(round(seconds / world.time_step_s)):
        push(model, link, Drag(np.array(grip), np.array(target), 0.0), world.time_step_s)
        world.step()
        fastest = max(fastest, float(np.linalg.norm(model.base_twist()[0])))
    return fastest


def grip_place(model, link, grip):
    return (model.link_pose(link).matrix() @ [*grip, 1.0])[:3]


@pytest.mark.parametrize(("mass", "side"), [(0.02, 0.04), (1.0, 0.2), (300.0, 0.5)])
def test_a_thing_goes_to_the_pointer_and_hangs_there_still(world, mass, side):
    model = world.spawn(parse_urdf(cube(mass, side)), "cube", Pose((0.0, 0.0, side / 2.0)))
    grip, target = (side / 2.0, 0.0, side / 2.0), (0.5, -0.3, 1.0)
    fastest = pull(world, model, "body", grip, target, 4.0)
    # Its weight stretches the spring by g / 15^2 = 44 mm.
    np.testing.assert_allclose(grip_place(model, "body", grip), np.add(target, (0.0, 0.0, -0.0436)), atol=0.01)
    linear, angular = model.base_twist()
    assert np.linalg.norm(linear) < 0.02 and np.linalg.norm(angular) < 0.3
    assert fastest < 12.0
    for _ in range(round(1.0 / world.time_step_s)):
        world.step()
    assert model.base_pose().position[2] < 0.9 * side  # let go, it falls


def test_a_pull_far_away_is_limited_in_acceleration(world):
    model = world.spawn(parse_urdf(cube(2.0, 0.2)), "cube", Pose((0.0, 0.0, 1.0)))
    pull(world, model, "body", (0.0, 0.0, 0.0), (1e6, 0.0, 1.0), 0.1)
    assert model.base_twist()[0][0] == pytest.approx(60.0 * 0.1, rel=0.05)


@pytest.mark.parametrize("root", ["world", "foot"])
def test_a_light_link_neither_swings_up_nor_tears_the_model_along(world, root):
    model = world.spawn(parse_urdf(flag(root)), "flag", Pose((0.0, 0.0, 0.1)))
    fastest = pull(world, model, "cloth", (0.1, 0.0, 0.0), (0.0, 0.4, 0.4), 2.0)
    assert abs(model.read_joints()[1][0]) < 0.5 and fastest < 1.0
    if root == "world":
        assert model.read_joints()[0][0] % (2.0 * np.pi) == pytest.approx(np.pi / 2.0, abs=0.1)


def test_a_fixed_model_is_pulled_as_by_a_person():
    world = World()
    try:
        model = world.spawn(parse_urdf(flag("world").replace('mass value="0.01"', 'mass value="40"')), "flag")
        masses = masses_of(model, "cloth", np.array([0.0, 0.0, 0.3]))
        assert masses.model == 3.5 and masses.grip == pytest.approx(40.0)
        force, _ = spring_wrench(masses, (100.0, 0.0, 0.0), np.zeros(3), np.zeros(3), 0.002)
        assert np.linalg.norm(force) == pytest.approx(210.0)
        free = world.spawn(parse_urdf(flag("foot")), "free", Pose((3.0, 0.0, 0.0)))
        assert masses_of(free, "cloth", np.zeros(3)).model == pytest.approx(5.01)
    finally:
        world.close()


def test_a_pull_ends_when_nobody_asks_for_it_any_more():
    drags = Drags()
    assert not drags
    first, second = (Drag(np.zeros(3), np.ones(3), now) for now in (10.0, 10.3))
    drags.ask(("a", "l"), first)
    drags.ask(("b", "l"), first)
    drags.ask(("a", "l"), second)
    assert len(drags) == 2 and ("a", "l") in drags
    assert dict(drags.due(10.0 + 0.9 * FORGET_S)) == {("a", "l"): second, ("b", "l"): first}
    assert dict(drags.due(10.0 + 1.1 * FORGET_S)) == {("a", "l"): second}
    drags.remove(lambda target: target[0] == "a")
    assert not drags and drags.due(10.4) == []
