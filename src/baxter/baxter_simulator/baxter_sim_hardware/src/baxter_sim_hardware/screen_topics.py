# SPDX-License-Identifier: BSD-3-Clause
"""The head's screen as ROS sees it."""
from sensor_msgs.msg import Image
from std_msgs.msg import Header

from baxter_sim_hardware.convert import stamp
from baxter_sim_hardware.screen import HEIGHT, WIDTH, Screen

SCREEN_FRAME = "screen"


class ScreenTopics:
    """makers and takers: as in PanelTopics; `screen`: the Screen, for whoever draws the robot."""

    def __init__(self):
        self.screen = Screen()
        self.reset = self.screen.reset
        self.makers = {"screen": self._image}
        self.takers = {"xdisplay": lambda part, msg, time_s: self.screen.show(
            msg.width, msg.height, msg.encoding, msg.step, msg.data)}

    def _image(self, time_s, part, snapshot):
        return Image(Header(stamp=stamp(time_s), frame_id=SCREEN_FRAME), HEIGHT, WIDTH, "rgb8", 0, 3 * WIDTH,
                     self.screen.pixels.tobytes())
