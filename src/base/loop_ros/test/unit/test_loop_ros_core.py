# SPDX-License-Identifier: BSD-3-Clause
"""Which modules of the package import without rospy."""
import subprocess
import sys

CORE = ("faults", "log", "node_handle", "protocol", "publisher", "request_queue", "subscriber", "subscription")


def test_the_core_loads_without_ros():
    block = "import sys; sys.modules.update(dict.fromkeys(%r)); " % (("rospy", "rosgraph", "roslib", "std_msgs"),)
    subprocess.run([sys.executable, "-c", block + "; ".join("import loop_ros." + name for name in CORE)], check=True)
