# SPDX-License-Identifier: BSD-3-Clause
"""Depth cameras whose clouds become the scene's octomap."""
from __future__ import annotations

import collections
import math
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import rospy
from moveit_msgs.srv import LoadMap, LoadMapResponse, SaveMap, SaveMapResponse
from rospy.rostime import genpy  # of the stamps in messages
from sensor_msgs.msg import CameraInfo, Image, JointState, PointCloud2
from std_msgs.msg import Header

from motion_planning.errors import PlanningError
from motion_planning.occupancy import CloudMap, Mask, OccupancyMap, SensorView
from motion_planning.scene import Octree
from moveit_ros_move_group.convert.clouds import cloud_of, points_of, points_of_depth
from moveit_ros_move_group.convert.octomap_file import file_of, octree_of_file
from urdf_model import read_file

if TYPE_CHECKING:
    from moveit_msgs.srv import LoadMapRequest, SaveMapRequest

    from motion_planning.scene import Scene, WorldObject
    from motion_planning.spheres import SphereModel
    from moveit_ros_move_group.monitor import SceneMonitor

# Defaults [m]: size of cells, and range of a sensor.
_RESOLUTION_M, _MAX_RANGE_M = 0.1, 5.0
# A cloud may be as large as this [bytes], or rospy would keep old ones in its buffer.
_BUFFER = 1 << 25
# Number of stored joint states: some seconds.
_STATES = 300
# Greatest size of an octomap file to read [bytes].
_LONGEST_FILE = 1 << 26
# Polling period of a worker that waits for a cloud [s].
_LOOK_UP_S = 0.2
#: Kind of sensors whose clouds are obstacles as they are, each until the next one comes.
CLOUDS_ALONE = "PointCloudObstacles"


@dataclass(frozen=True)
class SensorSettings:
    """One sensor. kind: "PointCloudOctomapUpdater", "DepthImageOctomapUpdater" or CLOUDS_ALONE; ranges and padding [m];
    rate [Hz], 0 for every cloud; filtered: topic for the cloud without the robot, "" for none."""

    kind: str
    topic: str
    max_range: float
    subsample: int
    padding: float
    scale: float
    rate: float
    filtered: str
    near: float
    far: float


def read_settings(entries: object) -> tuple[list[SensorSettings], list[str]]:
    """Return (list of SensorSettings of ``~sensors``, list of complaints)."""
    found, complaints = [], []
    for number, entry in enumerate(entries if isinstance(entries, list) else ()):
        entry = entry if isinstance(entry, dict) else {}
        kind = str(entry.get("sensor_plugin", "")).rpartition("/")[2]
        topic = entry.get({"PointCloudOctomapUpdater": "point_cloud_topic", CLOUDS_ALONE: "point_cloud_topic",
                           "DepthImageOctomapUpdater": "image_topic"}.get(kind))
        if not topic:
            complaints.append("sensor %d, '%s', is left out: expected sensor_plugin occupancy_map_monitor/"
                              "PointCloudOctomapUpdater with point_cloud_topic, .../DepthImageOctomapUpdater with "
                              "image_topic, or .../PointCloudObstacles with point_cloud_topic"
                              % (number + 1, entry.get("sensor_plugin", "")))
            continue

        def number_of(key: str, usual: float, entry: Mapping[str, Any] = entry) -> float:
            value = entry.get(key, usual)
            good = isinstance(value, (int, float)) and math.isfinite(value) and value >= 0.0
            if not good:
                complaints.append("sensors: %s is %r, expected a number of 0 or more; %g is taken"
                                  % (key, value, usual))
            return float(value) if good else usual

        found.append(SensorSettings(kind, str(topic), number_of("max_range", math.inf) or math.inf,
                              max(1, int(number_of("point_subsample", 1))), number_of("padding_offset", 0.0),
                              number_of("padding_scale", 1.0), number_of("max_update_rate", 0.0),
                              str(entry.get("filtered_cloud_topic") or ""),
                              number_of("near_clipping_plane_distance", 0.3),
                              number_of("far_clipping_plane_distance", 5.0)))
    return found, complaints


class _Past:
    """Where the robot was: joint states of the last seconds."""

    def __init__(self, monitor: SceneMonitor) -> None:
        self._monitor, self._states = monitor, collections.deque(maxlen=_STATES)
        self._subscriber = rospy.Subscriber(monitor.joint_state_topic, JointState, self._states.append, queue_size=25)

    def scene(self, stamp: genpy.Time) -> Scene:
        """The monitor's Scene with each joint where it was next to ``stamp``."""
        scene = self._monitor.scene()
        model, time_s = scene.model, stamp.to_sec()
        q, gaps = scene.state.q.copy(), {}
        for message in tuple(self._states):
            gap = abs(message.header.stamp.to_sec() - time_s)
            if len(message.name) != len(message.position):
                continue
            for name, value in zip(message.name, message.position, strict=True):
                if name in model.index and math.isfinite(value) and gap <= gaps.get(name, math.inf):
                    q[model.index[name]], gaps[name] = value, gap
        return scene.with_state(scene.state.with_q(q))


class Sensors:
    """Keeps the scene's octomap as the sensors of ``~sensors`` see it; nothing where there are none.

    The map moves with ``~octomap_frame``. The cells are published as a cloud of their centres on
    ``~display_octomap``, for rviz to draw as boxes. ``~save_map`` and ``~load_map`` write and read files of octomap.
    """

    def __init__(self, monitor: SceneMonitor, spheres: SphereModel) -> None:
        """monitor: SceneMonitor; spheres: SphereModel of the robot."""
        settings, complaints = read_settings(rospy.get_param("~sensors", []))
        for text in complaints:
            rospy.logwarn("%s", text)
        self._monitor, self._spheres = monitor, spheres
        if not settings:
            return
        self._frame = str(rospy.get_param("~octomap_frame", "")).lstrip("/") or monitor.model.frame
        try:
            self._map = self._kind_of_map(settings)(float(rospy.get_param("~octomap_resolution", _RESOLUTION_M)))
            self._max_range = float(rospy.get_param("~max_range", _MAX_RANGE_M))
        except (TypeError, ValueError) as error:
            rospy.logerr("no octomap is kept: octomap_resolution and max_range have to be numbers above 0: %s", error)
            return
        self._lock, self._octree = threading.Lock(), None
        self._display = rospy.Publisher("~display_octomap", PointCloud2, queue_size=1, latch=True)
        self._past = _Past(monitor)
        monitor.on_clear_octomap(self._clear)
        self._sources = [_Source(one, self._see) for one in settings]
        self._services = [rospy.Service("~save_map", SaveMap, self._save),
                          rospy.Service("~load_map", LoadMap, self._load)]
        rospy.loginfo("octomap: cells of %g m in '%s' from %s", self._map.resolution, self._frame,
                      ", ".join(one.topic for one in settings))

    def _see(self, points: np.ndarray, header: Header, settings: SensorSettings) -> np.ndarray:
        """Enter points (n, 3) of a sensor; return (n,) bool: those that are not the robot. Raises PlanningError."""
        scene = self._past.scene(header.stamp)
        sensor, frame = (self._pose(name, scene, header.stamp) for name in (header.frame_id.lstrip("/"), self._frame))
        mask = Mask(scene, self._spheres, settings.padding, settings.scale)
        with self._lock:
            view = SensorView(points, sensor, frame, min(settings.max_range, self._max_range))
            changed, outside = self._map.see(view, mask, settings.topic)
            # A client's planning scene may have removed the octomap.
            if changed or self._octree is not _shape_of(self._monitor.scene().octomap):
                self._octree = self._map.octree()
                self._monitor.set_octomap(self._octree, frame)
                self._show(header.stamp)
        return outside

    @staticmethod
    def _kind_of_map(settings: Sequence[SensorSettings]) -> type[OccupancyMap]:
        alone = [one.topic for one in settings if one.kind == CLOUDS_ALONE]
        if alone and len(alone) < len(settings):
            rospy.logwarn("sensors: %s enter the octomap as the others do, since only one map is kept; %s counts where "
                          "all sensors are of that kind", ", ".join(alone), CLOUDS_ALONE)
            return OccupancyMap
        return CloudMap if alone else OccupancyMap

    def _pose(self, name: str, scene: Scene, stamp: genpy.Time) -> np.ndarray:
        """The pose (4, 4) of a frame in the planning frame. Raises PlanningError."""
        return scene.frame(name) if scene.has_frame(name) else self._monitor.tf_frame(name, stamp)

    def _save(self, request: SaveMapRequest) -> SaveMapResponse:
        with self._lock:
            content = file_of(self._map.octree(), self._map.resolution)
        try:
            Path(request.filename).write_bytes(content)
        except (OSError, ValueError) as error:
            rospy.logerr("save_map: the octomap cannot be written to '%s': %s", request.filename, error)
            return SaveMapResponse(False)
        return SaveMapResponse(True)

    def _load(self, request: LoadMapRequest) -> LoadMapResponse:
        """The cubes of the file take the place of those of the map, in ``~octomap_frame``."""
        try:
            octree = octree_of_file(read_file(request.filename, _LONGEST_FILE))
            frame = self._pose(self._frame, self._monitor.scene(), rospy.Time())
            with self._lock:
                self._map.take(octree)
                self._octree = self._map.octree()
                self._monitor.set_octomap(self._octree, frame)
                self._show(rospy.Time.now())
        except (OSError, ValueError) as error:
            rospy.logerr("load_map: no octomap is read from '%s': %s", request.filename, error)
            return LoadMapResponse(False)
        return LoadMapResponse(True)

    def _clear(self) -> None:
        with self._lock:
            self._map.clear()
            self._octree = None
            self._show(rospy.Time.now())

    def _show(self, stamp: genpy.Time) -> None:
        centres = np.empty((0, 3)) if self._octree is None else self._octree.boxes[:, :3]
        self._display.publish(cloud_of(centres, Header(stamp=stamp, frame_id=self._frame)))


def _shape_of(octomap: WorldObject | None) -> Octree | None:
    shape = None if octomap is None else octomap.shapes[0][0]
    return shape if isinstance(shape, Octree) else None


class _Source:
    """A sensor's topic. The newest message counts; a separate thread hands its points on."""

    def __init__(self, settings: SensorSettings,
                 see: Callable[[np.ndarray, Header, SensorSettings], np.ndarray]) -> None:
        """see(points, header, settings) -> (n,) bool: points that are not the robot."""
        self._settings, self._see = settings, see
        self._message, self._info, self._news = None, None, threading.Condition()
        self._filtered = None
        if settings.filtered:
            self._filtered = rospy.Publisher("~" + settings.filtered, PointCloud2, queue_size=1)
        self._subscribers = []
        if settings.kind == "DepthImageOctomapUpdater":
            self._subscribers.append(rospy.Subscriber(settings.topic.rpartition("/")[0] + "/camera_info", CameraInfo,
                                                      self._on_info, queue_size=1))
        kind = Image if settings.kind == "DepthImageOctomapUpdater" else PointCloud2
        self._subscribers.append(rospy.Subscriber(settings.topic, kind, self._on_message, queue_size=1,
                                                  buff_size=_BUFFER))
        threading.Thread(target=self._run, daemon=True).start()

    def _on_info(self, message: CameraInfo) -> None:
        self._info = message

    def _on_message(self, message: PointCloud2 | Image) -> None:
        with self._news:
            self._message = message
            self._news.notify()

    def _run(self) -> None:
        while not rospy.is_shutdown():
            with self._news:
                if self._message is None:
                    self._news.wait(_LOOK_UP_S)
                message, self._message = self._message, None
            if message is None:
                continue
            begin = time.monotonic()
            try:
                self._enter(message)
            except rospy.ROSException:
                return
            except PlanningError as error:
                rospy.logwarn_throttle(10.0, "what %s sees is not entered: %s" % (self._settings.topic, error))
            except Exception as error:  # the next cloud may be valid
                rospy.logerr_throttle(10.0, "%s: %s: %s" % (self._settings.topic, type(error).__name__, error))
            if self._settings.rate > 0.0:
                time.sleep(max(0.0, 1.0 / self._settings.rate - (time.monotonic() - begin)))

    def _enter(self, message: PointCloud2 | Image) -> None:
        settings = self._settings
        if isinstance(message, Image):
            if self._info is None:
                rospy.logwarn_throttle(10.0, "%s: no camera_info has come beside it" % settings.topic)
                return
            points = points_of_depth(message, self._info, settings.near, settings.far)
        else:
            points = points_of(message)
        points = points[::settings.subsample]
        outside = self._see(points, message.header, settings)
        if self._filtered is not None and self._filtered.get_num_connections():
            self._filtered.publish(cloud_of(points[outside], message.header))
