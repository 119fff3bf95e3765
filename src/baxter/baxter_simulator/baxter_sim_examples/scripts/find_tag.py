#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Where tags are (AprilTag 36h11): find_tag.py SIDE, the side of their black border [m].

Prints x y z [m] and the quaternion x y z w of each tag's frame in `base`: x to its right, y to its upper edge, z out of
it. Parameters: ~image, ~info: the camera's topics, the Kinect's by default.
"""
import sys

import rospy

from baxter_interface.programs import expect, run
from baxter_sim_examples.hand_senses import Eyes
from baxter_sim_examples.tags import find_tags
from urdf_model.transforms import quaternion_from_matrix


def look(side_m):
    view = Eyes().view(rospy.get_param("~image", "/kinect/rgb/image_raw"),
                       rospy.get_param("~info", "/kinect/rgb/camera_info"))
    found = find_tags(view, side_m)
    expect(found, "no tag is in the picture")
    for number, pose in sorted(found.items()):
        print("tag %d: xyz %.4f %.4f %.4f xyzw %.4f %.4f %.4f %.4f" % (
            number, *pose[:3, 3], *quaternion_from_matrix(pose)))


def main():
    words = rospy.myargv()[1:]
    try:
        side_m = float(words[0]) if len(words) == 1 else 0.0
    except ValueError:
        side_m = 0.0
    if not 0.0 < side_m < 10.0:
        return "usage: find_tag.py SIDE, the side of the tags' black border [m], 0.12 for instance"
    return run("find_tag", lambda: look(side_m), anonymous=True)


if __name__ == "__main__":
    sys.exit(main())
