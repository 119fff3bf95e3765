# SPDX-License-Identifier: BSD-3-Clause
"""The robot's facts are in baxter_model only: no other file repeats joint orders, mirror signs, poses, ids."""

import ast
import itertools
import re
from xml.etree import ElementTree

import pytest
from workspace_tree import ROOT, is_python, own_files

import baxter_model
from baxter_model import JOINTS, SIDES

pytestmark = pytest.mark.tree

HOME = "src/baxter/baxter_common/baxter_model/"
LIBRARY = "src/courses/baxter_traj_streamer/src/cpp/baxter_traj_streamer.cpp"
IK_LAUNCH = "src/baxter/baxter_simulator/baxter_sim_kinematics/launch/baxter_sim_kinematics.launch"
#: A plugin for a Python without ROS; test_lerobot_plugins.py compares it.
WIRE = "src/lab/demonstrations/lerobot_plugins/lerobot_robot_baxter/lerobot_robot_baxter/wire.py"
#: They cannot import the package; tests below compare their content.
COPIES = (LIBRARY, IK_LAUNCH, WIRE)
#: Written out for readers; pages are prose.
FOR_READERS = ("src/courses/rf_checks/exercises/", ".md", ".rst", ".ipynb", ".svg")
#: Files about the physical robot's own data.
DESCRIPTION = ("src/baxter/baxter_common/baxter_description/", "src/baxter/baxter_common/rethink_ee_description/")
#: Parts of the workspace without Baxter: vehicles have left and right wheels.
NO_BAXTER = ("src/base/", "src/simulator/", "src/ros_control/", "src/probot/")
#: Tests contain expected values on purpose.
EXPECTATIONS = re.compile(r"src/.*/test/|tests/unit/|tests/rostest/(custom_gripper|grippers)\.py")

ORDER = re.compile(r"\W+(?:left_|right_)?".join(JOINTS))
NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d*)?(?:e-?\d+)?")
IDS = {kind.id for kind in (baxter_model.SUCTION, baxter_model.ELECTRIC, baxter_model.CUSTOM)}
POSTURES = {
    **{name: tuple(baxter_model.poses().angles(name, side).values())
       for name, side in itertools.product(baxter_model.poses().names, SIDES)},
    **{name: tuple(angles.values()) for name, angles in baxter_model.null_space_postures("left").items()}}
# Mirror images have the same absolute values; all zeros does not count.
SIZES = {tuple(map(abs, angles)): name for name, angles in POSTURES.items() if any(angles)}
MIRRORED = {joint for joint, sign in baxter_model.MIRROR_SIGNS.items() if sign < 0}


#: They cannot import the package, or serve the tool itself.
HINTS_OF_THEIR_OWN = ("tools/", "src/baxter/baxter_tools/scripts/enable_robot.py", HOME)


def test_hint_to_enable_or_reset_the_robot_has_one_wording():
    found = [name for name in own_files()
             if is_python(name) and not EXPECTATIONS.match(name)
             and not name.startswith(("tests/", *HINTS_OF_THEIR_OWN))
             and re.search(r"enable_robot\.py -[er]", (ROOT / name).read_text(encoding="utf-8"))]
    assert found == [], "say it with baxter_model.readiness"


def posture_in(numbers):
    """The name of a posture of the robot among seven numbers in a row, or None."""
    sizes = [abs(number) for number in numbers]
    starts = range(len(sizes) - len(JOINTS) + 1)
    return next((SIZES[row] for row in (tuple(sizes[i:i + len(JOINTS)]) for i in starts) if row in SIZES), None)


def _constant(node):
    """The value of a literal, including signed numbers, or None."""
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.UAdd):
        value = _constant(node.operand)
        return -value if isinstance(value, int | float) and isinstance(node.op, ast.USub) else value
    return node.value if isinstance(node, ast.Constant) else None


def _in_collection(node):
    keys = [_constant(key) for key in node.keys] if isinstance(node, ast.Dict) else []
    values = [_constant(value) for value in (node.values if isinstance(node, ast.Dict) else node.elts)]
    words = [value for value in values if isinstance(value, str)]
    numbers = [value for value in values if isinstance(value, int | float) and not isinstance(value, bool)]
    joints = [re.sub("^(left|right)_", "", word) for word in words]
    if ORDER.search(" ".join(joints)):
        yield "the order of the joints"
    if set(joints) == MIRRORED or (set(keys) == set(JOINTS) and set(map(abs, numbers)) == {1}):
        yield "the mirror signs"
    if not keys and len(words) == len(values) and sorted(words) == sorted(SIDES):
        yield "the sides"
    if len(numbers) == len(values) and posture_in(numbers):
        yield "the posture " + posture_in(numbers)


def _in_value(value):
    if type(value) is int and value in IDS:
        yield "a gripper's id"
    if isinstance(value, str) and (
            ORDER.search(value) or posture_in([float(number) for number in NUMBER.findall(value)])):
        yield "joints or angles in a text"


def facts_in_python(text):
    """(line, fact) of facts in a program; words and numbers in docstrings are prose."""
    nodes = list(ast.walk(ast.parse(text)))
    prose = {id(node.value) for node in nodes if isinstance(node, ast.Expr)}
    for node in nodes:
        facts = ()
        if isinstance(node, ast.Tuple | ast.List | ast.Set | ast.Dict):
            facts = _in_collection(node)
        elif isinstance(node, ast.Constant) and id(node) not in prose:
            facts = _in_value(node.value)
        yield from ((node.lineno, fact) for fact in facts)


def facts_in_text(text):
    """(line, fact) of facts in any other file, such as YAML, C++ or a launch file."""
    for number, line in enumerate(text.split("\n"), 1):
        if ORDER.search(line):
            yield number, "the order of the joints"
        if posture_in([float(found) for found in NUMBER.findall(line)]):
            yield number, "the posture " + posture_in([float(found) for found in NUMBER.findall(line)])


def second_homes():
    """(file, line, fact) of all files but those that are excused above."""
    for file in own_files():
        if file.startswith((HOME, *DESCRIPTION, *NO_BAXTER, FOR_READERS[0])) or file.endswith(FOR_READERS[1:]) \
                or file in COPIES or EXPECTATIONS.match(file):
            continue
        data = (ROOT / file).read_bytes()
        if b"\0" in data:
            continue
        find = facts_in_python if is_python(file) else facts_in_text
        yield from ((file, *where) for where in find(data.decode(errors="replace")))


def test_the_robots_facts_have_one_home():
    assert list(second_homes()) == []


@pytest.mark.parametrize(("text", "fact"), [
    ('JOINTS = ("s0", "s1", "e0", "e1", "w0", "w1", "w2")', "the order of the joints"),
    ('names = ["head_pan", "left_s0", "left_s1", "left_e0", "left_e1", "left_w0", "left_w1", "left_w2"]', "the order"),
    ('JOINTS = "s0 s1 e0 e1 w0 w1 w2".split()', "joints or angles in a text"),
    ('for side in ("left", "right"): pass', "the sides"),
    ('SIDES = ["right", "left"]', "the sides"),
    ('MIRRORED = {"w2", "s0", "e0", "w0"}', "the mirror signs"),
    ('SIGNS = {"s0": -1, "s1": 1, "e0": -1, "e1": 1.0, "w0": -1, "w1": 1, "w2": -1}', "the mirror signs"),
    ("NEUTRAL = (0, -0.55, 0.0, 0.75, 0.0, 1.26, 0.0)", "the posture neutral"),
    ('POSE = {"s0": 1.0, "s1": -2.07, "e0": -3.0, "e1": 2.55, "w0": 0, "w1": 0.01, "w2": 0}', "the posture tucked"),
    ('run("fk 0 -0.55 0 0.75 0 1.26 0")', "joints or angles in a text"),
    ("HAND = -1.0, -1.04, -0.33, 1.7, 0.31, 0.86, -1.47", "the posture table_front"),
    ("ELECTRIC = 65538", "a gripper's id"),
])
def test_a_copy_in_a_program_is_found(text, fact):
    assert [found for _, found in facts_in_python(text) if found.startswith(fact)]


@pytest.mark.parametrize("text", [
    "neutral: {s0: 0.0, s1: -0.55, e0: 0.0, e1: 0.75, w0: 0.0, w1: 1.26, w2: 0.0}",
    "untucked: [-0.08, -1.0, -1.19, 1.94, 0.67, 1.03, -0.5]",
    'const char *const JOINTS[] = {"s0", "s1", "e0", "e1", "w0", "w1", "w2"};',
    "<rosparam>[right_s0, right_s1, right_e0, right_e1, right_w0, right_w1, right_w2]</rosparam>",
])
def test_a_copy_in_another_file_is_found(text):
    assert list(facts_in_text(text))


@pytest.mark.parametrize("text", [
    '"""From s0 s1 e0 e1 w0 w1 to w2, at 65538."""',
    'STIFFNESS = {"s0": 10.0, "s1": 15.0, "e0": 5.0, "e1": 5.0, "w0": 3.0, "w1": 2.0, "w2": 1.5}',
    'START = {"s0": 0, "s1": 0, "e0": 0, "e1": 0, "w0": 0, "w1": 0, "w2": 0}',
    'LOCATIONS = ("left", "right", "torso")', 'limb = Limb("left")', "FLAGS = (1, 0, 0, 0, 0, 0, 0)",
])
def test_values_of_another_kind_are_none(text):
    assert list(facts_in_python(text)) == []


def test_the_library_in_cpp_has_the_same_names():
    text = (ROOT / LIBRARY).read_text(encoding="utf-8")
    joints, sides = (re.findall(r'"(\w+)"', re.search(r"\b%s\[\] = {([^}]*)}" % name, text)[1])
                     for name in ("JOINTS", "SIDES"))
    assert tuple(joints) == JOINTS
    assert sorted(sides) == sorted(SIDES)


def test_the_launch_file_of_inverse_kinematics_sets_the_same_names():
    launch = ElementTree.parse(ROOT / IK_LAUNCH).getroot()
    values = {tag.get("name"): tag.get("value") for tag in launch.iter("param") if tag.get("value")}
    orders = {tag.get("param"): tuple(re.findall(r"\w+", tag.text)) for tag in launch.iter("rosparam")}
    limbs = orders.pop("limbs")
    assert values["root_name"] == baxter_model.BASE_FRAME
    for side in SIDES:
        assert values[side + "_tip_name"] == values["grav_%s_name" % side] == baxter_model.tip_of(side)
        assert orders["robot_config/%s_config/joint_names" % side] == baxter_model.joint_names(side)
    assert limbs == SIDES
