# SPDX-License-Identifier: BSD-3-Clause
"""Launch files that include ours load a controller that ros_controllers knows, and start it."""
from pathlib import Path

import roslaunch.config
import rospkg
import yaml

PACKAGE = Path(__file__).resolve().parents[2]


def test_the_launch_file_loads_and_starts_a_known_controller():
    config = roslaunch.config.load_config_default([(str(PACKAGE / "joint_state_controller.launch"), [])], None)
    spawner, = config.nodes
    assert (spawner.package, spawner.type, spawner.args) == ("controller_manager", "spawner", "joint_state_controller")
    known = Path(rospkg.RosPack().get_path("ros_controllers")) / "config/controllers.yaml"
    assert config.params["/joint_state_controller/type"].value in yaml.safe_load(known.read_text())
