# SPDX-License-Identifier: BSD-3-Clause
from distutils.core import setup

from catkin_pkg.python_setup import generate_distutils_setup

ROOMS = ["baxter_sim_hardware.%s" % room for room in ("arms", "grippers", "sensing", "topics")]

setup(**generate_distutils_setup(packages=["baxter_sim_hardware", *ROOMS], package_dir={"": "src"}))
