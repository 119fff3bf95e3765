# SPDX-License-Identifier: BSD-3-Clause
"""The reader of URDF and world files."""
import math
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from gazebo_msgs.srv import SpawnModelRequest

from bullet_sim import World
from gazebo_ros import urdf_extras, world_file
from gazebo_ros.gazebo_services import GazeboServices
from gazebo_ros.model_plugin import ModelPlugin
from gazebo_ros.plugin_table import PluginTable
from gazebo_ros.spawning import Spawner, is_floor
from gazebo_ros.urdf_extras import ExtrasError
from loop_ros.testing import FakeLog
from model_files.resources import model_folders
from sdf_model import ModelFolders, parse_sdf_model
from urdf_model import parse_urdf

WORLDS = Path(__file__).resolve().parents[2] / "worlds"
MODELS = ModelFolders(model_folders())
URDF = """<?xml version="1.0"?>
<robot name="arm">
  <link name="base"/><link name="tip"/>
  <joint name="hinge" type="continuous"><parent link="base"/><child link="tip"/></joint>
  <gazebo><plugin name="p" filename="liba.so"><robotNamespace>/arm</robotNamespace></plugin></gazebo>
  <gazebo reference="tip"><sensor name="s" type="ray"><plugin name="q" filename="libsensor.so"/></sensor></gazebo>
  <gazebo><plugin name="r" filename="libb.so"/></gazebo>
</robot>
"""


def test_plugins_of_sensors_are_not_plugins_of_the_model():
    assert [plugin.get("filename") for plugin in urdf_extras.plugins(parse_urdf(URDF))] == ["liba.so", "libb.so"]


def test_a_plugin_without_namespace_gets_the_one_it_is_spawned_with():
    own, none = urdf_extras.plugins(parse_urdf(URDF))
    assert urdf_extras.namespace_of(own, "/lab") == "/arm"
    assert urdf_extras.namespace_of(none, "lab//one/") == "/lab/one"
    assert urdf_extras.namespace_of(none, "/") == ""
    assert urdf_extras.namespace_of(none, "") == ""


@pytest.mark.parametrize("namespace", ["a\x01b", "a b", "/arm\0", "a-b", "\n"])
def test_a_namespace_that_is_none_in_ros_is_refused_unless_a_plugin_has_its_own(namespace):
    own, none = urdf_extras.plugins(parse_urdf(URDF))
    assert urdf_extras.namespace_of(own, namespace) == "/arm"
    with pytest.raises(urdf_extras.ExtrasError) as found:
        urdf_extras.namespace_of(none, namespace)
    assert "robot_namespace" in str(found.value) and "libb.so" in str(found.value) and str(found.value).isprintable()


@pytest.mark.parametrize("answers", [True, False])
def test_who_spawns_a_model_is_told_that_the_master_does_not_answer(answers):
    services = object.__new__(GazeboServices)
    services._spawner = SimpleNamespace(prepare=lambda *_: SimpleNamespace(mended="a box replaces it"),
                                        make_shapes=lambda prepared: None)
    services._simulation = SimpleNamespace(requests=SimpleNamespace(call=lambda *_: None))
    services._ros = SimpleNamespace(flush=lambda: answers)
    response = services._spawn_model(SpawnModelRequest(model_name="m", model_xml=URDF))
    assert response.success and "a box replaces it" in response.status_message
    assert ("ROS master" in response.status_message) is not answers


class Plain(ModelPlugin):
    pass


class NamedAfterModel(ModelPlugin):
    named_after_model = True


class NamedIfEmpty(ModelPlugin):
    named_if_empty = True


@pytest.mark.parametrize(("plugin_class", "model", "spawned_in", "own", "expected"), [
    (NamedAfterModel, "pioneer2dx", None, None, "/pioneer2dx"),
    (NamedAfterModel, "pioneer2dx", "", None, "/pioneer2dx"),
    (NamedAfterModel, "pioneer2dx", "/lab", None, "/lab"), (NamedAfterModel, "pioneer2dx", None, "/", ""),
    (NamedAfterModel, "pioneer2dx", None, "robot", "/robot"), (NamedAfterModel, "my robot", None, None, ""),
    (NamedAfterModel, "pioneer2dx", "/lab", "", "/pioneer2dx"),
    (NamedIfEmpty, "pioneer2dx", "/lab", "", "/pioneer2dx"),
    (NamedIfEmpty, "pioneer2dx", "", None, ""), (Plain, "pioneer2dx", "/lab", "", ""),
    (Plain, "pioneer2dx", None, None, "")])
def test_some_plugins_are_named_after_their_model(plugin_class, model, spawned_in, own, expected):
    element = "" if own is None else "<robotNamespace>%s</robotNamespace>" % own
    robot = parse_urdf('<robot name="r"><link name="l"/><gazebo><plugin name="p" filename="libp.so">%s</plugin>'
                       "</gazebo></robot>" % element)
    plugins = SimpleNamespace(find=lambda filename: plugin_class)
    spawner = SimpleNamespace(_library=SimpleNamespace(plugins=plugins), _log=FakeLog())
    (found,), _, _ = Spawner._plugins(spawner, model, robot, spawned_in)
    assert (found[0], found[2]) == (plugin_class, expected)


def test_a_start_configuration_comes_back_as_it_was_given():
    value = 0.1 + 0.2
    robot = parse_urdf(urdf_extras.with_start_configuration(URDF, [("hinge", value)]))
    assert urdf_extras.start_configuration(robot, pytest.fail) == {"hinge": value}


def test_no_start_configuration_leaves_the_description_alone():
    assert urdf_extras.with_start_configuration(URDF, []) == URDF
    assert urdf_extras.start_configuration(parse_urdf(URDF), pytest.fail) == {}


def test_a_start_position_that_is_no_number_is_named():
    robot = parse_urdf(urdf_extras.with_start_configuration(URDF, [("hinge", float("nan"))]))
    with pytest.raises(ExtrasError, match="finite"):
        urdf_extras.start_configuration(robot, pytest.fail)


def test_a_start_position_of_an_unknown_joint_is_passed_over():
    told = []
    robot = parse_urdf(urdf_extras.with_start_configuration(URDF, [("knee", 1.0), ("hinge", 1.0), ("hinge", 2.0)]))
    assert urdf_extras.start_configuration(robot, told.append) == {"hinge": 2.0}
    assert len(told) == 1 and "knee" in told[0] and "hinge" in told[0]


def test_the_force_sensor_of_a_joint_may_have_its_plugin_inside():
    sensor = ('<gazebo reference="hinge"><sensor name="ft" type="force_torque"><plugin filename="%s"/></sensor>'
              "</gazebo></robot>")
    robot = parse_urdf(URDF.replace("</robot>", sensor % "libgazebo_ros_ft_sensor.so"))
    plugin = urdf_extras.sensor_plugins(robot, pytest.fail)[-1]
    assert plugin.get("filename") == "libgazebo_ros_ft_sensor.so"
    assert urdf_extras.sensor_of(plugin)[1] == "hinge"
    told = []
    urdf_extras.sensor_plugins(parse_urdf(URDF.replace("</robot>", sensor % "libother.so")), told.append)
    assert len(told) == 1 and "hinge" in told[0]


def test_unknown_plugins_are_one_warning():
    spawner = object.__new__(Spawner)
    spawner._log, spawner._library = FakeLog(), SimpleNamespace(plugins=PluginTable({}))
    robot = parse_urdf(URDF.replace("</robot>", 3 * '<gazebo><plugin filename="libnao.so"/></gazebo>' + "</robot>"))
    assert spawner._plugins("nao", robot, "") == ([], [], {})
    (line,) = spawner._log.lines
    assert "'libnao.so' (3 times)" in line and "'liba.so'" in line and "'libsensor.so'" in line


def test_start_positions_of_an_sdf_go_into_its_model():
    sdf = urdf_extras.with_start_configuration("<sdf><model name='m'><link name='l'/></model></sdf>", [("hinge", 1.0)])
    assert sdf.index("<link") < sdf.index("<gazebo>") < sdf.index("</model>")


def test_start_positions_need_a_model():
    with pytest.raises(ExtrasError, match="</robot>.*</model>"):
        urdf_extras.with_start_configuration("<sdf/>", [("hinge", 1.0)])


def test_static_is_said_in_a_gazebo_element():
    assert urdf_extras.is_static(parse_urdf(URDF)) is None
    static = URDF.replace("</robot>", "<gazebo><static>true</static></gazebo></robot>")
    assert urdf_extras.is_static(parse_urdf(static)) is True


def write_world(folder, content):
    path = folder / "a.world"
    path.write_text('<sdf version="1.6">\n<world name="w">\n%s\n</world>\n</sdf>' % content, encoding="utf-8")
    return path


def test_the_empty_world_has_a_floor_and_needs_no_warning():
    world = world_file.read_world(world_file.find_world("worlds/empty.world", [WORLDS.parent]), MODELS)
    assert ([model.name for model in world.models], world.gravity, world.time_step_s) == (
        ["ground_plane"], (0.0, 0.0, -9.81), 0.001)
    assert is_floor(world.models[0].robot) and [light.name for light in world.lights] == ["sun"]
    assert (world.warning, world.problems) == ("", [])


def test_a_world_that_says_nothing_has_sdfs_gravity_and_step(tmp_path):
    world = world_file.read_world(write_world(tmp_path, ""), MODELS)
    assert (world.models, world.gravity, world.time_step_s) == ([], (0.0, 0.0, -9.8), 0.001)


def test_gravity_and_step_size_are_taken(tmp_path):
    world = world_file.read_world(write_world(
        tmp_path, "<gravity>0 0 -1.62</gravity><physics><max_step_size>0.001</max_step_size></physics>"), MODELS)
    assert (world.gravity, world.time_step_s) == ((0.0, 0.0, -1.62), 0.001)


@pytest.mark.parametrize("content, text", [
    ("<gravity>0 0</gravity>", "line 3.*'0 0'.*3 numbers"),
    ("<physics><max_step_size>fast</max_step_size></physics>", "line 3.*'fast'")])
def test_wrong_values_are_named_with_their_line(tmp_path, content, text):
    with pytest.raises(world_file.WorldFileError, match=text):
        world_file.read_world(write_world(tmp_path, content), MODELS)


def test_a_missing_world_says_where_it_was_looked_for(tmp_path):
    with pytest.raises(world_file.WorldFileError, match="nowhere.world.*%s" % tmp_path):
        world_file.find_world("nowhere.world", [tmp_path])


def test_a_misspelt_world_is_told_once_with_the_worlds_beside_it(tmp_path):
    for name in ("cafe.world", "table.world", "notes.txt"):
        (tmp_path / name).touch()
    missing = str(tmp_path / "kitchen.world")
    with pytest.raises(world_file.WorldFileError) as found:
        world_file.find_world(missing, [tmp_path, tmp_path])
    assert str(found.value) == (
        "world file '%s' not found; looked for %s; there is cafe.world, table.world" % (missing, missing))


def test_the_core_loads_without_ros():
    """Everything but the node and its conversions must import where there is no ROS."""
    block = "import sys; sys.modules.update(dict.fromkeys(%r)); " % (
        ("rospy", "rosgraph", "roslib", "gazebo_msgs", "geometry_msgs", "std_msgs", "std_srvs", "rosgraph_msgs"),)
    names = ("pacing", "model_plugin", "plugin_table", "simulation", "entities", "urdf_extras", "world_file", "jobs",
             "spawning")
    imports = "; ".join("import gazebo_ros.%s" % name for name in names)
    subprocess.run([sys.executable, "-c", block + imports], check=True)


@pytest.mark.parametrize("kind", ["ball", "universal", "revolute2"])
def test_a_pendulum_on_a_joint_of_several_axes_swings_in_all_directions(kind):
    axes = '<axis><xyz>1 0 0</xyz></axis><axis2><xyz>0 1 0</xyz></axis2>' * (kind != "ball")
    world = World(time_step_s=0.001, gravity=(0.0, 0.0, -9.81))
    robot = parse_sdf_model("""<sdf version="1.6"><model name="m"><link name="rod"><inertial><pose>0 0 -1 0 0 0</pose>
        <mass>1</mass><inertia><ixx>0.02</ixx><iyy>0.02</iyy><izz>0.02</izz></inertia></inertial></link><joint name="j"
        type="%s"><parent>world</parent><child>rod</child>%s</joint></model></sdf>""" % (kind, axes), "m.sdf").robot
    rod = world.spawn(robot, "rod")
    assert len(rod.joint_names) == (3 if kind == "ball" else 2)
    rod.set_joint_positions(np.arange(2), np.array([0.1, 0.2]))
    x, y, z = rod.link_pose("rod").matrix()[:3, :3] @ (0, 0, -1)
    for _ in range(round(1e3 * math.pi * math.sqrt(1.02 / 9.81))):  # half a period
        world.step()
    assert rod.link_pose("rod").matrix()[:3, :3] @ (0, 0, -1) == pytest.approx((-x, -y, z), abs=0.01)
    world.close()


def test_boxes_in_one_model_slide_by_themselves_as_in_gazebos_friction_pyramid():
    """Each starts at its own speed and stops after v² / (2 mu g); their model goes with the first."""
    world = World(time_step_s=0.001, gravity=(0.0, 0.0, -9.8))
    world.add_ground_plane()
    box = """<model name="box_%d"><pose>0 %d 0.1 0 0 0</pose><link name="link"><inertial><inertia><ixx>0.024</ixx>
        <iyy>0.024</iyy><izz>0.042</izz></inertia></inertial><collision name="c"><geometry><box><size>0.5 0.5 0.2</size>
        </box></geometry><surface><friction><ode><mu>0.3</mu><mu2>0.3</mu2></ode></friction></surface></collision>
        </link></model>"""
    found = parse_sdf_model('<sdf version="1.6"><model name="boxes">%s</model></sdf>' % "".join(
        box % (number, number) for number in range(3)), "m.sdf")
    model = world.spawn(found.robot, "boxes")
    speeds = (1.0, 2.0, 0.0)
    for number, speed in enumerate(speeds):
        model.set_root_twist("box_%d::link" % number, (speed, 0, 0), (0, 0, 0))
    for _ in range(1200):
        world.step()
    places = [model.link_pose("box_%d::link" % number).position[0] for number in range(3)]
    assert places == pytest.approx([speed ** 2 / (2 * 0.3 * 9.8) for speed in speeds], abs=0.01)
    assert model.model_pose().position[0] == pytest.approx(places[0], abs=1e-6) and found.warning == ""
    world.close()


BAR = """<link name="%s"><inertial><mass>%g</mass><inertia><ixx>%g</ixx><iyy>1</iyy><izz>1</izz></inertia></inertial>
</link>"""


def test_a_screw_goes_on_as_its_thread_says():
    """A torque accelerates it by T / (I + m / pitch²), and it goes on by -1 / pitch for each radian."""
    world = World(time_step_s=0.001, gravity=(0.0, 0.0, 0.0))
    screw = world.spawn(parse_sdf_model("""<sdf version="1.6"><model name="m">%s<joint name="j" type="screw">
        <parent>world</parent><child>bar</child><axis><xyz>1 0 0</xyz></axis><thread_pitch>4</thread_pitch></joint>
        </model></sdf>""" % (BAR % ("bar", 5.0, 0.5)), "m.sdf").robot, "m")
    index = screw.index(["j"])
    for _ in range(1000):
        screw.drive_effort(index, np.array([2.0]))
        world.step()
    angle, way = screw.read_joints()[0]
    assert angle == pytest.approx(0.5 * 2.0 / (0.5 + 5.0 / 16.0), rel=0.01)
    assert way == pytest.approx(-angle / 4.0, abs=1e-4)
    assert screw.link_pose("bar").position[0] == pytest.approx(way, abs=1e-6)
    world.close()


def test_a_gearbox_turns_its_child_by_its_ratio():
    """Gazebo's gearbox.world: the child turns by -ratio times the parent's angle; both inertias are felt."""
    world = World(time_step_s=0.001, gravity=(0.0, 0.0, 0.0))
    hinge = """<joint name="%s" type="revolute"><parent>%s</parent><child>%s</child><axis><xyz>1 0 0</xyz></axis>
        </joint>"""
    gears = world.spawn(parse_sdf_model("""<sdf version="1.6"><model name="m">%s%s%s<joint name="fix" type="fixed">
        <parent>world</parent><child>middle</child></joint>%s%s<joint name="gear" type="gearbox"><parent>one</parent>
        <child>two</child><gearbox_ratio>-1.5</gearbox_ratio><gearbox_reference_body>middle</gearbox_reference_body>
        <axis><xyz>1 0 0</xyz></axis><axis2><xyz>1 0 0</xyz></axis2></joint></model></sdf>""" % (
            BAR % ("middle", 1.0, 1.0), BAR % ("one", 1.0, 0.4), BAR % ("two", 1.0, 0.3),
            hinge % ("first", "middle", "one"), hinge % ("second", "middle", "two")), "m.sdf").robot, "m", static=True)
    index = gears.index(["second"])
    for _ in range(1000):
        gears.drive_effort(index, np.array([0.6]))
        world.step()
    first, second = gears.read_joints()[0]
    assert second == pytest.approx(1.5 * first, abs=1e-3)
    assert second == pytest.approx(0.5 * 0.6 / (0.3 + 0.4 / 1.5 ** 2), rel=0.01)
    world.close()
