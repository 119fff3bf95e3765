# SPDX-License-Identifier: BSD-3-Clause
"""``python3 -m moveit_servo``: compile the inner loops into the cache, so that no first command has to wait for it."""
from moveit_servo.warming import warm_up

warm_up()
