# SPDX-License-Identifier: BSD-3-Clause
"""A fixed robot with two arms is two multibodies in Bullet, and nobody notices."""
import numpy as np
import pytest

from bullet_sim import Pose, World, multibodies
from bullet_sim.quiet_pybullet import pybullet
from urdf_model import merge_fixed, parse_urdf

ROUND = '<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.012" iyz="0" izz="0.008"/>'
LINK = """<link name="%%s"><inertial><origin xyz="0.1 0 0.01"/><mass value="%%g"/>%s</inertial>
<collision><origin xyz="0.1 0 0"/><geometry><box size="0.16 0.04 0.04"/></geometry></collision></link>""" % ROUND
JOINT = """<joint name="%s" type="revolute"><parent link="%s"/><child link="%s"/><origin xyz="%s"/><axis xyz="%s"/>
<limit lower="-3" upper="3" effort="200" velocity="5"/></joint>"""
AXES = ("0 0 1", "0 1 0", "1 0 0", "0 1 0")


def limb(side, y, count=4):
    """The elements of a chain of `count` links that begins at y [m] on the body."""
    for number in range(count):
        name, parent = "%s_%d" % (side, number), "%s_%d" % (side, number - 1) if number else "body"
        yield LINK % (name, 1.0 + 0.1 * number) + JOINT % (
            name + "_joint", parent, name, "0 %g 0" % y if not number else "0.2 0 0", AXES[number])


def description(*limbs):
    return '<robot name="two"><link name="body"><collision><geometry><box size="0.1 0.1 0.6"/></geometry></collision>' \
           "</link>%s</robot>" % "".join(limbs)


ARMS = (*limb("left", 0.3), *limb("right", -0.3), *limb("head", 0.0, 1))
# The joints of the two arms by turns.
BY_TURNS = tuple(element for pair in zip(limb("left", 0.3), limb("right", -0.3), strict=True) for element in pair)


def numbers(limbs, separate=True):
    return [limb.joints for limb in multibodies.limbs(merge_fixed(parse_urdf(description(*limbs))), separate)]


def test_large_limbs_of_a_fixed_root_are_multibodies_and_the_smallest_takes_the_small_ones():
    shorter = (*limb("left", 0.3), *limb("right", -0.3, 3), *limb("head", 0.0, 1))
    assert numbers(ARMS) == [[0, 1, 2, 3, 8], [4, 5, 6, 7]]
    assert numbers(ARMS, separate=False) == [list(range(9))]
    assert numbers(shorter) == [list(range(8))]
    assert numbers(()) == [[]]
    assert sorted(sum(numbers(BY_TURNS), [])) == list(range(8))
    assert len(numbers(BY_TURNS)) == 2


@pytest.fixture(params=[ARMS, BY_TURNS], ids=["one after the other", "by turns"])
def both(request, monkeypatch):
    """A generator of (world, model): the same robot as two multibodies and then as one, each in its own world."""

    def each(**options):
        for least, count in ((4, 2), (100, 1)):
            monkeypatch.setattr(multibodies, "_MIN_JOINTS", least)
            world = World()
            model = world.spawn(parse_urdf(description(*request.param)), "two", Pose((0.0, 0.0, 1.0)), static=True,
                                **options)
            assert len(model.parts.bodies) == count
            yield world, model
            world.close()

    return each


def test_it_moves_as_one_multibody_does(both):
    ends = []
    for world, model in both():
        start = np.random.default_rng(1).uniform(-1.0, 1.0, len(model.joint_names))
        every, some = np.arange(len(start)), model.index(["left_1_joint", "right_2_joint", "right_0_joint"])
        model.set_joint_positions(every, start)
        for tick in range(300):
            model.drive_position(every, start + 0.001 * tick, model.max_effort)
            model.drive_velocity(some[:1], np.array([0.3]), np.array([50.0]))
            if tick > 100:
                model.drive_effort(some[1:], np.array([2.0, -3.0]))
            model.apply_wrench("right_3", (0.0, 5.0, 0.0), (0.1, 0.0, 0.0))
            world.step()
        ends.append((*model.read_joints(), *(np.concatenate(model.link_twist(link)) for link in model.link_names),
                     *(model.link_pose(link).matrix() for link in model.link_names)))
        assert np.abs(ends[0][0] - start).max() > 0.2
    for two, one in zip(*ends, strict=True):
        np.testing.assert_allclose(two, one, atol=1e-5)


@pytest.mark.parametrize("what", [
    lambda model, values: model.gravity_efforts(values[0]),
    lambda model, values: model.inverse_dynamics(*values),
    lambda model, values: model.mass_matrix(values[0]),
], ids=["gravity", "inverse dynamics", "inertia"])
def test_its_dynamics_are_those_of_one(both, what):
    values = np.random.default_rng(2).uniform(-1.0, 1.0, (3, 9))
    two, one = (what(model, values[:, :len(model.joint_names)]) for _, model in both())
    assert np.abs(one).max() > 0.1
    np.testing.assert_allclose(two, one, atol=1e-9)


def test_its_limbs_stay_together_when_its_root_is_put_elsewhere(both):
    places = []
    for _, model in both():
        model.set_base_pose(Pose((1.0, 2.0, 3.0), (0.0, 0.0, 0.7071067811865476, 0.7071067811865476)))
        places.append([model.link_pose(link).matrix() for link in model.link_names])
    np.testing.assert_allclose(*places, atol=1e-9)


def clap(world, model):
    """Bring the two hands together; return the contacts of the model."""
    target = np.zeros(len(model.joint_names))
    target[model.index(["left_0_joint", "right_0_joint"])] = -0.5, 0.5
    for tick in range(400):
        model.drive_position(np.arange(len(target)), target * min(1.0, tick / 300), np.full(len(target), 60.0))
        world.step()
    return world.contacts(model)


@pytest.mark.parametrize("at_spawn", [True, False])
def test_limbs_collide_only_where_it_is_wanted(both, at_spawn):
    hands = [("left_3", "right_3")]
    for world, model in both(**({"self_collision_pairs": hands} if at_spawn else {})):
        if not at_spawn:
            assert clap(world, model) == []
            model.set_self_collision_pairs(hands)
            model.set_joint_positions(np.arange(len(model.joint_names)), np.zeros(len(model.joint_names)))
        found = clap(world, model)
        assert {frozenset((contact.link_a, contact.link_b)) for contact in found} == {frozenset(hands[0])}
        assert len({contact.position for contact in found}) == len(found)  # each once
        assert len(world.contacts(model, model)) == len(found)
        assert model.contact_force("left_3")[1] > 1.0
        if len(model.parts.bodies) == 2:
            np.testing.assert_allclose(model.contact_force("left_3"), -model.contact_force("right_3"), atol=1e-6)


def test_rays_and_other_models_meet_the_right_link(both):
    for world, model in both():
        world.detect_contacts()
        place = model.link_pose("right_2").position
        above = (place[0] + 0.1, place[1], place[2] + 0.5)
        assert world.first_hits([above], [(above[0], above[1], 0.0)]) == [("two", "right_2")]
        box = world.spawn(parse_urdf(description().replace("0.1 0.1 0.6", "0.02 0.02 0.02")), "box",
                          Pose((above[0], above[1], place[2] + 0.02)))
        for _ in range(50):
            model.drive_position(np.arange(len(model.joint_names)), np.zeros(len(model.joint_names)), model.max_effort)
            world.step()
        assert {(contact.model_b, contact.link_b) for contact in world.contacts(box)} == {("two", "right_2")}
        assert {(contact.model_b, contact.link_b) for contact in world.contacts(box, model)} == {("two", "right_2")}
        world.delete("box")
        world.delete("two")
        assert pybullet.getNumBodies(physicsClientId=world._client) == 0


def test_it_survives_a_rebuild(both):
    ends = []
    for world, model in both():
        count, before = len(model.joint_names), model.parts
        index = model.index(["left_0_joint", "left_3_joint"])
        model.set_joint_positions(index, np.array([0.4, 0.2]))
        model.couple(*index, 0.5)
        model.set_limits(model.index(["right_3_joint"])[0], -0.1, 0.1)
        world.rebuild([model])
        assert len(model.parts.bodies) == len(before.bodies)
        np.testing.assert_allclose(model.read_joints()[0][index], [0.4, 0.2], atol=1e-9)
        for _ in range(100):
            model.drive_position(np.arange(count), np.full(count, 0.3), model.max_effort)
            model.release(index[1:])
            world.step()
        ends.append(model.read_joints()[0])
        assert ends[-1][index[1]] == pytest.approx(0.15, abs=0.01)
        assert ends[-1][model.index(["right_3_joint"])[0]] == pytest.approx(0.1, abs=0.01)
    np.testing.assert_allclose(*ends, atol=1e-4)


@pytest.mark.parametrize("ratio", [-1.0, 0.5])
def test_limbs_whose_joints_are_coupled_become_one_multibody(both, ratio):
    ends = []
    for world, model in both():
        count, index = len(model.joint_names), model.index(["left_0_joint", "right_0_joint"])
        model.set_joint_positions(index, np.array([0.2, 0.2 * ratio]))
        model.couple(*index, ratio)
        assert len(model.parts.bodies) == 1
        for tick in range(200):
            target = np.zeros(count)
            target[index[0]] = 0.2 + 0.001 * tick
            model.drive_position(np.arange(count), target, model.max_effort)
            model.release(index[1:])
            world.step()
        ends.append(model.read_joints()[0])
        assert ends[-1][index[1]] == pytest.approx(ratio * ends[-1][index[0]], abs=0.005)
    np.testing.assert_allclose(*ends, atol=1e-6)
