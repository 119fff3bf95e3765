# SPDX-License-Identifier: BSD-3-Clause
"""The node of the window, ``/gazebo_gui``."""
from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import traceback

import rosgraph
import rosnode
import rospy

from processes.priority import give_way
from rospy_nodes.start import limit_ports
from sensor_renderer.priority import DRAWING

_NAME = "gazebo_gui"
_PROBE = "from PyQt5.QtWidgets import QApplication; QApplication(['gazebo'])"
_PROBE_TIMEOUT_S = 30.0
# While Python's signal handlers wait for Qt's loop: how often they get their turn [ms].
_SIGNALS_MS = 100
# Without a master for this long, the window closes [s].
_ALONE_S = 5.0
_ASK_MASTER_S = 1.0


def main() -> int:
    """Show the world until the user closes the window; returns the exit code.

    Without a screen it prints one line and returns 0: the lab goes on without a window. With ``_offscreen:=true`` on
    the command line it publishes its pictures and opens no window.
    """
    # Physics comes first.
    give_way(DRAWING)
    offscreen = bool(rospy.client.load_command_line_node_params(sys.argv).get("offscreen"))
    reason = "" if offscreen else _why_no_screen()
    if reason:
        print("gazebo_gui: %s, the lab goes on without a window" % reason)
        return 0
    ending = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: ending.set())
    limit_ports()
    # A window beside another one; a name on the command line, as roslaunch gives it, stays.
    anonymous = not any(word.startswith("__name:=") for word in sys.argv) and _is_there(_NAME)
    rospy.init_node(_NAME, anonymous=anonymous, disable_rostime=True, disable_signals=True)
    (_publish if offscreen else _show)(ending)
    rospy.signal_shutdown("the window is closed")
    sys.stdout.flush()
    # A call to a simulator that does not answer must not keep the process alive.
    os._exit(0)


def _is_there(name):
    """Whether a node of this name answers; one that was killed is still listed."""
    name = rosgraph.names.ns_join(rosgraph.names.get_ros_namespace(), name)
    try:
        rosgraph.Master(name).lookupNode(name)
    except (OSError, rosgraph.MasterException):
        return False
    return rosnode.rosnode_ping(name, max_count=1)


def _why_no_screen():
    """Why no window can be opened, or None. A child process tries it, since Qt aborts its process if it cannot."""
    displays = [os.environ[name] for name in ("DISPLAY", "WAYLAND_DISPLAY") if os.environ.get(name)]
    if not displays:
        return "no display (DISPLAY is not set)"
    try:
        probe = subprocess.run([sys.executable, "-c", _PROBE], timeout=_PROBE_TIMEOUT_S, check=False,
                               capture_output=True, text=True)
    except subprocess.TimeoutExpired:
        return "display %s does not answer within %g s" % (displays[0], _PROBE_TIMEOUT_S)
    if "ModuleNotFoundError" in probe.stderr:
        return "PyQt5 is missing (apt install python3-pyqt5)"
    return None if probe.returncode == 0 else "no window can be opened on display %s" % displays[0]


def _show(ending):
    from PyQt5.QtCore import QTimer, qInstallMessageHandler
    from PyQt5.QtWidgets import QApplication

    from world_window.picture_topic import PictureTopic
    from world_window.simulator import Simulator
    from world_window.stage import WindowStage
    from world_window.viewer import Viewer
    from world_window.window import Window

    # PyQt ends the process at an exception in a handler of an event, unless this is another function than Python's.
    sys.excepthook = lambda *error: rospy.logerr("".join(traceback.format_exception(*error)).rstrip())
    qInstallMessageHandler(lambda kind, context, text: rospy.logdebug("Qt: %s", text))
    application = QApplication(["gazebo"])
    window = Window()

    topic = PictureTopic()

    def take(frame):
        window.frame(frame)
        topic.take(frame)

    simulator = Simulator(window.tell, lambda contacts: viewer.post(WindowStage.take_contacts, contacts))
    viewer = Viewer(_folder, _renderer, take, simulator.pull, rospy.logwarn)
    window.build(viewer, simulator)
    viewer.start()
    alone = _watch_for_master(ending)

    def end_if_asked():
        if ending.is_set() or rospy.is_shutdown() or alone.is_set():
            application.quit()

    timer = QTimer()
    timer.timeout.connect(end_if_asked)
    timer.start(_SIGNALS_MS)
    window.show()
    window.activateWindow()
    application.exec_()
    viewer.end()


def _publish(ending):
    """Publish pictures while a program subscribes to them."""
    from world_window.picture_topic import PictureTopic
    from world_window.viewer import Viewer

    topic = PictureTopic()
    viewer = Viewer(_folder, _renderer, topic.take, lambda pull: None, rospy.logwarn)
    viewer.start()
    alone = _watch_for_master(ending)
    while not (ending.wait(_SIGNALS_MS / 1000.0) or alone.is_set() or rospy.is_shutdown()):
        viewer.set_visible(topic.has_listeners)
    viewer.end()


def _folder() -> str | None:
    """The folder of the snapshot of the simulator on this master, or None."""
    try:
        folder = rospy.get_param("/gazebo/snapshot", None)
        return None if folder is None else str(folder)
    except (OSError, rosgraph.MasterException):
        return None


def _renderer():
    from sensor_renderer.best import best_renderer

    renderer, problem = best_renderer()
    if problem:
        rospy.logwarn(problem)
    return renderer


def _watch_for_master(ending):
    """An event that is set once the master has not answered for some seconds."""
    alone = threading.Event()
    threading.Thread(target=_ask_master, args=(ending, alone), daemon=True).start()
    return alone


def _ask_master(ending, alone):
    missed = 0
    while not ending.wait(_ASK_MASTER_S):
        missed = 0 if rosgraph.is_master_online() else missed + 1
        if missed * _ASK_MASTER_S >= _ALONE_S:
            alone.set()
            return
