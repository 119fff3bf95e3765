# SPDX-License-Identifier: BSD-3-Clause
"""A Baxter as a device of LeRobot: what it was told to do, by the page, a gamepad, a program, or by hand."""
from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from lerobot.teleoperators import Teleoperator, TeleoperatorConfig
from lerobot.teleoperators.utils import TeleopEvents
from lerobot_robot_baxter import wire
from lerobot_robot_baxter.over_rosbridge import OverRosbridge
from lerobot_robot_baxter.rosbridge import RosbridgeClient

_FOUND_WITHIN_S = 5.0
#: {source: topic}: what its arms are told, or where they are.
SOURCES = {"set_points": wire.SET_POINTS, "angles": wire.JOINT_STATES}


@TeleoperatorConfig.register_subclass("baxter")
@dataclass(kw_only=True)
class BaxterTeleopConfig(TeleoperatorConfig):
    """address: rosbridge of the Baxter that is moved: the robot itself, with `--robot.drive=false`, or another one that
    leads it; source: one of SOURCES, angles for arms that are led by hand; seen_s: age of what is heard at most [s].
    Raises ValueError."""

    address: str = "ws://localhost:9090"
    source: str = "set_points"
    seen_s: float = 0.5

    def __post_init__(self) -> None:
        if self.source not in SOURCES:
            raise ValueError("teleop.source is %r; choices are %s" % (self.source, ", ".join(SOURCES)))
        if not self.seen_s > 0.0:
            raise ValueError("teleop.seen_s is %r; it must be above 0" % self.seen_s)


class BaxterTeleop(OverRosbridge, Teleoperator):
    """A device of LeRobot with the numbers of `wire.NUMBERS`. Raises ConnectionError where it is silent."""

    config_class = BaxterTeleopConfig
    name = "baxter"

    def __init__(self, config: BaxterTeleopConfig):
        super().__init__(config)
        self.config = config
        self._openings: dict[str, float] = {}

    @property
    def feedback_features(self) -> dict[str, Any]:
        """None."""
        return {}

    def connect(self, calibrate: bool = True) -> None:
        """Find the robot. Raises ConnectionError."""
        if self.is_connected:
            raise ConnectionError("%s is connected already" % self)
        topic, bridge = SOURCES[self.config.source], RosbridgeClient(self.config.address)
        bridge.subscribe(topic, wire.TYPES[topic], takes=wire.has_both_arms)
        needed = [topic]
        for side in wire.SIDES:
            needed.append(wire.gripper_topic(side, "state"))
            bridge.subscribe(needed[-1], wire.TYPES[needed[-1]])
            commands = wire.gripper_topic(side, "command")
            bridge.subscribe(commands, wire.TYPES[commands], queue=True)
        bridge.subscribe(wire.MARKS, wire.TYPES[wire.MARKS], queue=True)
        if not bridge.wait(lambda: all(bridge.newest(one) for one in needed), _FOUND_WITHIN_S):
            silent = [one for one in needed if not bridge.newest(one)]
            bridge.close()
            raise ConnectionError("nothing came from %s within %g s on %s"
                                  % (self.config.address, _FOUND_WITHIN_S, ", ".join(silent)))
        self._bridge = bridge
        # Until a gripper is told something, it is to stay as it is.
        self._openings = {side: float(self._newest(wire.gripper_topic(side, "state"))["position"])
                          for side in wire.SIDES}

    def _newest(self, topic: str) -> dict[str, Any]:
        if self._bridge is None:
            raise ConnectionError("%s is not connected" % self)
        found = self._bridge.newest(topic)
        if found is None or found[1] > self.config.seen_s:
            raise ConnectionError("%s is silent; is the simulator paused?" % topic)
        return found[0]

    def get_action(self) -> dict[str, float]:
        """The 16 numbers. Raises ConnectionError."""
        found = wire.angles(self._newest(SOURCES[self.config.source]))
        for side in wire.SIDES:
            for command in self._bridge.drain(wire.gripper_topic(side, "command")) if self._bridge else ():
                self._openings[side] = wire.gripper_wanted(command, self._openings[side])
            found["%s_gripper.pos" % side] = self._openings[side]
        return {name: found[name] for name in wire.NUMBERS}

    def get_teleop_events(self) -> dict[Any, Any]:
        """Marks of the demonstration that its user has sent on /steering/mark since the last call."""
        said = [message["data"] for message in self._bridge.drain(wire.MARKS)] if self._bridge else []
        last = said[-1] if said else ""
        return {TeleopEvents.IS_INTERVENTION: False, TeleopEvents.TERMINATE_EPISODE: bool(last),
                TeleopEvents.SUCCESS: last == "success", TeleopEvents.RERECORD_EPISODE: last == "again"}

    def send_feedback(self, feedback: dict[str, Any]) -> None:
        """Nothing."""

    def disconnect(self) -> None:
        """End the connection. A second call does nothing."""
        bridge, self._bridge = self._bridge, None
        if bridge is not None:
            bridge.close()
