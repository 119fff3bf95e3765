# SPDX-License-Identifier: BSD-3-Clause
"""Imports between packages: only those that package.xml names, and never upwards, so that no two packages depend on
each other.

Among external packages, those of ROS and of Debian are checked; pip's are in requirements.txt.
"""

import ast
import importlib.util
import re
from functools import cache
from pathlib import Path
from xml.etree import ElementTree

import pytest
from workspace_tree import ROOT, is_in_tests, is_python, own_files, packages

pytestmark = pytest.mark.tree

PACKAGES = {**packages(), "lab_testing": Path("tests/lab_testing"), "workspace_tests": Path("tests")}
#: Modules whose Debian package has another name: the name in a manifest.
RENAMED = {"PyKDL": "python3-pykdl", "PyQt5": "python3-pyqt5", "cv2": "python3-opencv", "lxml": "python3-lxml",
           "numpy": "python3-numpy", "h5py": "python3-h5py", "yaml": "python3-yaml", "hypothesis": "python3-hypothesis",
           "rospkg": "python3-rospkg", "psutil": "python3-psutil"}
SHARES = (Path("/usr/share"), Path("/opt/ros/noetic/share"))
#: Students' programs, which run in the environment of a whole lab.
NO_PARTS = ("src/courses/rf_checks/exercises/", "src/courses/rf_checks/test/wrong/")


def imported(text, for_types=True):
    """Names of the modules that a program imports, at the top or later, each by its first part. ``for_types``: those
    below ``if TYPE_CHECKING``, too."""
    names, left = set(), [ast.parse(text)]
    while left:
        node = left.pop()
        if isinstance(node, ast.If) and getattr(node.test, "id", "") == "TYPE_CHECKING" and not for_types:
            continue
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and not node.level:
            names.add(node.module)
        # Statements alone: the expressions of the whole tree take seconds.
        for part in ("body", "orelse", "finalbody", "handlers", "cases"):
            inner = getattr(node, part, ())
            left += inner if isinstance(inner, list) else ()
    return {name.partition(".")[0] for name in names}


def owners():
    """Python package -> the workspace's package that contains it."""
    found = {**RENAMED, **{name: name for name in PACKAGES}}
    for name, folder in PACKAGES.items():
        found |= {module.parent.name: name for module in (ROOT / folder / "src").glob("*/__init__.py")}
    return found


def named(package):
    """(packages that the package depends on, further ones of its tests), by its package.xml."""
    root = ElementTree.parse(ROOT / PACKAGES[package] / "package.xml").getroot()
    needed = {tag.text.strip() for tag in root if re.fullmatch(r"(build_|exec_|run_|build_export_)?depend", tag.tag)}
    return needed, {tag.text.strip() for tag in root if tag.tag == "test_depend"}


@cache
def of_ros(module):
    """The installed ROS package that contains a module, or None."""
    return module if any((share / module / "package.xml").is_file() for share in SHARES) else None


@cache
def uses():
    """(package, file, package that the file imports) for all imports of a package."""
    found = []
    owner = owners()
    folders = sorted(((str(folder) + "/", name) for name, folder in PACKAGES.items()), reverse=True)
    for file in own_files():
        package = next((name for folder, name in folders if file.startswith(folder)), None)
        if package is None or file.startswith(NO_PARTS) or not is_python(file):
            continue
        text = (ROOT / file).read_text(encoding="utf-8")
        when_run = imported(text, for_types=False)
        for module in sorted(imported(text)):
            needed = owner.get(module) or of_ros(module)
            # A program runs without what only its types name; of our own packages, types count, too.
            if needed not in (None, package) and (module in when_run or needed in PACKAGES):
                found.append((package, file, needed))
    return tuple(found)


def test_package_xml_names_what_is_imported():
    unnamed = []
    for package, file, needed in uses():
        always, in_tests = named(package)
        if needed not in (always | in_tests if is_in_tests(file) else always):
            unnamed.append((file, needed))
    assert unnamed == []


@pytest.mark.parametrize("module", [
    "angles", "diagnostic_updater", "image_geometry", "laser_geometry", "map_msgs", "message_filters",
    "resource_retriever", "scipy", "stereo_msgs", "tf2_geometry_msgs", "tf2_kdl", "tf2_sensor_msgs", "tf_conversions",
    "topic_tools"])
def test_set_up_installs_what_programs_for_a_ros_desktop_import(module):
    assert importlib.util.find_spec(module) is not None


def circle(edges):
    """One circle in a graph, {node: set of nodes}, as a list of nodes; empty if there is none."""
    done = set()

    def walk(node, path):
        if node in path:
            return path[path.index(node):]
        if node in done:
            return []
        for other in sorted(edges.get(node, ())):
            if found := walk(other, [*path, node]):
                return found
        done.add(node)
        return []

    return next((found for node in sorted(edges) if (found := walk(node, []))), [])


def test_no_two_packages_need_each_other():
    edges = {}
    for package, file, needed in uses():
        if not is_in_tests(file) and needed in PACKAGES:
            edges.setdefault(package, set()).add(needed)
    assert circle(edges) == []


def test_a_package_below_imports_none_above():
    """The lowest packages, and packages that a physical robot must not need."""
    product = {(package, needed) for package, file, needed in uses() if not is_in_tests(file)}
    assert {needed for package, needed in product if package == "baxter_model"} & set(PACKAGES) <= {"urdf_model"}
    for low, below in (("loop_ros", {"rospy_fixes", "sim_time"}), ("model_files", {"urdf_model"}),
                       ("world_picture", {"bullet_sim", "disk_cache", "urdf_model"})):
        assert {needed for package, needed in product if package == low} & set(PACKAGES) == below
    viewers = {"sensor_renderer", "lab_display"}
    assert {pair for pair in product if pair[0] in viewers and pair[1] == "gazebo_ros"} == set()
    simulator = {"gazebo_ros", "baxter_sim_hardware", "gazebo_ros_control", "baxter_gazebo"}
    robot_side = {"arm_kinematics", "baxter_model", "baxter_interface", "baxter_tools", "baxter_examples",
                  "baxter_sim_kinematics"}
    assert {pair for pair in product if pair[0] in robot_side and pair[1] in simulator} == set()


def test_a_room_imports_from_itself_and_from_lower_floors_alone():
    page = (ROOT / "docs/architecture.md").read_text(encoding="utf-8")
    floors = {room: int(floor) for floor, room in re.findall(r"^\| (\d) \| `(\w+)` \|", page, re.MULTILINE)}
    room = {name: folder.parts[1] for name, folder in PACKAGES.items() if folder.parts[0] == "src"}
    assert set(room.values()) == set(floors)
    upwards = {(package, needed) for package, file, needed in uses()
               if not is_in_tests(file) and {package, needed} <= set(room) and room[package] != room[needed]
               and floors[room[package]] <= floors[room[needed]]}
    assert upwards == set()


@pytest.mark.parametrize(("text", "names"), [
    ("import a.b, c\nfrom d.e import f", {"a", "c", "d"}),
    ("def later():\n    from g import h\n    import i as j", {"g", "i"}),
    ("from . import k\nfrom .l import m", set()),
])
def test_every_kind_of_import_is_seen(text, names):
    assert imported(text) == names


def test_imports_for_types_alone_can_be_left_out():
    text = "import a\nif TYPE_CHECKING:\n    from b import c\nif d:\n    import e"
    assert imported(text) == {"a", "b", "e"}
    assert imported(text, for_types=False) == {"a", "e"}


def test_a_circle_is_seen():
    assert circle({"a": {"b"}, "b": {"c", "d"}, "d": {"b"}}) == ["b", "d"]
    assert circle({"a": {"b", "c"}, "b": {"c"}}) == []
