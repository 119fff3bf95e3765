# SPDX-License-Identifier: BSD-3-Clause
"""Every message and service must have the MD5 sum that its peers expect.

A package states its sums in ``test/md5sums.yaml`` (sections ``msg``, ``srv`` and, for the messages that actions turn
into, ``action``); this test finds them all. It computes them from the definition files, so neither a build nor a
sourced workspace is needed.
"""
import os
from functools import cache
from pathlib import Path

import genmsg
import genmsg.msg_loader
import pytest
import yaml

SRC = Path(__file__).resolve().parents[2] / "src"
TABLES = sorted(SRC.glob("**/test/md5sums.yaml"))

# The messages that actionlib makes from the three parts of an action: suffix of the name -> definition.
ACTION_MESSAGES = {
    "Goal": "{goal}",
    "Result": "{result}",
    "Feedback": "{feedback}",
    "ActionGoal": "std_msgs/Header header\nactionlib_msgs/GoalID goal_id\n{name}Goal goal\n",
    "ActionResult": "std_msgs/Header header\nactionlib_msgs/GoalStatus status\n{name}Result result\n",
    "ActionFeedback": "std_msgs/Header header\nactionlib_msgs/GoalStatus status\n{name}Feedback feedback\n",
    "Action": "{name}ActionGoal action_goal\n{name}ActionResult action_result\n{name}ActionFeedback action_feedback\n",
}


def expected_sums(table):
    """{("msg", "srv" or "action", type name): sum} of one package; scalars stay strings, even if they are all
    digits."""
    sections = yaml.load(table.read_text(), Loader=yaml.BaseLoader)
    return {(kind, name): md5 for kind, sums in sections.items() for name, md5 in sums.items()}


@cache
def search_path():
    """Message folders of every ROS package: ours from the sources, the others from the installed ROS."""
    prefixes = [*filter(None, os.environ.get("CMAKE_PREFIX_PATH", "").split(":")), "/usr"]
    folders = {}
    for folder in (folder for prefix in prefixes for folder in Path(prefix).glob("share/*/msg")):
        folders.setdefault(folder.parent.name, [str(folder)])
    folders.update({file.parents[1].name: [str(file.parent)] for file in SRC.glob("**/msg/*.msg")})
    return folders


def action_messages(folder):
    """{type name: definition} of the messages that the actions of one package turn into."""
    definitions = {}
    for file in (folder / "action").glob("*.action"):
        goal, result, feedback = file.read_text().split("---\n")
        definitions.update({file.stem + suffix: text.format(name=file.stem, goal=goal, result=result, feedback=feedback)
                            for suffix, text in ACTION_MESSAGES.items()})
    return definitions


def md5_of(kind, folder, name):
    context = genmsg.MsgContext.create_default()
    load = {"msg": genmsg.msg_loader.load_msg_from_file, "srv": genmsg.msg_loader.load_srv_from_file}
    if kind == "action":
        specs = {made: genmsg.msg_loader.load_msg_from_string(context, text, "%s/%s" % (folder.name, made))
                 for made, text in action_messages(folder).items()}
        spec = specs[name]
    else:
        spec = load[kind](context, str(folder / kind / ("%s.%s" % (name, kind))), "%s/%s" % (folder.name, name))
        specs = {name: spec}
    for loaded in specs.values():
        genmsg.load_depends(context, loaded, search_path())
    return genmsg.compute_md5(context, spec)


CASES = [pytest.param(table.parents[1], kind, name, md5, id="%s/%s" % (table.parents[1].name, name))
         for table in TABLES for (kind, name), md5 in expected_sums(table).items()]


def test_tables_were_found():
    packages = {table.parents[1].name for table in TABLES}
    assert packages >= {"baxter_core_msgs", "baxter_maintenance_msgs", "control_msgs", "controller_manager_msgs",
                        "four_wheel_steering_msgs", "gazebo_msgs", "moveit_msgs", "object_recognition_msgs",
                        "octomap_msgs"}


@pytest.mark.parametrize("folder, kind, name, md5", CASES)
def test_definition_has_the_sum_of_its_peers(folder, kind, name, md5):
    assert md5_of(kind, folder, name) == md5


@pytest.mark.parametrize("table", TABLES, ids=lambda table: table.parents[1].name)
def test_every_definition_is_in_the_table(table):
    folder = table.parents[1]
    defined = {(kind, file.stem) for kind in ("msg", "srv") for file in (folder / kind).glob("*." + kind)}
    defined |= {("action", name) for name in action_messages(folder)}
    assert defined == set(expected_sums(table))


@pytest.mark.parametrize("table", TABLES, ids=lambda table: table.parents[1].name)
def test_every_definition_is_built(table):
    folder = table.parents[1]
    cmake = (folder / "CMakeLists.txt").read_text().split()
    files = {file.name for kind in ("action", "msg", "srv") for file in (folder / kind).glob("*." + kind)}
    missing = sorted(files - set(cmake))
    assert not missing, "not named in CMakeLists.txt: %s" % missing
