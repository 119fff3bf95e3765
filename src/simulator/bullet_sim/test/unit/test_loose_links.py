# SPDX-License-Identifier: BSD-3-Clause
"""Links that no joint holds are bodies of their own."""
import numpy as np
import pytest

from bullet_sim import BulletSimError, Pose, World
from urdf_model import parse_urdf

G = 9.81
BODY = """<link name="%s"><inertial><origin xyz="0.01 0 0"/><mass value="2"/><inertia ixx="0.02" iyy="0.03" izz="0.04"/>
</inertial><collision><geometry><box size="0.2 0.2 0.2"/></geometry></collision></link>"""
JOINT = """<joint name="%s" type="%s"><parent link="%s"/><child link="%s"/><origin xyz="%s"/><axis xyz="0 1 0"/>
</joint>"""
PENDULUM = BODY % "hand" + JOINT % ("swing", "continuous", "free", "hand", "0.3 0 0")
TWO = '<robot name="two">%s%s%s</robot>' % (
    BODY % "base", BODY % "free", JOINT % ("held", "floating", "base", "free", "1 0 0.5"))
JOINTED = TWO.replace("</robot>", PENDULUM + "</robot>")
ON_WORLD = TWO.replace('name="base"', 'name="world"').replace('link="base"', 'link="world"')


@pytest.fixture
def world():
    world = World(time_step_s=0.001)
    yield world
    world.close()


def run(world, seconds):
    for _ in range(round(seconds / world.time_step_s)):
        world.step()


@pytest.mark.parametrize("kind", ["floating", "planar"])
def test_each_falls_and_turns_by_itself(world, kind):
    model = world.spawn(parse_urdf(TWO.replace("floating", kind)), "two", Pose((0, 0, 20)))
    assert model.link_pose("free").position == pytest.approx((1, 0, 20.5)) and model.free == (-1, -2)
    model.apply_wrench("free", (0, 0, 40.0), (0, 0, 3.0))
    world.step()
    run(world, 0.5)
    assert model.link_twist("base")[0][2] == pytest.approx(-G * 0.501, rel=1e-3)
    assert model.link_twist("free")[0][2] == pytest.approx(-G * 0.501 + 40.0 / 2.0 * 0.001, rel=1e-3)
    assert model.link_twist("free")[1][2] == pytest.approx(3.0 / 0.04 * 0.001, rel=1e-3)
    assert model.link_twist("base")[1][2] == pytest.approx(0.0, abs=1e-9)
    assert model.model_pose().position == model.base_pose().position


def test_the_free_link_of_a_model_on_the_world_falls_from_it(world):
    model = world.spawn(parse_urdf(ON_WORLD), "two", Pose((0, 0, 20)))
    run(world, 0.5)
    assert model.static and model.link_pose("world").position == (0, 0, 20)
    assert model.link_pose("free").position[2] == pytest.approx(20.5 - G * 0.125, abs=0.01)


def test_a_static_model_holds_all_its_links(world):
    model = world.spawn(parse_urdf(TWO), "two", Pose((0, 0, 20)), static=True)
    run(world, 0.5)
    assert model.link_pose("free").position == pytest.approx((1, 0, 20.5)) and not model.free


def test_the_whole_model_is_put_and_reset_and_one_link_too(world):
    world.set_gravity((0, 0, 0))
    model = world.spawn(parse_urdf(TWO), "two", Pose((0, 0, 20)))
    model.set_base_pose(Pose((5, 0, 1), (0, 0, 1, 0)))
    assert model.link_pose("free").position == pytest.approx((4, 0, 1.5))
    model.set_base_twist((0.1, 0, 0), (0, 0, 0))
    run(world, 1.0)
    assert model.link_pose("free").position == pytest.approx((4.1, 0, 1.5), abs=1e-6)
    model.set_root_pose("free", Pose((0, 3, 0)))
    model.set_root_twist("free", (0, 0, 0.5), (0, 0, 1.0))
    assert model.link_pose("free").position == pytest.approx((1, 3, 0.5))
    assert model.link_twist("free")[0] == pytest.approx((0, 0, 0.5), abs=1e-9)
    assert model.link_pose("base").position == pytest.approx((5.1, 0, 1), abs=1e-6)
    world.reset_models()
    run(world, 0.1)
    assert model.link_pose("base").position == pytest.approx((0, 0, 20))
    assert model.link_pose("free").position == pytest.approx((1, 0, 20.5))


def test_links_of_one_model_pass_through_each_other_unless_they_ask(world):
    """As in Gazebo, where self_collide is false by default; other models hit all of them."""
    both = TWO.replace("1 0 0.5", "0 0 0.5")
    asked = both.replace("</robot>", '<gazebo reference="base"><selfCollide>1</selfCollide></gazebo>'
                         '<gazebo reference="free"><selfCollide>1</selfCollide></gazebo></robot>')
    world.add_ground_plane()
    through = world.spawn(parse_urdf(both), "through", Pose((0, 0, 0.1)))
    stacked = world.spawn(parse_urdf(asked), "stacked", Pose((3, 0, 0.1)))
    run(world, 2.0)
    assert through.link_pose("free").position[2] == pytest.approx(0.1, abs=2e-3)
    assert stacked.link_pose("free").position[2] == pytest.approx(0.3, abs=2e-3)
    assert {frozenset((c.link_a, c.link_b)) for c in world.contacts(stacked, stacked)} == {frozenset(("base", "free"))}


def test_the_joints_of_a_loose_link_move_with_it(world):
    model = world.spawn(parse_urdf(JOINTED), "two", Pose((0, 0, 20)))
    swing = model.index(["swing"])
    model.drive_position(swing, np.array([0.5]), np.array([50.0]))
    run(world, 0.5)
    assert model.read_joints()[0] == pytest.approx([0.5], abs=1e-3)
    assert model.link_pose("base").position[2] == pytest.approx(20 - G * 0.125, abs=0.01)
    with pytest.raises(BulletSimError, match="free"):
        model.gravity_efforts()
    assert model.root_of("hand") == "free"
    model.set_damping(0, 0.1)
    assert model.damping.tolist() == [0.1]


def test_a_mass_that_is_set_and_a_state_that_is_restored_concern_the_loose_link(world):
    said = []
    world._watch._error = said.append
    world.set_gravity((0, 0, 0))
    model = world.spawn(parse_urdf(TWO), "two", Pose((0, 0, 20)))
    model.set_root_twist("free", (0.2, 0, 0), (0, 0, 0))
    model.set_inertial("free", 4.0, np.diag([0.1, 0.2, 0.3]), (0.0, 0.05, 0.0))
    run(world, 0.5)
    assert model.link_pose("free").position == pytest.approx((1.1, 0, 20.5), abs=1e-6)
    assert model.inertial("free").centre == pytest.approx((0, 0.05, 0))
    model._push(-2, (float("nan"), 0.0, 0.0))
    run(world, 0.1)
    assert len(said) == 1 and np.isfinite(model.link_pose("free").position).all()
    assert model.link_pose("free").position == pytest.approx((1.1, 0, 20.5), abs=1e-3)


def test_a_loose_link_is_moved_out_of_the_floor_alone(world):
    world.add_ground_plane()
    model = world.spawn(parse_urdf(TWO.replace("1 0 0.5", "1 0 -1.0")), "two", Pose((0, 0, 1.0)))
    world.step()
    assert model.link_pose("free").position[2] == pytest.approx(0.1, abs=2e-3)
    assert model.link_pose("base").position[2] == pytest.approx(1.0, abs=1e-3)
    assert abs(model.link_twist("free")[0][2]) < 0.05
