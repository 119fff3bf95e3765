# SPDX-License-Identifier: BSD-3-Clause
"""A user's controller that fails on request."""
from std_msgs.msg import Empty

from controller_manager import POSITION, Controller


class Breaking(Controller):
    """Raises the elbow, until something comes on ``break``."""

    def __init__(self, name, hardware, context):
        super().__init__(name, hardware, context)
        self.index = self.claim(POSITION, ["elbow"])
        self.subscription = context.subscription("break", Empty)

    def update(self, time_s, dt):
        if self.subscription.take() is not None:
            raise ValueError("told to break")
        self.hardware.command[POSITION][self.index] = -0.3
