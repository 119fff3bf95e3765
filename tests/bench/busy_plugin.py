# SPDX-License-Identifier: BSD-3-Clause
"""A model plugin whose thread computes without pause, for the suite `keeps_up`."""

import threading

from gazebo_ros.model_plugin import ModelPlugin


class BusyPlugin(ModelPlugin):
    """Computes in a separate thread until it is closed."""

    def __init__(self, context):
        super().__init__(context)
        self._running = True
        threading.Thread(target=self._compute, daemon=True).start()

    def _compute(self):
        number = 0
        while self._running:
            number += 1

    def close(self):
        self._running = False
