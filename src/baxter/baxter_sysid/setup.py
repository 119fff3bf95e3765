# SPDX-License-Identifier: BSD-3-Clause
from distutils.core import setup

from catkin_pkg.python_setup import generate_distutils_setup

setup(**generate_distutils_setup(packages=["baxter_sysid"], package_dir={"": "src"}))
