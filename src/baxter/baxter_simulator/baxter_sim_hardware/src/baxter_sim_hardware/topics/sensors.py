# SPDX-License-Identifier: BSD-3-Clause
"""The robot's sensors as ROS messages. Rays are cast only for topics with subscribers."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from geometry_msgs.msg import Point32, Vector3
from sensor_msgs.msg import ChannelFloat32, Imu, LaserScan, PointCloud, Range
from std_msgs.msg import Float32, Header, UInt16

from arm_kinematics import Chain
from baxter_model import BASE_FRAME, SIDES
from baxter_sim_hardware.sensing import sensors, sonar_lights
from baxter_sim_hardware.sensing.panel import RANGE_SENSORS
from sim_time.pace import Schedule
from sim_time.stamps import stamp

from .row import STATE_RATE_HZ, RobotPart, TopicRow

if TYPE_CHECKING:
    from collections.abc import Mapping

    from baxter_sim_hardware.sensing.noise import HandSensors
    from baxter_sim_hardware.snapshot import JointSnapshot
    from gazebo_ros.model_plugin import PluginContext

    from .panel import PanelTopics

SONAR_FRAME = "sonar_ring"
SONAR_RATE_HZ = 10.0
LIGHT_TURNS = 12  # in which all sonars have listened for the lights that pictures show
_UNKNOWN = [-1.0] + [0.0] * 8  # the covariance of an Imu's missing measurement


def accelerometer_frame(side: str) -> str:
    return "%s_hand_accelerometer" % side


def _moving(chain: Chain, position: np.ndarray, velocity: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """((4, 4) pose, (3,) velocity [m/s]) of a chain's tip; position, velocity: (7,) of its joints [rad], [rad/s]."""
    pose, jacobian = chain.fk_and_jacobian(position)
    return pose, jacobian[:3] @ velocity


class SensorTopics(RobotPart):
    """context: the plugin's PluginContext; limb_index: {side: (7,) indices of its joints in the model's}; dt: length of
    a tick [s]; hands: `sensing.noise.HandSensors`, or None where sensors are exact.

    If the description lacks a sensor's frame, that sensor reports no echo and zero acceleration.
    """

    def __init__(self, context: PluginContext, limb_index: Mapping[str, np.ndarray], dt: float,
                 hands: HandSensors | None = None) -> None:
        world, model, robot = context.world, context.model, context.robot
        self._world, self._model, self._limb_index, self._dt, self._hands = world, model, limb_index, dt, hands
        self._links = set(robot.links)
        self._chains = {side: Chain.from_robot(robot, base=BASE_FRAME, tip=accelerometer_frame(side))
                        for side in SIDES if accelerometer_frame(side) in robot.links}
        self._directions = sensors.sonar_directions()
        self._ring = sensors.SonarRing()
        band = sonar_lights.around(robot.links[SONAR_FRAME]) if SONAR_FRAME in self._links else None
        self._drawn = None
        if band:
            pose, size, radius = band
            self._drawn = context.screen(SONAR_FRAME, pose, size, sonar_lights.PIXELS, glows=True, radius_m=radius)
        self._shown, self._drawing = (0, 0.0, 0.0), Schedule(SONAR_RATE_HZ)
        self._heard, self._turn = np.full(sensors.SONAR_COUNT, np.inf), 0

    def reset(self) -> None:
        self._ring.reset()
        self._heard[:], self._turn = np.inf, 0

    def update(self, time_s: float) -> None:
        """Show the ring's lights as they are at time_s [s]. The sonars listen one by one: to ask all of them each time
        takes as long as eight physics steps, and mostly nobody takes a picture."""
        if self._drawn is None or not self._drawing.due(time_s):
            return
        mask = self._ring.overridden(time_s)
        if mask is None:
            listening = slice(self._turn, None, LIGHT_TURNS)
            self._turn = (self._turn + 1) % LIGHT_TURNS
            self._heard[listening] = self._distances(listening)
            mask = self._ring.heard(self._heard)
        lit = (mask, self._ring.levels["red"], self._ring.levels["green"])
        if lit != self._shown:
            self._shown = lit
            self._drawn.show(sonar_lights.picture(*lit))

    # -- hands

    def attach_sensors(self, panel: PanelTopics) -> None:
        """Show the hands' ranges [mm] among the panel's channels."""
        for side, name in RANGE_SENSORS.items():
            panel.attach(name, lambda side=side: round(1000.0 * sensors.range_from_hit(self._hit(side))))

    def _hit(self, side: str) -> float | None:
        """Distance [m] of the nearest surface in front of one hand's range sensor, or None."""
        if RANGE_SENSORS[side] not in self._links:
            return None
        matrix = self._model.link_pose(RANGE_SENSORS[side]).matrix()
        start = matrix[:3, 3]
        fraction = self._world.ray_test_batch([start], [start + sensors.RANGE_MAX_M * matrix[:3, 0]])[0]
        if fraction >= 1.0:
            return None
        distance = float(fraction) * sensors.RANGE_MAX_M
        return distance if self._hands is None else self._hands.range(side, self._world.time_s, distance)

    def _range(self, time_s: float, side: str, snapshot: JointSnapshot) -> Range:
        return Range(Header(stamp=stamp(time_s), frame_id=RANGE_SENSORS[side]), Range.INFRARED, sensors.RANGE_FIELD_RAD,
                     sensors.RANGE_MIN_M, sensors.RANGE_MAX_M, sensors.range_from_hit(self._hit(side)))

    def _scan(self, time_s: float, side: str, snapshot: JointSnapshot) -> LaserScan:
        hit = self._hit(side)
        return LaserScan(Header(stamp=stamp(time_s), frame_id=RANGE_SENSORS[side]), 0.0, 0.0, 0.0, 0.0, 0.0,
                         sensors.RANGE_MIN_M, sensors.RANGE_MAX_M, [math.inf if hit is None else hit], [])

    def _accelerometer(self, time_s: float, side: str, snapshot: JointSnapshot) -> Imu:
        force = np.zeros(3)
        if side in self._chains:
            chain, index = self._chains[side], self._limb_index[side]
            _, before = _moving(chain, snapshot.before[0][index], snapshot.before[1][index])
            pose, after = _moving(chain, snapshot.position[index], snapshot.velocity[index])
            to_base = self._model.link_pose(BASE_FRAME).matrix()[:3, :3].T
            force = sensors.specific_force(before, after, to_base @ np.array(self._world.gravity), pose[:3, :3],
                                           self._dt)
            if self._hands is not None:
                force = self._hands.acceleration(side, self._world.tick, force)
        return Imu(header=Header(stamp=stamp(time_s), frame_id=accelerometer_frame(side)),
                   orientation_covariance=_UNKNOWN, angular_velocity_covariance=_UNKNOWN,
                   linear_acceleration=Vector3(*force.tolist()))

    # -- head

    def _distances(self, listening: slice = slice(None)) -> np.ndarray:
        """(k,) [m] distance of the echo of each sonar of a slice of the twelve; inf for none."""
        directions = self._directions[listening]
        if SONAR_FRAME not in self._links:
            return np.full(len(directions), np.inf)
        matrix = self._model.link_pose(SONAR_FRAME).matrix()
        rays = (directions @ matrix[:3, :3].T).reshape(-1, 3)
        near = matrix[:3, 3] + sensors.SONAR_MIN_M * rays
        span = sensors.SONAR_MAX_M - sensors.SONAR_MIN_M
        fractions = self._world.ray_test_batch(near, near + span * rays).reshape(directions.shape[:2]).min(axis=1)
        return np.where(fractions < 1.0, sensors.SONAR_MIN_M + span * fractions, np.inf)

    def _sonar(self, time_s: float, component: None, snapshot: JointSnapshot) -> PointCloud:
        echoes = self._ring.echoes(self._distances())
        # The beam's axis lies in the plane of the ring.
        ahead = self._directions.sum(axis=1)
        ahead /= np.linalg.norm(ahead, axis=1)[:, None]
        points = [Point32(*(distance * ahead[sensor]).tolist()) for sensor, distance in echoes]
        channels = [ChannelFloat32("SensorId", [float(sensor) for sensor, _ in echoes]),
                    ChannelFloat32("Distance", [float(distance) for _, distance in echoes])]
        return PointCloud(Header(stamp=stamp(time_s), frame_id=SONAR_FRAME), points, channels)

    def _lit(self, time_s: float) -> int:
        """A bit for each light that is on."""
        mask = self._ring.overridden(time_s)
        return self._ring.heard(self._distances()) if mask is None else mask

    def _lights(self, time_s: float, component: None, snapshot: JointSnapshot) -> UInt16:
        return UInt16(self._lit(time_s))

    def _sonars_enabled(self, time_s: float, component: None, snapshot: JointSnapshot) -> UInt16:
        return UInt16(self._ring.enabled)

    def _green_level(self, time_s: float, component: None, snapshot: JointSnapshot) -> Float32:
        return Float32(self._ring.levels["green"])

    def _red_level(self, time_s: float, component: None, snapshot: JointSnapshot) -> Float32:
        return Float32(self._ring.levels["red"])

    def _enable_sonars(self, component: None, msg: UInt16, time_s: float) -> None:
        self._ring.enable(msg.data)

    def _set_lights(self, component: None, msg: UInt16, time_s: float) -> None:
        self._ring.set_lights(msg.data, time_s)

    def _set_green_level(self, component: None, msg: Float32, time_s: float) -> None:
        self._ring.set_level("green", msg.data)

    def _set_red_level(self, component: None, msg: Float32, time_s: float) -> None:
        self._ring.set_level("red", msg.data)

    TOPICS = (
        TopicRow("hand_range", "range/{limb}_hand_range/state", "sensor_msgs/Range", STATE_RATE_HZ, _range,
                 "infrared, 0.004 to 0.4 m along x of `<limb>_hand_range`; 65.535 m where it sees nothing"),
        TopicRow("hand_range_scan", "/sim/laserscan/{limb}_hand_range/state", "sensor_msgs/LaserScan", STATE_RATE_HZ,
                 _scan,
                 "the same as a scan of one ray, as the vendor's simulator has it; `inf` where it sees nothing"),
        TopicRow("accelerometer", "accelerometer/{limb}_accelerometer/state", "sensor_msgs/Imu", STATE_RATE_HZ,
                 _accelerometer,
                 "acceleration less gravity in `<limb>_hand_accelerometer` [m/s^2]: 9.81 upwards at rest; no rates, no "
                 "orientation"),
        TopicRow("sonar", "sonar/head_sonar/state", "sensor_msgs/PointCloud", SONAR_RATE_HZ, _sonar,
                 "a point in `sonar_ring` for each of the 12 sonars that is switched on and hears something within 10 "
                 "m; channels SensorId, Distance [m]"),
        TopicRow("sonars_enabled", "sonar/head_sonar/sonars_enabled", "std_msgs/UInt16", SONAR_RATE_HZ, _sonars_enabled,
                 "a bit for each sonar; 4095, all on, at the start"),
        TopicRow("sonar_lights", "sonar/head_sonar/lights/state", "std_msgs/UInt16", SONAR_RATE_HZ, _lights,
                 "a bit for each light: those that `set_lights` asks for, else those whose sonar hears something"),
        TopicRow("sonar_green_level", "sonar/head_sonar/lights/green_level", "std_msgs/Float32", SONAR_RATE_HZ,
                 _green_level, "0 to 100"),
        TopicRow("sonar_red_level", "sonar/head_sonar/lights/red_level", "std_msgs/Float32", SONAR_RATE_HZ,
                 _red_level, "0 to 100"),
        TopicRow("set_sonars_enabled", "sonar/head_sonar/set_sonars_enabled", "std_msgs/UInt16", None, _enable_sonars,
                 "a bit for each sonar, 0 to 4095"),
        TopicRow("set_lights", "sonar/head_sonar/lights/set_lights", "std_msgs/UInt16", None, _set_lights,
                 "for 0.2 s: bit 15 and a bit for each light to be lit"),
        TopicRow("set_green_level", "sonar/head_sonar/lights/set_green_level", "std_msgs/Float32", None,
                 _set_green_level, "0 to 100"),
        TopicRow("set_red_level", "sonar/head_sonar/lights/set_red_level", "std_msgs/Float32", None,
                 _set_red_level, "0 to 100"),
    )
