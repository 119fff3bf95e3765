# SPDX-License-Identifier: BSD-3-Clause
# exercise: tf_listener
"""Prints for ever."""
while True:
    print("where is my gripper? " * 100)
