# SPDX-License-Identifier: BSD-3-Clause
from distutils.core import setup

from catkin_pkg.python_setup import generate_distutils_setup

PACKAGES = ["moveit_ros_move_group", "moveit_ros_move_group.capabilities", "moveit_ros_move_group.convert"]

setup(**generate_distutils_setup(packages=PACKAGES, package_dir={"": "src"}))
