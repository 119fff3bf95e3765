# SPDX-License-Identifier: BSD-3-Clause
"""A robot that is prepared beforehand has all that its servos ask for; others are refused with the reason."""
import subprocess
import sys
from pathlib import Path

import pytest
import rospkg

from moveit_servo import preparing

CONFIG = Path(__file__).resolve().parents[2] / "config"
PACKAGES = rospkg.RosPack()
ROBOTS = {
    "baxter": ("baxter_description", "urdf/baxter.urdf.xacro", "baxter_moveit_config", "config/baxter.srdf.xacro"),
    "probot": ("probot_description", "urdf/probot_anno.xacro", "probot_anno_moveit_config", "config/probot_anno.srdf")}
# Made for every arm of a robot in turn, as its servo does when it starts; prints what was not on disk.
SERVOS = """
import sys
from pathlib import Path
import yaml
from model_files.resources import ResourceFinder
from motion_planning.exact import ExactChecker
from motion_planning.model import MeshReader, PlanningModel
from motion_planning.planners.planning import sphere_model_of
from motion_planning.scene import Scene
from motion_planning.spheres import sphere_model
from moveit_servo.convex_parts import ConvexParts, cuts_named
from moveit_servo.surroundings import Surroundings
from urdf_model import description_text
urdf, srdf, parameters = map(Path, sys.argv[1:4])
file_of = sphere_model._file
def looked_for(function, parts, size):
    path = file_of(function, parts, size)
    if not path.exists():
        print("made:", function.__name__, size)
    return path
sphere_model._file = looked_for
model = PlanningModel.from_xml(description_text(urdf), description_text(srdf))
spheres = sphere_model_of(ExactChecker(model, MeshReader(ResourceFinder())))
cuts = cuts_named(yaml.safe_load(parameters.read_text()).get("mesh_cuts", ""), model)
for group in sys.argv[4:]:
    Surroundings(spheres, model.groups[group], ConvexParts(spheres, cuts).added_to(Scene(model)))
"""


def files(robot):
    urdf_package, urdf, srdf_package, srdf = ROBOTS[robot]
    return [str(path) for path in (Path(PACKAGES.get_path(urdf_package), urdf),
                                   Path(PACKAGES.get_path(srdf_package), srdf), CONFIG / (robot + ".yaml"))]


@pytest.mark.parametrize("robot, groups", [("baxter", ["left_arm", "right_arm"]), ("probot", ["manipulator"])])
def test_a_servo_of_a_prepared_robot_makes_nothing_at_its_start(robot, groups):
    assert preparing.prepare_servo(files(robot)) == 0
    done = subprocess.run([sys.executable, "-c", SERVOS, *files(robot), *groups], capture_output=True, text=True,
                          timeout=300)
    assert (done.returncode, done.stdout) == (0, ""), done.stderr


GROUP = "<group name='arm'><joint name='turn'/></group>"


def crank(folder, group, parameters):
    """Three files of a small robot without meshes."""
    (folder / "crank.urdf").write_text("""<robot name="crank"><link name="base"/><link name="arm"><collision>
<geometry><sphere radius="0.1"/></geometry></collision></link>
<joint name="turn" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>""")
    (folder / "crank.srdf").write_text("<robot name='crank'>%s</robot>" % group)
    (folder / "crank.yaml").write_text(parameters)
    return [str(folder / ("crank" + end)) for end in (".urdf", ".srdf", ".yaml")]


@pytest.mark.parametrize("group, parameters, reason", [
    ("", "{}", "has no group with joints that move"), (GROUP, "[1]", "expected the servo's parameters"),
    (GROUP, "mesh_cuts: a.b", "mesh_cuts is 'a.b'"), (GROUP, "mesh_cuts: [", "expected"),
])
def test_what_cannot_be_prepared_is_told(tmp_path, capsys, group, parameters, reason):
    assert preparing.prepare_servo(crank(tmp_path, group, parameters)) == 1
    error = capsys.readouterr().err
    assert error.startswith("prepare_servo: ") and reason in error


def test_a_robot_without_meshes_is_prepared(tmp_path):
    assert preparing.prepare_servo(crank(tmp_path, GROUP, "move_group_name: arm")) == 0
