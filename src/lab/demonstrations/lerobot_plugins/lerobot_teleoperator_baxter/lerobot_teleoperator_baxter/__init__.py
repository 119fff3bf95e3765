# SPDX-License-Identifier: BSD-3-Clause
"""LeRobot plugin: whatever moves a Baxter, as a device: `--teleop.type=baxter`."""
from .baxter_teleop import BaxterTeleop, BaxterTeleopConfig

__all__ = ["BaxterTeleop", "BaxterTeleopConfig"]
