# SPDX-License-Identifier: BSD-3-Clause
"""The launch files of this package and of two like it load a controller that ros_controllers knows, and start it."""
from pathlib import Path

import pytest
import roslaunch.config
import rospkg
import yaml

CONTROLLERS = Path(rospkg.RosPack().get_path("ros_controllers")) / "config/controllers.yaml"


@pytest.mark.parametrize("name", [
    "joint_state_controller", "imu_sensor_controller", "force_torque_sensor_controller"])
def test_the_launch_file_loads_and_starts_a_known_controller(name):
    launch_file = Path(rospkg.RosPack().get_path(name)) / (name + ".launch")
    config = roslaunch.config.load_config_default([(str(launch_file), [])], None)
    spawner, = config.nodes
    assert (spawner.package, spawner.type, spawner.args) == ("controller_manager", "spawner", name)
    assert config.params["/%s/type" % name].value in yaml.safe_load(CONTROLLERS.read_text())
    assert config.params["/%s/publish_rate" % name].value == 50
