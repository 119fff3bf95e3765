# SPDX-License-Identifier: BSD-3-Clause
"""The table of SDF's elements against the published ones, and what it says of a file."""
import re
from pathlib import Path

import pytest

from sdf_model import elements, parse_sdf_model, parse_sdf_world
from sdf_model.elements import TABLE

HERE = Path(__file__).resolve().parent
SRC = HERE.parents[3]


def published():
    """{path: default or ""} of SDF's elements, without those in elements of which the table has no children."""
    found = {}
    for line in (HERE / "sdf_1_7.txt").read_text(encoding="utf-8").splitlines():
        if not line.startswith("#"):
            parent, *children = line.split(" | ")
            if parent in TABLE.rows and parent not in TABLE.parents:
                continue
            found.update(("%s/%s" % (parent, name), default)
                         for name, _, default in (child.partition("=") for child in children))
    return found


def test_every_published_element_is_in_the_table():
    assert [path for path in published() if path not in TABLE.rows] == []


def test_defaults_are_harmless():
    """An element that Gazebo writes into a saved world with its default is no news."""
    for path, default in published().items():
        row = TABLE.rows[path]
        if row.reason and row.harmless is not None and default and "@" not in row.harmless:
            first = row.harmless.split("|")[0]
            assert first == default or [float(word) for word in first.split()] == [
                float(word) for word in default.split()], path


def test_honoured_elements_are_read_by_the_source():
    source = "".join(path.read_text(encoding="utf-8") for name in (
        "sdf_model", "gazebo_ros", "gazebo_plugins", "sensor_renderer", "gazebo_ros_control")
                     for path in SRC.glob("*/%s/src/**/*.py" % name) if path.name != "elements.py")
    names = {name for names in elements.HONOURED.values() for name in names.split()}
    # The distortion's are fields of a tuple, the others mean no shape and the file itself.
    assert {name for name in names if not re.search(r"[\"'/ ]%s[\"'/ ]" % name, source)} <= {
        "empty", "sdf", "p1", "p2"}


def test_a_state_that_is_more_than_poses_is_named(tmp_path):
    path = tmp_path / "a.world"
    path.write_text("""<sdf version="1.6"><world name="w"><model name="ball"><link name="l"/></model>
<model name="door"><link name="l"/><link name="k"/><joint name="j" type="revolute"><parent>l</parent><child>k</child>
<axis><xyz>0 0 1</xyz></axis></joint></model><state world_name="w">
<model name="ball"><pose>1 0 0 0 0 0</pose><link name="l"><velocity>0 0 -3 0 0 0</velocity></link></model>
<model name="door"><link name="k"><velocity>0 -0 1e-05 0 0 0</velocity></link></model></state></world></sdf>""")
    warning = parse_sdf_world(path).warning
    assert "velocities of model 'ball' in <state> (%s line 4)" % path in warning
    assert "joint positions of model 'door' in <state> (%s line 5)" % path in warning and warning.count("(") == 2


LINK = """<link name="l"><collision name="c"><geometry><box><size>1 1 1</size></box></geometry><surface>
%s</surface></collision></link>"""


@pytest.mark.parametrize("inside, named", [
    ("<friction><ode><mu>1</mu><mu2>0.5</mu2></ode></friction>", ""),
    ("<friction><ode><mu>100</mu><mu2>50</mu2></ode></friction>", ""),
    ("<friction><ode><mu>1</mu><mu2>0.5</mu2><fdir1>0 1 0</fdir1></ode></friction>", ""),
    ("<friction><ode><mu>0.5</mu><mu2>0.5</mu2><fdir1>0 0 0</fdir1><slip1>0.0</slip1></ode></friction>", ""),
    ("<friction><ode><mu2>1</mu2></ode><bullet><friction>0.1</friction></bullet></friction>", ""),
    ("<friction><torsional><coefficient>0.1</coefficient><ode/></torsional></friction>", "coefficient"),
    ("<contact><collide_bitmask>65535</collide_bitmask><ode/></contact><bounce/>", ""),
    ("<contact><collide_bitmask>2</collide_bitmask></contact>", ""),
    ("<contact><collide_without_contact>1</collide_without_contact></contact>", "collide_without_contact"),
    ("<contact><ode><max_vel>0.01</max_vel><min_depth>0.003</min_depth></ode></contact>", "min_depth"),
    ("<foo>1</foo>", "foo")])
def test_what_has_an_effect_in_gazebo_alone_is_named_with_its_line(inside, named):
    xml = "<sdf version='1.6'><model name='m'>\n%s</model></sdf>" % (LINK % inside)
    warning = parse_sdf_model(xml, "m.sdf").warning
    if not named:
        assert warning == ""
    else:
        assert "%s (m.sdf line 3)" % named in warning and warning.count("(") == 1
        assert ("not known" in warning) == (named == "foo")


@pytest.mark.parametrize("link, named", [
    ("<link name='l'><collision name='c'><max_contacts>many</max_contacts></collision></link>", ["max_contacts"]),
    ("<link name='l'><collision name='c'><max_contacts>4</max_contacts></collision></link>", []),
    (LINK % "<contact><ode><min_depth>deep</min_depth></ode></contact>", ["min_depth"]),
    ("<link name='l'><must_be_base_link>perhaps</must_be_base_link></link>", ["must_be_base_link"]),
    ("<link name='l'><must_be_base_link>True</must_be_base_link></link>", []),
    ("<link name='l'><sensor name='s' type='ray'><ray><scan><horizontal><samples>all</samples></horizontal></scan>"
     "</ray><always_on/></sensor></link>", ["samples"]),
    ("<link name='l'><sensor name='s' type='ray'><always_on>yes</always_on><update_rate>10 Hz</update_rate></sensor>"
     "</link>", ["always_on", "update_rate"])])
def test_a_text_that_is_no_number_is_named_where_nobody_reads_it(link, named):
    warning = parse_sdf_model("<sdf version='1.6'><model name='m'>\n%s</model></sdf>" % link, "m.sdf").warning
    assert re.findall(r"(\w+_\w+|samples) \(m.sdf line [23]\)", warning) == named


def test_a_world_says_it_once_for_all_its_models(tmp_path):
    path = tmp_path / "a.world"
    path.write_text("""<sdf version="1.6"><world name="w"><wind><linear_velocity>1 0 0</linear_velocity></wind>
<magnetic_field>6e-06 2.3e-05 -4.2e-05</magnetic_field><gui fullscreen="0"/><atmosphere type="adiabatic"/>
<physics type="ode"><ode><solver><iters>100</iters></solver></ode></physics>
<model name="a"><link name="l">%s<enable_wind>0</enable_wind></link></model>
<model name="b"><link name="l">%s<self_collide>0</self_collide></link></model>
<state world_name="w"><sim_time>1 0</sim_time><insertions/></state></world></sdf>"""
                    % (2 * ("<battery/>",)))
    warning = parse_sdf_world(path).warning
    assert warning.count("without an effect") == 1
    for words in ("linear_velocity (%s line 1)", "iters (%s line 3)", "battery (%s line 4, 5)",
                  "insertions (%s line 6"):
        assert words % path in warning
    assert warning.count("(") == 4
