# SPDX-License-Identifier: BSD-3-Clause
"""The /sensor_renderer node: follows the simulator's snapshot and draws the pictures of topics with subscribers."""
from __future__ import annotations

import contextlib
import importlib
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, NoReturn, cast

import rospkg
import rospy
import yaml

from model_files.resources import ResourceFinder
from processes.memory import keep_freed_memory
from processes.priority import give_way
from rospy_nodes.start import limit_ports
from sensor_renderer.best import best_renderer
from sensor_renderer.errors import SensorError
from sensor_renderer.labels import Labels, classes_of_parameter
from sensor_renderer.mirror import Mirror
from sensor_renderer.moments import DrawnMoments, Moment
from sensor_renderer.priority import DRAWING
from sensor_renderer.sensor_element import SensorEntry
from world_picture.background import BackgroundDrawings
from world_picture.snapshot import SnapshotError, SnapshotReader

if TYPE_CHECKING:
    from sensor_renderer.gl_renderer import GlRenderer
    from sensor_renderer.tiny_renderer import TinyRenderer

# Polling periods [s]: of the snapshot with subscribers, of the subscribers while there are none, of the snapshot
# meanwhile, and of the search for a simulator.
_LOOK_S, _IDLE_S, _UNSEEN_S, _SEEK_S = 0.004, 0.05, 0.25, 0.25

# A sensor that fails this many times within this time [s, simulated time] is not restarted again.
FAILURES, FAILURES_WITHIN_S = 3, 10.0

# The node has ended so long after it was asked to [s]; roslaunch waits for 15 s.
LEAVES_WITHIN_S = 5.0

# A scene that takes longer to read is announced [s].
READS_WITHIN_S = 3.0

# How often the number of meshes that are still to be simplified is logged [s].
LEFT_TOLD_S = 15.0

# Parameter that groups models into classes for masks.
CLASSES = "/sensor_renderer/semantic_classes"


class SensorRenderer:
    """Sensors of the world by name, and the loop that serves them."""

    def __init__(self, make_renderer: Callable[[], GlRenderer | TinyRenderer], drivers: Mapping[str, str],
                 labels: Labels | None = None) -> None:
        """``make_renderer()`` -> ``GlRenderer`` or ``TinyRenderer``, called before the first picture; ``drivers``:
        {file name: "module:Class"}; ``labels``: :class:`sensor_renderer.labels.Labels`."""
        self._drivers = drivers
        self._finder = ResourceFinder()
        self._mirror = Mirror(BackgroundDrawings(), self._finder, rospy.logwarn)
        self._world = DrawnMoments(self._mirror, make_renderer, labels)
        self._sensors = {}
        self._refused = set()
        self._failed_at = {}  # of sensors that failed: simulation times [s]
        self._revision = None
        self._resets = None
        self._drawn_s = None
        self._left_told_at = 0.0

    def run(self, stop: Callable[[], bool]) -> None:
        """Serve until ``stop()``, across restarts of the simulator."""
        while not stop():
            reader = _find_snapshot(stop)
            if reader is None:
                return
            self._revision = self._resets = None
            turn_due = 0.0
            while not stop() and reader.is_alive:
                began = time.monotonic()
                wanted = any(driver.has_listeners for driver in self._sensors.values())
                if wanted or began >= turn_due:
                    turn_due = began + _UNSEEN_S
                    try:
                        self._turn(reader)
                    except SnapshotError as error:
                        rospy.logwarn_throttle(10.0, str(error))
                time.sleep(max(0.0005, (_LOOK_S if wanted else _IDLE_S) - (time.monotonic() - began)))

    def close(self) -> None:
        """Close every sensor's topics."""
        self._set_sensors([])

    def _turn(self, reader):
        snapshot = reader.read()
        if snapshot is None:
            return
        if snapshot.revision != self._revision:
            scene = reader.scene()
            if scene.revision != snapshot.revision:
                return  # a state of the new scene follows
            self._finder.forget_missing()
            # First: their topics are there while meshes are read.
            self._set_sensors(scene.bodies)
            with _told(READS_WITHIN_S, "cameras wait while meshes of new models are read"):
                self._mirror.set_scene(scene.bodies, scene.light)
            if self._mirror.waiting:
                self._left_told_at = time.monotonic()
                rospy.loginfo("meshes are being simplified, which is done once; until then cameras see the collision "
                              "shapes of %s" % ", ".join(self._mirror.waiting))
            self._world.forget()
            self._revision = scene.revision
        self._mirror.complete()
        if self._mirror.waiting and time.monotonic() - self._left_told_at >= LEFT_TOLD_S:
            self._left_told_at = time.monotonic()
            rospy.loginfo("meshes that are still to be simplified: %d, of %s"
                          % (self._mirror.left, ", ".join(self._mirror.waiting)))
        if snapshot.resets != self._resets:
            self._resets, self._drawn_s = snapshot.resets, None
            self._world.forget()
            self._revive()
            for driver in self._sensors.values():
                driver.time_was_reset()
        memory_s = max((driver.memory_s for driver in self._sensors.values()), default=0.0)
        self._world.remember(snapshot.time_s, snapshot.values, memory_s)
        due = [driver for driver in list(self._sensors.values()) if driver.is_due(snapshot.time_s)]
        if not due or snapshot.time_s == self._drawn_s:
            return
        self._drawn_s = snapshot.time_s
        for driver in due:
            self._serve(driver, snapshot.time_s)

    def _serve(self, driver, time_s):
        entry = driver.entry
        try:
            driver.take(Moment(self._world, entry.model, entry.link, time_s))
        except rospy.ROSException:
            return  # the node is shutting down
        except Exception as error:  # noqa: BLE001  (one sensor that fails must not blind the others)
            self._restart_or_stop(driver, time_s, error)

    def _restart_or_stop(self, driver, time_s, error):
        """A sensor has failed: restart it, or, if restarting has not helped, leave it out until the time is reset."""
        entry, what = driver.entry, "%s: %s" % (type(error).__name__, error)
        keys = [key for key, other in self._sensors.items() if other is driver]
        for key in keys:
            del self._sensors[key]
        failed_at = [then for then in self._failed_at.get(keys[0], ()) if time_s - FAILURES_WITHIN_S < then] + [time_s]
        self._failed_at[keys[0]] = failed_at
        driver.close()
        if len(failed_at) < FAILURES:
            rospy.logerr("%s failed and is restarted: %s" % (entry, what))
            # It is made again at the next check of the scene.
            self._revision = None
        else:
            rospy.logerr("%s failed %d times within %g s and is left out until reset_simulation: %s"
                         % (entry, FAILURES, FAILURES_WITHIN_S, what))
            self._refused.update(keys)

    def _revive(self):
        """The time was reset: enable failed sensors again."""
        if self._failed_at:
            self._refused -= self._failed_at.keys()
            self._failed_at.clear()
            self._revision = None

    def _set_sensors(self, bodies):
        wanted = {}
        for body in bodies:
            for listed in body.get("sensors", ()):
                wanted[body["name"], str(sorted(listed.items()))] = body["name"], listed
        for key in [key for key in self._sensors if key not in wanted]:
            self._sensors.pop(key).close()
        # A sensor that cannot be served is logged once, not at every change of the world.
        self._refused &= wanted.keys()
        for key, (model, listed) in wanted.items():
            if key not in self._sensors and key not in self._refused:
                try:
                    self._sensors[key] = self._driver(SensorEntry(model, listed))
                except Exception as error:  # noqa: BLE001  (a driver that fails must not blind the others)
                    kind = "" if isinstance(error, SensorError) else "%s: " % type(error).__name__
                    rospy.logerr("no pictures: %s%s" % (kind, error))
                    self._refused.add(key)

    def _driver(self, entry):
        try:
            module, name = self._drivers[entry.filename].split(":")
        except KeyError:
            raise SensorError("%s: plugin '%s' is not known here; known plugins: %s"
                              % (entry, entry.filename, ", ".join(sorted(self._drivers)))) from None
        return getattr(importlib.import_module(module), name)(entry)


@contextlib.contextmanager
def _told(after_s, text):
    """Log ``text`` if the block takes longer than ``after_s``."""
    timer = threading.Timer(after_s, rospy.loginfo, (text,))
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


def _find_snapshot(stop):
    """The reader of the simulator on this master, as soon as there is one; None when ``stop()``."""
    while not stop():
        try:
            folder = rospy.get_param("/gazebo/snapshot", None)
            if folder is not None:
                reader = SnapshotReader(str(folder))
                if reader.is_alive:
                    return reader
        except (SnapshotError, OSError):
            pass  # left by an earlier simulator, or no master for the moment
        time.sleep(_SEEK_S)
    return None


def _labels():
    """The numbers of masks, with the classes of the parameter."""
    try:
        return Labels(classes_of_parameter(rospy.get_param(CLASSES, [])))
    except ValueError as error:
        rospy.logerr("%s; classes are the models' names" % error)
        return Labels()


def make_renderer() -> GlRenderer | TinyRenderer:
    """Return the best renderer of this machine, and log which one it is."""
    renderer, problem = best_renderer()
    if problem:
        rospy.logwarn(problem)
    rospy.loginfo("cameras are drawn by %s" % renderer.name)
    return renderer


def _wait_for_end_of_input(ending):
    """Set ``ending`` when the process that started this one has ended, whatever ended it."""
    while sys.stdin.buffer.read(1024):
        pass
    ending.set()


def leave_anyway(ending: threading.Event, after_s: float, leave: Callable[[], object]) -> None:
    """Call ``leave()`` so long after ``ending`` [s], in a separate thread: the shapes of a large world are being made
    for longer than roslaunch waits, on a busy machine, and it kills what stays.
    """
    def wait():
        ending.wait()
        time.sleep(after_s)
        leave()
    threading.Thread(target=wait, name="leave_anyway", daemon=True).start()


def main() -> NoReturn:
    """Draw until a signal or a shutdown request; returns the exit code."""
    # Physics comes first.
    give_way(DRAWING)
    keep_freed_memory()
    ending = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: ending.set())
    if "--end-with-input" in rospy.myargv()[1:]:
        threading.Thread(target=_wait_for_end_of_input, args=(ending,), daemon=True).start()
    leave_anyway(ending, LEAVES_WITHIN_S, lambda: os._exit(0))
    limit_ports()
    rospy.init_node("sensor_renderer", disable_rostime=True, disable_signals=True)
    rospy.on_shutdown(ending.set)
    path = os.path.join(rospkg.RosPack().get_path("sensor_renderer"), "config", "camera_drivers.yaml")
    with open(path, encoding="utf-8") as file:
        drivers = cast("dict[str, str]", yaml.safe_load(file))
    node = SensorRenderer(make_renderer, drivers, _labels())
    node.run(lambda: ending.is_set() or rospy.is_shutdown())
    node.close()
    rospy.signal_shutdown("the renderer ends")
    sys.stdout.flush()
    # A subscriber that does not read would keep its connection's threads, and thereby the process, alive.
    os._exit(0)
