# SPDX-License-Identifier: BSD-3-Clause
from distutils.core import setup

from catkin_pkg.python_setup import generate_distutils_setup

PACKAGES = ["baxter_interface", "baxter_dataflow", "baxter_control", "joint_trajectory_action", "gripper_action",
            "head_action"]

setup(**generate_distutils_setup(packages=PACKAGES, package_dir={"": "src"}))
