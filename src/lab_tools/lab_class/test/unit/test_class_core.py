# SPDX-License-Identifier: BSD-3-Clause
"""What roslaunch starts beside a lab's master."""
from types import SimpleNamespace

import pytest
import roslaunch.config
import roslaunch.xmlloader

from lab_class.inside import environment_of_roslaunch


@pytest.fixture
def core(monkeypatch):
    """core(environment): what roslaunch reads with these variables."""

    def read(environment):
        monkeypatch.setattr(roslaunch.config.rospkg, "get_etc_ros_dir",
                            lambda: environment.get("ROS_ETC_DIR", "/etc/ros"))
        config = roslaunch.config.ROSLaunchConfig()
        roslaunch.config.load_roscore(roslaunch.xmlloader.XmlLoader(), config, verbose=False)
        return SimpleNamespace(nodes=config.nodes_core, parameters={
            name: parameter.value for name, parameter in config.params.items()})

    return read


def described(node):
    return node.name, node.namespace, node.package, node.type, node.respawn, node.args


def test_a_lab_has_all_of_ros_own_core_but_rosouts_clock(core):
    own, ros = core(environment_of_roslaunch({})), core({})
    assert own.parameters == ros.parameters
    assert [described(node) for node in own.nodes] == [described(node) for node in ros.nodes]
    assert [node.remap_args for node in own.nodes] == [[["/clock", "/rosout/no_clock"]]]


def test_the_settings_of_logging_stay(tmp_path):
    assert "ROS_PYTHON_LOG_CONFIG_FILE" not in environment_of_roslaunch({"ROS_ETC_DIR": str(tmp_path)})
    (tmp_path / "python_logging.conf").touch()
    found = environment_of_roslaunch({"ROS_ETC_DIR": str(tmp_path)})
    assert found["ROS_PYTHON_LOG_CONFIG_FILE"] == str(tmp_path / "python_logging.conf")
    assert environment_of_roslaunch({**found, "ROS_PYTHON_LOG_CONFIG_FILE": "/mine"})[
        "ROS_PYTHON_LOG_CONFIG_FILE"] == "/mine"
