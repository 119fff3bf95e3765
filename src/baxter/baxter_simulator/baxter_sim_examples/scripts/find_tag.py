#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Where tags are (AprilTag 36h11).

Prints x y z [m] and the quaternion x y z w of each tag's frame in `base`: x to its right, y to its upper edge,
z out of it. Parameters: ~image, ~info: the camera's topics, the Kinect's by default.
"""
import argparse
import sys

import rospy

from baxter_interface.programs import expect, run
from baxter_sim_examples.hand_senses import Eyes
from baxter_sim_examples.tags import find_tags
from urdf_model.transforms import quaternion_from_matrix


def look(side_m: float) -> None:
    view = Eyes().view(rospy.get_param("~image", "/kinect/rgb/image_raw"),
                       rospy.get_param("~info", "/kinect/rgb/camera_info"))
    found = find_tags(view, side_m)
    expect(found, "no tag is in the picture")
    for number, pose in sorted(found.items()):
        print("tag %d: xyz %.4f %.4f %.4f xyzw %.4f %.4f %.4f %.4f" % (
            number, *pose[:3, 3], *quaternion_from_matrix(pose)))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("side", type=float, metavar="SIDE", help="of the tags' black border [m], 0.12 for instance")
    side_m = parser.parse_args(rospy.myargv()[1:]).side
    if not 0.0 < side_m < 10.0:
        parser.error("SIDE is more than 0 and less than 10 m, got %g" % side_m)
    return run("find_tag", lambda: look(side_m), anonymous=True)


if __name__ == "__main__":
    sys.exit(main())
