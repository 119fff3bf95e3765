# SPDX-License-Identifier: BSD-3-Clause
"""The cores of the SDK load on a machine that has no ROS."""
import pathlib
import subprocess
import sys

import pytest

SOURCE = pathlib.Path(__file__).parents[2] / "src"
ROS = ("rospy", "rosgraph", "baxter_core_msgs", "sensor_msgs", "std_msgs", "genpy")
CORES = ("baxter_interface.joint_motion", "baxter_interface.joint_checks", "baxter_interface.version_check",
         "baxter_interface.waiting", "baxter_interface.wheel", "baxter_interface.gripper_types",
         "baxter_interface.settings", "baxter_dataflow.waiting",
         "baxter_dataflow.signals", "baxter_interface.parameter_tables", "baxter_control.pid",
         "joint_trajectory_action.arm_motion", "joint_trajectory_action.bezier")


@pytest.mark.parametrize("core", CORES)
def test_core_loads_without_ros(core):
    package = core.split(".")[0]
    # The package's __init__ imports modules that need ROS; an empty replacement lets the core be imported alone.
    program = (
        "import importlib, sys, types; sys.modules.update(dict.fromkeys(%r)); "
        "bare = types.ModuleType(%r); bare.__path__ = [%r]; sys.modules[%r] = bare; importlib.import_module(%r)"
        % (ROS, package, str(SOURCE / package), package, core))
    subprocess.run([sys.executable, "-c", program], check=True)
