# SPDX-License-Identifier: BSD-3-Clause
"""The node of the window: waits for the simulator, mirrors its snapshot, ends with it."""
import os
import signal
import sys
import threading
import time

import rospkg
import rospy

from rospy_limits.node import limit_ports
from world_picture.snapshot import SnapshotError, SnapshotReader

# Frame rate [Hz]; watching a robot needs no more, and without a graphics card each frame costs tens of ms.
_FRAME_RATE = 20.0
_WAIT_S = 60.0


def main():
    """Show the world until the simulator ends or the user closes the window; returns the exit code.

    Without a display or OpenGL it prints one line and returns 0: the lab goes on without a window.
    """
    # Physics comes first: the window runs at the lowest priority, and software OpenGL uses one thread.
    os.nice(19)
    os.environ.setdefault("LP_NUM_THREADS", "1")
    if not os.environ.get("DISPLAY"):
        print("gazebo_gui: no display (DISPLAY is not set), the lab goes on without a window")
        return 0
    _keep_the_output_for_python()
    from gazebo_ros import window  # loads PyBullet, which is not needed without a display

    if not window.can_open():
        print("gazebo_gui: no OpenGL on display %s, the lab goes on without a window" % os.environ["DISPLAY"])
        return 0

    ending = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: ending.set())
    limit_ports()
    rospy.init_node("gazebo_gui", disable_rostime=True, disable_signals=True)
    try:
        _show(window, lambda: ending.is_set() or rospy.is_shutdown())
    except (SnapshotError, rospkg.ResourceNotFound) as error:
        print("gazebo_gui: %s" % error, file=sys.stderr)
    rospy.signal_shutdown("the window is closed")
    sys.stdout.flush()
    # PyBullet's window thread does not always end.
    os._exit(0)


def _keep_the_output_for_python():
    """Discard what C code prints to the standard output: PyBullet lists its threads and the vendor of OpenGL."""
    sys.stdout.flush()
    sys.stdout = os.fdopen(os.dup(1), "w", buffering=1)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.close(nowhere)


def _show(window, stop):
    from model_files.resources import ResourceFinder
    from world_picture.drawing import DrawingCache

    reader = _wait_for_snapshot(stop)
    if reader is None:
        return
    finder = ResourceFinder()
    view = window.Window(DrawingCache(), finder, rospy.logwarn, frame_rate=_FRAME_RATE)
    shown_revision = None
    while not stop() and view.is_open and reader.is_alive:
        started = time.monotonic()
        snapshot = reader.read()
        if snapshot is not None and snapshot.revision != shown_revision:
            scene = reader.scene()
            if scene.revision == snapshot.revision:
                finder.forget_missing()
                view.set_scene(scene.bodies, snapshot.values)
                view.set_lights(scene.light.get("lights"))
                shown_revision = scene.revision
        if snapshot is not None and snapshot.revision == shown_revision:
            view.set_state(snapshot.values)
        time.sleep(max(0.005, 1.0 / _FRAME_RATE - (time.monotonic() - started)))


def _wait_for_snapshot(stop):
    """The reader of the simulator on this master; None when ``stop()``; raises ``SnapshotError`` after a minute."""
    deadline = time.monotonic() + _WAIT_S
    while not stop():
        folder = rospy.get_param("/gazebo/snapshot", None)
        try:
            if folder is not None:
                return SnapshotReader(folder)
        except SnapshotError:
            folder = None  # left by an earlier simulator
        if time.monotonic() > deadline:
            raise SnapshotError("no simulator on this ROS master after %.0f s" % _WAIT_S)
        time.sleep(0.1)
    return None
