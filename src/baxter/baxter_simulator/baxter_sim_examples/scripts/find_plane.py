#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""How high the table is, and what stands on it, by the points of a depth camera.

Prints the table's height in `base` [m], its tilt [degrees], and how many of the points stand on it. Parameter:
~points: the camera's topic, the Kinect's by default.
"""
import argparse
import math
import sys

import rospy

from baxter_interface.programs import ProgramFailed, run
from baxter_sim_examples.hand_senses import Eyes
from baxter_sim_examples.planes import NoPlane, fit_plane
from baxter_sim_examples.scene import MIDDLE_M
from command_line.options import counted

# The points in this square around the middle of the arm's reach are looked at [m].
AROUND_M = 0.3
# A point is on the plane within this distance, and stands on it within these [m].
TOLERANCE_M, ABOVE_M = 0.008, (0.015, 0.3)
# No more points than so many are used.
MOST = 20_000


def look() -> None:
    points = Eyes().points(rospy.get_param("~points", "/kinect/depth/points"))
    points = points[(abs(points[:, :2] - MIDDLE_M) < AROUND_M).all(axis=1)]
    points = points[::max(1, len(points) // MOST)]
    try:
        plane = fit_plane(points, TOLERANCE_M)
    except NoPlane as error:
        raise ProgramFailed("no table: %s" % error) from error
    x, y = MIDDLE_M
    height = (plane.distance - plane.normal[0] * x - plane.normal[1] * y) / plane.normal[2]
    above = plane.height(points)
    print("table: height %.4f, tilted by %.2f degrees, %s; on it: %s" % (
        height, math.degrees(math.acos(min(1.0, plane.normal[2]))), counted(plane.inliers.sum(), "point"),
        counted(((above > ABOVE_M[0]) & (above < ABOVE_M[1])).sum(), "point")))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.parse_known_args()
    sys.exit(run("find_plane", look, anonymous=True))
