# SPDX-License-Identifier: BSD-3-Clause
from distutils.core import setup

from catkin_pkg.python_setup import generate_distutils_setup

PACKAGES = [
    "motion_planning",
    "motion_planning.constraints",
    "motion_planning.exact",
    "motion_planning.industrial",
    "motion_planning.kinematics",
    "motion_planning.manipulation",
    "motion_planning.model",
    "motion_planning.occupancy",
    "motion_planning.planners",
    "motion_planning.scene",
    "motion_planning.spheres",
    "motion_planning.srdf",
    "motion_planning.timing",
]

setup(**generate_distutils_setup(packages=PACKAGES, package_dir={"": "src"}))
