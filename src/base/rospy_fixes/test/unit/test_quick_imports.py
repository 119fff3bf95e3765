# SPDX-License-Identifier: BSD-3-Clause
"""The modules that nodes and roslaunch no longer import at their start; they are there when they are used."""
import os
import subprocess
import sys
from types import SimpleNamespace

from rospy_fixes.quick_imports import remembering, with_settings_found

PROGRAM = """
import sys
import roslaunch
print([name for name in ("setuptools", "distutils", "pyparsing", "catkin_pkg") if name in sys.modules])
import rosclean
print(rosclean.find_executable("sh") if sys.version_info < (3, 12) else rosclean.which("sh"))
from catkin.find_in_workspaces import find_in_workspaces, get_workspaces
print(len(find_in_workspaces(["share"], project="rospy_fixes", first_match_only=True)), callable(get_workspaces))
import catkin.find_in_workspaces
print("catkin_pkg" in sys.modules, catkin.find_in_workspaces.__file__.endswith("find_in_workspaces.py"))
if sys.version_info < (3, 12):  # later Pythons have no distutils
    import distutils.spawn
    print(callable(distutils.spawn.spawn))
"""


def test_a_launch_imports_what_it_uses_when_it_uses_it():
    done = subprocess.run([sys.executable, "-W", "ignore", "-c", PROGRAM], capture_output=True, text=True, check=True)
    unused, shell, found, search, *spawns = done.stdout.splitlines()
    assert (unused, found, search) == ("[]", "1 True", "True True")
    assert spawns == (["True"] if sys.version_info < (3, 12) else [])
    assert shell.endswith("/sh")


def test_a_search_for_packages_counts_for_some_seconds():
    asked, now = [], [0.0]
    find = remembering(lambda path, *names: asked.append((path, *names)) or {path: len(asked)}, lambda: now[0])
    for now[0], path in ((0.0, "a"), (1.0, "a"), (4.9, "b"), (5.1, "a"), (5.2, "a")):
        assert find(path).keys() == {path}
    assert find("a", "only") == {"a": 4}
    assert asked == [("a",), ("b",), ("a",), ("a", "only")]


def test_settings_of_the_log_are_found_in_the_order_of_ros(tmp_path, monkeypatch):
    monkeypatch.delenv("ROS_PYTHON_LOG_CONFIG_FILE", raising=False)
    home, system = tmp_path / "home", tmp_path / "etc"
    for folder in (home / "config", system):
        folder.mkdir(parents=True)
    rospkg = SimpleNamespace(get_ros_home=lambda: str(home), get_etc_ros_dir=lambda: str(system))
    configure = with_settings_found(lambda name: (name, os.environ.get("ROS_PYTHON_LOG_CONFIG_FILE")), rospkg)
    expected = [None]
    for file in (system / "python_logging.yaml", system / "python_logging.conf", home / "config/python_logging.yaml"):
        assert configure("node") == ("node", expected[-1])
        file.touch()
        expected.append(str(file))
    assert configure("node") == ("node", expected[-1])
    monkeypatch.setenv("ROS_PYTHON_LOG_CONFIG_FILE", "mine")
    assert configure("node") == ("node", "mine")
    assert os.environ["ROS_PYTHON_LOG_CONFIG_FILE"] == "mine"
