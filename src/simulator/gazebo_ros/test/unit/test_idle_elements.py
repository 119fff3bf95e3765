# SPDX-License-Identifier: BSD-3-Clause
"""The tables of <gazebo> elements and of plugins' elements against those that noetic reads, and what they say."""
import re
from pathlib import Path

import pytest

from gazebo_ros.idle_elements import URDF, idle_elements
from gazebo_ros.plugin_elements import PLUGINS, TABLES
from gazebo_ros.plugin_table import PluginTable
from urdf_model import parse_urdf

HERE = Path(__file__).resolve().parent
SOURCES = [HERE.parents[2] / name / "src" for name in (
    "gazebo_ros", "gazebo_plugins", "gazebo_ros_control", "sensor_renderer")]


def lists(name):
    """{first word of a line: the other words}."""
    lines = (HERE / name).read_text(encoding="utf-8").splitlines()
    return {line.split()[0]: line.split()[1:] for line in lines if line and not line.startswith("#")}


def test_every_element_that_noetic_reads_is_in_the_tables():
    noetic = lists("noetic_elements.txt")
    urdf = {kind: noetic.pop(kind) for kind in ("model", "link", "joint")}
    assert [(kind, tag) for kind, tags in urdf.items() for tag in tags if "%s/%s" % (kind, tag) not in URDF.rows] == []
    assert [(name, tag) for name, tags in noetic.items() for tag in tags
            if "plugin/" + tag not in TABLES[name].rows] == []


def test_tables_are_of_plugins_that_are_served():
    known = PluginTable.from_yaml(HERE.parents[1] / "config" / "model_plugins.yaml").known
    assert set(PLUGINS) <= set(known)


#: Plugins without elements, and those whose tables are their packages' business.
NO_TABLE = {"libactor_trajectory.so", "libbaxter_camera.so", "libbaxter_gazebo_ros_control.so",
            "libfetch_gazebo_plugin.so", "libgazebo_ros_projector.so", "libgazebo_ros_template.so",
            "libgazebo_ros_api_plugin.so", "libgazebo_ros_paths_plugin.so",
            "libroboticsgroup_gazebo_disable_link_plugin.so", "libroboticsgroup_upatras_gazebo_disable_link_plugin.so"}


def test_every_plugin_that_is_served_has_a_table():
    known = PluginTable.from_yaml(HERE.parents[1] / "config" / "model_plugins.yaml").known
    assert set(known) - set(PLUGINS) == NO_TABLE


# Elements that are put together from pieces, or have no effect in noetic.
PUT_TOGETHER = ("imu_name|detach|winch|.*([oO]ffset|[dD]rift|[dD]riftFrequency|[nN]oise|[sS]caleError)$|CxPrime|hokuyo|"
                "autoDistortion|distortion[KT]|(left|right)(Front|Rear)Joint|legacyModeNS")


def test_honoured_elements_are_read_by_the_sources():
    source = "".join(path.read_text(encoding="utf-8") for folder in SOURCES for path in folder.rglob("*.py")
                     if path.name != "plugin_elements.py")
    for name, (known, *_) in PLUGINS.items():
        for tag in known.split():
            if re.match(PUT_TOGETHER, tag):
                continue
            assert '"%s"' % tag in source, (name, tag)


LINKS = """<robot name="r"><link name="a"/><link name="b"/><joint name="j" type="continuous"><parent link="a"/>
<child link="b"/></joint>
%s</robot>"""


def said(block):
    return idle_elements(parse_urdf(LINKS % block), "r.urdf")


@pytest.mark.parametrize("block", [
    '<gazebo reference="a"><mu1>0.5</mu1><mu2>0.5</mu2><kp>1</kp><selfCollide>false</selfCollide><maxVel>0.01</maxVel>'
    "<fdir1>0 0 1</fdir1><minDepth>0.001</minDepth><laserRetro>0</laserRetro><material>Gazebo/Red</material></gazebo>",
    '<gazebo reference="a"><mu1 value="0.5"/><mu2 value="0.1"/><collision><surface><friction><ode><mu2>2</mu2></ode>'
    "</friction></surface></collision></gazebo>",
    '<gazebo reference="j"><provideFeedback>true</provideFeedback><springStiffness>1</springStiffness></gazebo>',
    '<gazebo><static>true</static><plugin filename="libother.so"><any>1</any></plugin></gazebo>',
    '<gazebo reference="a"><sensor type="camera" name="s"><camera><image><width>9</width></image></camera><plugin '
    'filename="lib/libgazebo_ros_camera.so"><cameraName>c</cameraName><Cx>0.0</Cx></plugin></sensor></gazebo>'])
def test_what_has_its_effect_or_none_in_gazebo_is_no_news(block):
    assert said(block) == ""


@pytest.mark.parametrize(("block", "words"), [
    ('<gazebo reference="a"><mu1>1</mu1><mu2>0.1</mu2><fdir1>1 0 0</fdir1><minDepth>0.003</minDepth></gazebo>',
     ["minDepth"]),
    ('<gazebo reference="a"><selfCollide>true</selfCollide><dampingFactor>0.1</dampingFactor><maxVel>1</maxVel>'
     "</gazebo>", []),
    ('<gazebo reference="j"><stopCfm>0.1</stopCfm><fudgeFactor>1</fudgeFactor></gazebo>',
     ["stopCfm", "fudgeFactor"]),
    ('<gazebo reference="j"><stopCfm value="0.1"/><stopErp value="0.2"/></gazebo>', ["stopCfm"]),
    ('<gazebo reference="a"><minDepth>deep</minDepth><maxContacts>ten</maxContacts></gazebo>',
     ["minDepth", "maxContacts"]),
    ('<gazebo reference="a"><visual><material/></visual></gazebo>', ["material"]),
    ('<gazebo><joint name="k" type="revolute"/><bar/></gazebo>', ["bar"]),
    ('<gazebo reference="nose"><mu1>1</mu1></gazebo>', ["nose"]),
    ('<gazebo reference="a"><sensor type="imu" name="s"><imu><noise/></imu><plugin '
     'filename="libgazebo_ros_imu_sensor.so"><xyzOffset>1 0 0</xyzOffset><gaussian>1</gaussian></plugin></sensor>'
     "</gazebo>", ["imu", "xyzOffset", "gaussian"])])
def test_what_has_an_effect_in_gazebo_alone_is_named_with_its_line(block, words):
    text = said(block)
    for word in words:
        assert re.search(r"\b%s\b[^(]*\(r.urdf line 3\)" % word, text), text
    assert text.count("(") == len(words)
