# SPDX-License-Identifier: BSD-3-Clause
from distutils.core import setup

from catkin_pkg.python_setup import generate_distutils_setup

PACKAGES = ["arm_kinematics", "arm_kinematics.kernels"]

setup(**generate_distutils_setup(packages=PACKAGES, package_dir={"": "src"}))
