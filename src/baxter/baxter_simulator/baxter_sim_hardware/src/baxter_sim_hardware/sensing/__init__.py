# SPDX-License-Identifier: BSD-3-Clause
"""Range sensors, sonars, accelerometers, cameras, and the panel of buttons, lights and wheels. Without ROS."""
