# SPDX-License-Identifier: BSD-3-Clause
from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

setup(**generate_distutils_setup(packages=["demonstrations", "demonstrations.over_ros"], package_dir={"": "src"},
                                 package_data={"demonstrations": ["requirements-*.txt"]}))
