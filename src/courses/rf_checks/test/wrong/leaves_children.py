# SPDX-License-Identifier: BSD-3-Clause
# exercise: joint_command
"""Ends, but leaves a child in a separate session, with another environment."""
import os
import subprocess
import sys

import rospy

rospy.init_node("student")
if os.fork() == 0:
    os.setsid()
    subprocess.Popen([sys.executable, "-c", "import signal; signal.pause()"], env={}, close_fds=True,
                     stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    os._exit(0)
