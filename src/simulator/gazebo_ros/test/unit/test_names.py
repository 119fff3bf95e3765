# SPDX-License-Identifier: BSD-3-Clause
"""Names of models, links and collisions, as Gazebo gives and understands them."""
import pytest
from gazebo_msgs.srv import GetModelPropertiesRequest, SetLinkPropertiesRequest

from bullet_sim import Pose, World
from gazebo_ros.contact_messages import CollisionNames, contact_states
from gazebo_ros.entities import Entities, UnknownEntity
from gazebo_ros.gazebo_services import GazeboServices
from gazebo_ros.simulation import Simulation
from loop_ros.request_queue import RequestQueue
from loop_ros.testing import FakeFaults, FakeLog, FakeRos
from sdf_model import parse_sdf_model
from urdf_model import collision_names, gazebo_links, parse_urdf

INERTIAL = '<inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>'
CART = """<robot name="cart"><link name="base">%s</link><link name="camera"/><joint name="mount" type="fixed">
<parent link="base"/><child link="camera"/><origin xyz="0 0 0.3"/></joint></robot>""" % INERTIAL


@pytest.fixture
def world():
    world = World()
    yield world
    world.close()


def test_a_reference_frame_is_a_model_or_a_link_with_or_without_its_model(world):
    for number, name in enumerate(("one", "two", "camera")):
        world.spawn(parse_urdf(CART), name, Pose((float(number), 0.0, 1.0)))
    entities = Entities(world)
    places = {name: entities.frame(name)[0][:3, 3].tolist()
              for name in ("", "two", "two::camera", "base", "camera", "camera::base")}
    # A model goes before a link of its name; of several links, the first model's counts.
    assert places == {"": [0, 0, 0], "two": [1, 0, 1], "two::camera": [1, 0, 1.3], "base": [0, 0, 1],
                      "camera": [2, 0, 1], "camera::base": [2, 0, 1]}
    # A model's name may have a :: itself, of which another model's may be the beginning.
    world.spawn(parse_urdf(CART), "two::front", Pose((3.0, 0.0, 1.0)))
    assert [entities.link(name)[0].name for name in ("two::front::camera", "two::camera")] == ["two::front", "two"]
    with pytest.raises(UnknownEntity, match="model 'two' has no link 'rear::camera'"):
        entities.link("two::rear::camera")
    with pytest.raises(UnknownEntity, match="'lens' is no model and no link; models: one, two, camera"):
        entities.frame("lens")


BOX = '<collision%s><origin xyz="%s"/><geometry><box size="0.2 0.2 0.2"/></geometry></collision>'
JOINT = '<joint name="%s" type="%s"><parent link="%s"/><child link="%s"/></joint>'
ROBOT = """<robot name="r"><link name="foot">%s%s</link><link name="body">%s%s</link><link name="lens"/>
<link name="lid"/>%s<gazebo reference="hold_lens"><preserveFixedJoint>true</preserveFixedJoint></gazebo></robot>""" % (
    INERTIAL, BOX % ("", "0 0 0"), BOX % (' name="shell"', "1 0 0"), BOX % ("", "2 0 0"),
    "".join(JOINT % joint for joint in (("hold", "fixed", "foot", "body"), ("hold_lens", "fixed", "body", "lens"),
                                        ("hinge", "continuous", "body", "lid"))))


def test_links_and_collisions_of_a_urdf_have_sdformats_names():
    robot = parse_urdf(ROBOT)
    assert gazebo_links(robot) == {"foot": "foot", "body": "foot", "lens": "lens", "lid": "lid"}
    assert [name.name for name in collision_names(robot).values()] == [
        "foot_collision", "foot_fixed_joint_lump__shell_collision_1", "foot_fixed_joint_lump__body_collision_2"]
    standing = parse_urdf(ROBOT.replace("foot", "world").replace(INERTIAL, ""))
    assert gazebo_links(standing) == {"body": "body", "lens": "lens", "lid": "lid"}
    # A name that does not begin with the link's gets it in front, even if nothing was lumped.
    assert [name.name for name in collision_names(standing).values()] == [
        "body_fixed_joint_lump__shell_collision", "body_collision_1"]


def test_links_of_an_sdf_all_stay():
    robot = parse_sdf_model("""<sdf version="1.6"><model name="m"><link name="a"><collision name="hull"><geometry>
<sphere><radius>0.1</radius></sphere></geometry></collision></link><link name="b"/><joint name="j" type="fixed">
<parent>a</parent><child>b</child></joint></model></sdf>""", "m.sdf").robot
    assert gazebo_links(robot) == {"a": "a", "b": "b"}
    assert collision_names(robot) == {("a", 0): ("a", "hull")}


def test_contacts_have_the_names_of_the_collisions_that_touch(world):
    world.add_ground_plane()
    model = world.spawn(parse_urdf(ROBOT), "it", Pose((0.0, 0.0, 0.1)))
    for _ in range(100):
        world.step()
    names = CollisionNames(world)
    states = contact_states(world.contacts(), names)
    assert {state.collision2_name for state in states} | {state.collision1_name for state in states} == {
        "ground_plane::link::collision", "it::foot::foot_collision",
        "it::foot::foot_fixed_joint_lump__shell_collision_1", "it::foot::foot_fixed_joint_lump__body_collision_2"}
    about = {names.of_link(model, "foot")["foot_fixed_joint_lump__shell_collision_1"]}
    (state,) = contact_states(world.contacts(), names, about)
    assert {state.collision1_name} == about and all(normal.z > 0.99 for normal in state.contact_normals)
    assert all(position.x == pytest.approx(1.0, abs=0.11) for position in state.contact_positions)


@pytest.mark.parametrize("number", [float("nan"), float("inf"), 1e300])
@pytest.mark.filterwarnings("error")
def test_an_inertia_that_is_none_is_refused_with_the_reason(world, number):
    ros, log = FakeRos(), FakeLog()
    world.spawn(parse_urdf(CART), "cart")
    GazeboServices(Simulation(world, RequestQueue(), log, FakeFaults()), None, None, ros, log)
    answer = ros.services["/gazebo/set_link_properties"](
        SetLinkPropertiesRequest(link_name="cart::base", mass=1.0, ixx=number, iyy=0.1, izz=0.1))
    assert not answer.success and "the inertia of link 'base' is" in answer.status_message


def test_models_in_a_model_are_its_children(world):
    nested = parse_sdf_model(
        '<sdf version="1.7"><model name="arm"><link name="base"/><model name="hand"><link name="palm"/>'
        '<model name="tip"><link name="pad"/></model></model><model name="eye"><link name="lens"/></model></model>'
        "</sdf>", "arm.sdf")
    ros, log = FakeRos(), FakeLog()
    world.spawn(nested.robot, "arm")
    GazeboServices(Simulation(world, RequestQueue(), log, FakeFaults()), None, None, ros, log)
    found = ros.services["/gazebo/get_model_properties"](GetModelPropertiesRequest("arm"))
    assert found.child_model_names == ["hand", "eye"]
    assert found.body_names == ["base", "hand::palm", "hand::tip::pad", "eye::lens"]
