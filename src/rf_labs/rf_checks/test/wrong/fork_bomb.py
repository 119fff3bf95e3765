# SPDX-License-Identifier: BSD-3-Clause
# exercise: tf_listener
"""Starts more and more processes."""
import os
import time

for _ in range(400):
    if os.fork() == 0:
        time.sleep(100.0)
        os._exit(0)
time.sleep(100.0)
