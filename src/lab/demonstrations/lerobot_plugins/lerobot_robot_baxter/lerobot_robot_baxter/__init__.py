# SPDX-License-Identifier: BSD-3-Clause
"""LeRobot plugin: a Baxter, simulated or physical, by its rosbridge: `--robot.type=baxter`."""
from .baxter import Baxter, BaxterConfig

__all__ = ["Baxter", "BaxterConfig"]
