# SPDX-License-Identifier: BSD-3-Clause
"""Baxter as a robot of LeRobot."""
from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import Any

from lerobot.robots import Robot, RobotConfig

from . import wire
from .cameras import CameraStream
from .over_rosbridge import OverRosbridge
from .rosbridge import RosbridgeClient

#: {camera: topic of its images}
CAMERAS = {"head": "/cameras/head_camera/image", "left_hand": "/cameras/left_hand_camera/image",
           "right_hand": "/cameras/right_hand_camera/image"}
#: Waits for the first messages, and for the robot to be enabled; for each camera's first picture, which a busy machine
#: takes half a minute for [s].
_FOUND_WITHIN_S, _FIRST_PICTURE_S = 5.0, 90.0
#: A pause between actions counts as so much time at most [s]: a set-point never jumps.
_LONGEST_S = 0.2


@RobotConfig.register_subclass("baxter")
@dataclass(kw_only=True)
class BaxterConfig(RobotConfig):
    """address: of rosbridge; pictures: of web_video_server; camera_names: of CAMERAS, each (camera_height,
    camera_width); drive: whether actions move the robot, false where another program such as the page moves it; enable:
    whether to switch the motors on; speed_rad_s: of set-points at most; seen_s: age of what is observed at most [s].
    Raises ValueError."""

    address: str = "ws://localhost:9090"
    pictures: str = "http://localhost:8080"
    camera_names: list[str] = field(default_factory=list)
    camera_height: int = 200
    camera_width: int = 320
    drive: bool = True
    enable: bool = False
    speed_rad_s: float = 1.5
    seen_s: float = 0.5

    def __post_init__(self) -> None:
        super().__post_init__()
        if unknown := set(self.camera_names) - set(CAMERAS):
            raise ValueError("there is no camera %s; choices are %s" % (", ".join(unknown), ", ".join(CAMERAS)))
        for name in ("speed_rad_s", "seen_s", "camera_height", "camera_width"):
            if not getattr(self, name) > 0:
                raise ValueError("robot.%s is %r; it must be above 0" % (name, getattr(self, name)))


class Baxter(OverRosbridge, Robot):
    """A robot of LeRobot with 16 numbers, `wire.NUMBERS`, and pictures. Raises ConnectionError where the robot is not
    there, not enabled, or silent."""

    config_class = BaxterConfig
    name = "baxter"

    def __init__(self, config: BaxterConfig):
        super().__init__(config)
        self.config = config
        self.cameras: dict[str, CameraStream | None] = dict.fromkeys(config.camera_names)
        self._set_points: dict[str, float] = {}
        self._sent_at = 0.0
        self._openings: dict[str, float | None] = {}
        self._sequence = 0

    @property
    def observation_features(self) -> dict[str, Any]:
        """{number: float, camera: (height, width, 3)}."""
        shape = (self.config.camera_height, self.config.camera_width, 3)
        return {**dict.fromkeys(wire.NUMBERS, float), **dict.fromkeys(self.cameras, shape)}

    def connect(self, calibrate: bool = True) -> None:
        """Find the robot. Raises ConnectionError."""
        if self.is_connected:
            raise ConnectionError("%s is connected already" % self)
        bridge = RosbridgeClient(self.config.address)
        try:
            self._begin(bridge)
        except Exception:
            bridge.close()
            raise
        self._bridge, self._set_points, self._openings = bridge, {}, dict.fromkeys(wire.SIDES)
        for camera in self.cameras:
            self.cameras[camera] = CameraStream(self.config.pictures, CAMERAS[camera], self.config.camera_height,
                                                self.config.camera_width)
        try:
            self._pictures(_FIRST_PICTURE_S)
        except ConnectionError:
            self.disconnect()
            raise

    def _begin(self, bridge: RosbridgeClient) -> None:
        bridge.subscribe(wire.JOINT_STATES, wire.TYPES[wire.JOINT_STATES], takes=wire.has_both_arms)
        states = [wire.gripper_topic(side, "state") for side in wire.SIDES]
        for topic in (wire.ROBOT_STATE, *states):
            bridge.subscribe(topic, wire.TYPES[topic])
        for side in wire.SIDES if self.config.drive else ():
            for topic in (wire.arm_topic(side), wire.gripper_topic(side, "command")):
                bridge.advertise(topic, wire.TYPES[topic])
        needed = (wire.JOINT_STATES, wire.ROBOT_STATE, *states)
        if not bridge.wait(lambda: all(bridge.newest(topic) for topic in needed), _FOUND_WITHIN_S):
            raise ConnectionError("nothing came from %s within %g s on %s" % (
                bridge.address, _FOUND_WITHIN_S, ", ".join(topic for topic in needed if not bridge.newest(topic))))

        def state() -> dict[str, Any]:
            found = bridge.newest(wire.ROBOT_STATE)
            return found[0] if found else {}

        if state()["stopped"] or state()["error"]:
            raise ConnectionError("the robot is stopped or has an error; reset it first")
        if self.config.enable and not state()["enabled"]:
            bridge.advertise(wire.ENABLE, wire.TYPES[wire.ENABLE])
            bridge.publish(wire.ENABLE, {"data": True})
            bridge.wait(lambda: bool(state()["enabled"]), _FOUND_WITHIN_S)
        if self.config.drive and not state()["enabled"]:
            raise ConnectionError("the robot is not enabled; enable it, or say --robot.enable=true")

    def _require(self) -> RosbridgeClient:
        if self._bridge is None:
            raise ConnectionError("%s is not connected" % self)
        return self._bridge

    def _fresh(self, topic: str) -> dict[str, Any]:
        found = self._require().newest(topic)
        if found is None or found[1] > self.config.seen_s:
            raise ConnectionError("%s is silent: the last message came %s; is the simulator paused?" % (
                topic, "never" if found is None else "%.1f s ago" % found[1]))
        return found[0]

    def _pictures(self, wait_s: float) -> dict[str, Any]:
        return {name: stream.picture(max(self.config.seen_s, wait_s), wait_s)
                for name, stream in self.cameras.items() if stream is not None}

    def get_observation(self) -> dict[str, Any]:
        """{number: value, camera: (height, width, 3) uint8}. Raises ConnectionError for what is too old."""
        found: dict[str, Any] = wire.angles(self._fresh(wire.JOINT_STATES))
        for side in wire.SIDES:
            found["%s_gripper.pos" % side] = float(self._fresh(wire.gripper_topic(side, "state"))["position"])
        return {**{name: found[name] for name in wire.NUMBERS}, **self._pictures(self.config.seen_s)}

    def send_action(self, action: dict[str, Any]) -> dict[str, Any]:
        """Command both arms and grippers; returns what was sent, which the limit of speed may have changed. Raises
        ValueError, ConnectionError."""
        wanted, bridge, now = wire.checked(action), self._require(), time.monotonic()
        if not self.config.drive:
            return wanted
        if self._fresh(wire.ROBOT_STATE)["stopped"] or not self._fresh(wire.ROBOT_STATE)["enabled"]:
            raise ConnectionError("the robot is stopped or not enabled")
        if now - self._sent_at > _LONGEST_S:
            self._set_points = wire.angles(self._fresh(wire.JOINT_STATES))  # it has stood still, or was moved
        most = self.config.speed_rad_s * min(now - self._sent_at, _LONGEST_S)
        self._set_points, self._sent_at = wire.limited(self._set_points, wanted, most), now
        for side in wire.SIDES:
            bridge.publish(wire.arm_topic(side), wire.joint_command(side, self._set_points))
            self._send_gripper(bridge, side, wanted["%s_gripper.pos" % side])
        return {**wanted, **self._set_points}

    def _send_gripper(self, bridge, side, opening):
        before = self._openings.get(side)
        if before is not None and abs(opening - before) < wire.NEAR:
            return
        self._openings[side], self._sequence = opening, self._sequence + 1
        id_ = int(self._fresh(wire.gripper_topic(side, "state"))["id"])
        bridge.publish(wire.gripper_topic(side, "command"), wire.gripper_command(opening, id_, self._sequence))

    def disconnect(self) -> None:
        """End the connection; the arms stay where they are. A second call does nothing."""
        for name, stream in self.cameras.items():
            if stream is not None:
                stream.close()
            self.cameras[name] = None
        bridge, self._bridge = self._bridge, None
        if bridge is not None:
            bridge.close()
