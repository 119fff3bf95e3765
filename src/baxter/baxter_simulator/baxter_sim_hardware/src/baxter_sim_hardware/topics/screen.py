# SPDX-License-Identifier: BSD-3-Clause
"""ROS interface of the head's screen."""

from __future__ import annotations

from typing import TYPE_CHECKING

from sensor_msgs.msg import Image
from std_msgs.msg import Header

from baxter_sim_hardware.screen import GLASS_LINK, HEIGHT, WIDTH, Screen, on_glass
from sim_time.stamps import stamp

from .row import RobotPart, TopicRow

if TYPE_CHECKING:
    from baxter_sim_hardware.snapshot import JointSnapshot
    from gazebo_ros.model_plugin import PluginContext

SCREEN_FRAME = "screen"
SCREEN_RATE_HZ = 10.0


class ScreenTopics(RobotPart):
    """The head's screen; attribute `screen`: the Screen."""

    def __init__(self, context: PluginContext) -> None:
        """`context`: the plugin's PluginContext, which passes the picture to the renderers."""
        self.screen = Screen()
        glass = on_glass(context.robot)
        self._drawn = context.screen(GLASS_LINK, *glass, (WIDTH, HEIGHT)) if glass else None

    def reset(self) -> None:
        """A dark screen."""
        self.screen.reset()
        self._draw()

    def _show(self, component: None, msg: Image, time_s: float) -> None:
        self.screen.show(msg.width, msg.height, msg.encoding, msg.step, msg.data)
        self._draw()

    def _draw(self) -> None:
        if self._drawn is not None:
            self._drawn.show(self.screen.pixels)

    def _image(self, time_s: float, component: None, snapshot: JointSnapshot) -> Image:
        return Image(Header(stamp=stamp(time_s), frame_id=SCREEN_FRAME), HEIGHT, WIDTH, "rgb8", 0, 3 * WIDTH,
                     self.screen.pixels.tobytes())

    TOPICS = (
        TopicRow("xdisplay", "xdisplay", "sensor_msgs/Image", None, _show,
                 "a picture of up to 1024 x 600 for the head's screen, from its upper left corner: rgb8, bgr8, rgba8, "
                 "bgra8, mono8, 8UC1, 8UC3, 8UC4; it stays until the next one"),
        TopicRow("screen", "sim/screen", "sensor_msgs/Image", SCREEN_RATE_HZ,
                 _image, "what the screen shows, 1024 x 600, rgb8"),
    )
