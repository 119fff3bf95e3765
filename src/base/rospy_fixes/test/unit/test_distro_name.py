# SPDX-License-Identifier: BSD-3-Clause
"""The name of the distribution that a master tells."""
import pytest
import roslaunch.config
import roslaunch.xmlloader


@pytest.mark.parametrize("environment, told", [("Debian", "noetic"), ("noetic", "noetic"), ("melodic", "melodic")])
def test_debians_name_is_noetic_and_others_stay(monkeypatch, environment, told):
    monkeypatch.setenv("ROS_DISTRO", environment)
    config = roslaunch.config.ROSLaunchConfig()
    roslaunch.config.load_roscore(roslaunch.xmlloader.XmlLoader(), config, verbose=False)
    assert config.params["/rosdistro"].value == told + "\n"
