# SPDX-License-Identifier: BSD-3-Clause
# exercise: tf_listener
"""Starts more and more processes."""
import os
import signal

for _ in range(400):
    if os.fork() == 0:
        signal.pause()
signal.pause()
