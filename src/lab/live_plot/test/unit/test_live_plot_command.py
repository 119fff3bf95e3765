# SPDX-License-Identifier: BSD-3-Clause
"""The window's command in a separate process, on Qt's offscreen platform, without a ROS master."""
import os
import subprocess
import sys

import pytest

pytest.importorskip("pyqtgraph", reason="./baxter.sh setup installs pyqtgraph")

# The end is requested while the window is being made, during its query for topics.
SHOW = """import os, signal, rospy
from live_plot import command

def topic_types():
    %s
    print("asked", flush=True)
    return {}

command.topic_types = topic_types
command.show_window(command.parse("plot", ["/a/x"]))
"""


@pytest.mark.parametrize("event", [
    "os.kill(os.getpid(), signal.SIGINT)", "os.kill(os.getpid(), signal.SIGTERM)", "rospy.signal_shutdown('test')"])
def test_an_end_before_the_event_loop_runs_is_not_lost(event):
    done = subprocess.run([sys.executable, "-c", SHOW % event], timeout=60.0, capture_output=True, text=True,
                          env={**os.environ, "DISPLAY": ":0", "QT_QPA_PLATFORM": "offscreen"}, check=False)
    assert (done.returncode, done.stdout) == (0, "asked\n"), done.stderr
