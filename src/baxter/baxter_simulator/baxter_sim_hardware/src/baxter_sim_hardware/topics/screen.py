# SPDX-License-Identifier: BSD-3-Clause
"""The head's screen as ROS sees it."""
from sensor_msgs.msg import Image
from std_msgs.msg import Header

from baxter_sim_hardware.screen import GLASS_LINK, HEIGHT, WIDTH, Screen, on_glass
from sim_time.stamps import stamp

SCREEN_FRAME = "screen"


class ScreenTopics:
    """makers and takers: as in PanelTopics; `screen`: the Screen."""

    def __init__(self, context):
        """`context`: the plugin's PluginContext; whoever draws the world gets the picture there."""
        self.screen = Screen()
        glass = on_glass(context.robot)
        self._drawn = context.screen(GLASS_LINK, *glass, (WIDTH, HEIGHT)) if glass else None
        self.makers = {"screen": self._image}
        self.takers = {"xdisplay": self._show}

    def reset(self):
        """A dark screen."""
        self.screen.reset()
        self._draw()

    def _show(self, part, msg, time_s):
        self.screen.show(msg.width, msg.height, msg.encoding, msg.step, msg.data)
        self._draw()

    def _draw(self):
        if self._drawn is not None:
            self._drawn.show(self.screen.pixels)

    def _image(self, time_s, part, snapshot):
        return Image(Header(stamp=stamp(time_s), frame_id=SCREEN_FRAME), HEIGHT, WIDTH, "rgb8", 0, 3 * WIDTH,
                     self.screen.pixels.tobytes())
