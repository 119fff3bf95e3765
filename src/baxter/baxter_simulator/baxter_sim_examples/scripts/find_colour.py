#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Where blocks of a colour are, in the picture of a camera that looks at the table.

Prints x and y in `base` [m] of each patch that is as large as a block on the table. Parameters: ~image, ~info: the
camera's topics, the Kinect's by default.
"""
import argparse
import sys

import rospy

from baxter_interface.programs import expect, run
from baxter_sim_examples.colours import HUES, find_blocks
from baxter_sim_examples.hand_senses import Eyes
from baxter_sim_examples.scene import BASE_HEIGHT_M, TABLE_TOP_M
from baxter_sim_examples.vision_scene import COLOURED_M


def look(colour: str) -> None:
    view = Eyes().view(rospy.get_param("~image", "/kinect/rgb/image_raw"),
                       rospy.get_param("~info", "/kinect/rgb/camera_info"))
    blocks = find_blocks(view, colour, COLOURED_M, TABLE_TOP_M + COLOURED_M - BASE_HEIGHT_M)
    expect(blocks, "no %s block is in the picture" % colour)
    for x, y, patch in blocks:
        print("%s: x %.3f y %.3f, %.0f pixels" % (colour, x, y, patch.area))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("colour", choices=HUES)
    sought = parser.parse_args(rospy.myargv()[1:]).colour
    sys.exit(run("find_colour", lambda: look(sought), anonymous=True))
