# SPDX-License-Identifier: BSD-3-Clause
"""LeRobot's plugins against a small rosbridge, with stand-ins for LeRobot's own classes."""
import asyncio
import io
import json
import threading

import lerobot_stand_ins
import numpy as np
import pytest
from tornado.httpserver import HTTPServer
from tornado.netutil import bind_sockets
from tornado.web import Application
from tornado.websocket import WebSocketHandler

lerobot_stand_ins.install()

from lerobot_env_baxter import BaxterEnvConfig  # noqa: E402
from lerobot_robot_baxter import Baxter, BaxterConfig, cameras, wire  # noqa: E402
from lerobot_robot_baxter.rosbridge import RosbridgeClient, RosbridgeError  # noqa: E402
from lerobot_teleoperator_baxter import BaxterTeleop, BaxterTeleopConfig  # noqa: E402

from baxter_model import SIDES, joint_names  # noqa: E402
from demonstrations.watching import NAMED  # noqa: E402
from gym_baxter.core import Choices, Core  # noqa: E402

ANGLES = dict(zip((name for side in wire.SIDES for name in wire.JOINTS[side]), np.linspace(-0.6, 0.6, 14), strict=True))
WAIT_S = 10.0


class SmallBridge:
    """A rosbridge of a robot that stands still; `said`: [(topic, message)] that clients published."""

    def __init__(self):
        self.said, self.state = [], {"enabled": True, "stopped": False, "error": False}
        self.silent, self._loop = set(), asyncio.new_event_loop()
        self._came, ready = threading.Condition(), threading.Event()
        self._clients = []
        self._thread = threading.Thread(target=self._run, args=(ready,), daemon=True)
        self._thread.start()
        assert ready.wait(WAIT_S)

    def messages(self):
        joints = {"name": list(ANGLES), "position": list(ANGLES.values())}
        found = {wire.JOINT_STATES: joints, wire.SET_POINTS: joints, wire.ROBOT_STATE: self.state}
        return found | {wire.gripper_topic(side, "state"): {"id": 7, "position": 40.0} for side in wire.SIDES}

    def _run(self, ready):
        asyncio.set_event_loop(self._loop)
        bridge = self

        class Handler(WebSocketHandler):
            def open(self):
                self.topics = set()
                bridge._clients.append(self)

            def on_message(self, text):
                heard = json.loads(text)
                if heard["op"] == "subscribe":
                    self.topics.add(heard["topic"])
                if heard["op"] == "publish":
                    with bridge._came:
                        bridge.said.append((heard["topic"], heard["msg"]))
                        if heard["topic"] == wire.ENABLE:
                            bridge.state["enabled"] = heard["msg"]["data"]
                        bridge._came.notify_all()

        async def serve():
            server = HTTPServer(Application([("/", Handler)]))
            sockets = bind_sockets(0, "127.0.0.1")
            server.add_sockets(sockets)
            self.address = "ws://127.0.0.1:%d" % sockets[0].getsockname()[1]
            self._ended = asyncio.Event()
            ready.set()
            while not self._ended.is_set():
                for topic, message in self.messages().items():
                    self._tell(topic, message)
                try:
                    await asyncio.wait_for(self._ended.wait(), 0.02)
                except TimeoutError:
                    continue
            server.stop()
            for client in self._clients:
                client.close()

        self._loop.run_until_complete(serve())

    def _tell(self, topic, message):
        for client in self._clients:
            if client.ws_connection is not None and topic in client.topics and topic not in self.silent:
                client.write_message(json.dumps({"op": "publish", "topic": topic, "msg": message}))

    def tell(self, topic, message):
        self._loop.call_soon_threadsafe(self._tell, topic, message)

    def heard(self, topic, count=1):
        """The messages that were published on a topic, at least so many."""
        with self._came:
            assert self._came.wait_for(lambda: sum(one == topic for one, _ in self.said) >= count, WAIT_S), self.said
            return [message for one, message in self.said if one == topic]

    def close(self):
        self._loop.call_soon_threadsafe(self._ended.set)
        self._thread.join(WAIT_S)


@pytest.fixture
def bridge():
    made = SmallBridge()
    yield made
    made.close()


@pytest.fixture
def robot(bridge):
    made = Baxter(BaxterConfig(address=bridge.address))
    made.connect()
    yield made
    made.disconnect()


def there(**changed):
    """The action that keeps the robot where it is."""
    found = {"%s.pos" % name: angle for name, angle in ANGLES.items()}
    return {**found, "left_gripper.pos": 40.0, "right_gripper.pos": 40.0, **changed}


def test_numbers_have_the_names_and_the_order_of_the_recorders():
    assert tuple(name for name, _ in NAMED) == wire.NUMBERS and wire.SIDES == SIDES
    assert {side: tuple(joint_names(side)) for side in SIDES} == wire.JOINTS


def test_what_is_observed_has_the_names_and_values_of_the_features(robot):
    seen = robot.get_observation()
    assert list(seen) == list(robot.observation_features) == list(robot.action_features) == list(wire.NUMBERS)
    assert seen == pytest.approx(there()) and robot.is_connected and robot.is_calibrated


def test_an_action_becomes_commands_of_both_arms_and_of_grippers_that_change(robot, bridge):
    robot.send_action(there())
    bridge.heard(wire.gripper_topic("right", "command"))
    near = there(**{"left_s0.pos": ANGLES["left_s0"] + 1e-4, "right_gripper.pos": 0.0})
    assert robot.send_action(near) == pytest.approx(near)
    for side in wire.SIDES:
        message = bridge.heard(wire.arm_topic(side), 2)[1]
        assert message["mode"] == 1 and message["names"] == list(wire.JOINTS[side])
        assert message["command"] == pytest.approx([near["%s.pos" % name] for name in wire.JOINTS[side]])
    right = bridge.heard(wire.gripper_topic("right", "command"), 2)
    assert [(one["command"], one["id"]) for one in right] == [("go", 7), ("grip", 7)]
    assert json.loads(right[0]["args"]) == {"position": 40.0}
    assert len(bridge.heard(wire.gripper_topic("left", "command"))) == 1


def test_a_set_point_never_jumps(robot, bridge):
    sent = robot.send_action(there(**{"left_s1.pos": 1.0, "left_e1.pos": -1.0}))
    most = robot.config.speed_rad_s * 0.2
    moved = {name: abs(sent["%s.pos" % name] - angle) for name, angle in ANGLES.items()}
    assert max(moved.values()) == pytest.approx(most) and moved["right_s0"] == 0.0
    assert moved["left_s1"] / moved["left_e1"] == pytest.approx(
        abs(1.0 - ANGLES["left_s1"]) / abs(-1.0 - ANGLES["left_e1"]))


@pytest.mark.parametrize(("changed", "text"), [({"left_s0.pos": float("nan")}, "left_s0.pos nan"),
                                               ({"left_x9.pos": 0.0}, "unknown: left_x9.pos")])
def test_actions_that_make_no_sense_are_refused(robot, changed, text):
    with pytest.raises(ValueError, match=text):
        robot.send_action(there(**changed))


def test_a_robot_that_is_not_enabled_is_enabled_only_on_demand(bridge):
    bridge.state["enabled"] = False
    with pytest.raises(ConnectionError, match="not enabled"):
        Baxter(BaxterConfig(address=bridge.address)).connect()
    assert not bridge.said
    robot = Baxter(BaxterConfig(address=bridge.address, enable=True))
    robot.connect()
    assert bridge.heard(wire.ENABLE) == [{"data": True}]
    robot.disconnect()
    robot.disconnect()


def test_a_robot_that_another_program_drives_gets_no_commands(bridge):
    robot = Baxter(BaxterConfig(address=bridge.address, drive=False))
    robot.connect()
    assert robot.send_action(there()) == there()
    robot.disconnect()
    assert not bridge.said


def test_stopped_and_silent_robots_are_named(robot, bridge):
    bridge.state["stopped"] = True
    bridge.silent.add(wire.JOINT_STATES)
    heard = robot._require()
    assert heard.wait(lambda: heard.newest(wire.ROBOT_STATE)[0]["stopped"], WAIT_S)
    with pytest.raises(ConnectionError, match="stopped"):
        robot.send_action(there())
    assert heard.wait(lambda: heard.newest(wire.JOINT_STATES)[1] > robot.config.seen_s, WAIT_S)
    with pytest.raises(ConnectionError, match="%s is silent" % wire.JOINT_STATES):
        robot.get_observation()


def test_a_bridge_that_ends_is_an_error_and_no_bridge_is_one_with_its_address(bridge):
    robot = Baxter(BaxterConfig(address=bridge.address))
    robot.connect()
    bridge.close()
    with pytest.raises(RosbridgeError, match="ended"):
        robot._require().wait(lambda: False, WAIT_S)
    with pytest.raises(ConnectionError, match="ended"):
        robot.send_action(there())
    assert not robot.is_connected
    with pytest.raises(ConnectionError, match="no rosbridge at %s" % bridge.address):
        RosbridgeClient(bridge.address)


def test_the_device_says_what_arms_and_grippers_are_told(bridge):
    device = BaxterTeleop(BaxterTeleopConfig(address=bridge.address))
    device.connect()
    assert device.get_action() == pytest.approx(there()) and list(device.get_action()) == list(device.action_features)
    bridge.tell(wire.gripper_topic("left", "command"), {"command": "grip", "args": ""})
    bridge.tell(wire.gripper_topic("right", "command"), {"command": "go", "args": '{"position": 70}'})
    bridge.tell(wire.MARKS, {"data": "again"})
    assert device._bridge.wait(lambda: device._bridge.newest(wire.MARKS) is not None, WAIT_S)
    action = device.get_action()
    assert (action["left_gripper.pos"], action["right_gripper.pos"]) == (0.0, 70.0)
    events = device.get_teleop_events()
    assert {event.name for event, is_so in events.items() if is_so} == {"TERMINATE_EPISODE", "RERECORD_EPISODE"}
    assert not any(device.get_teleop_events().values())
    device.disconnect()
    with pytest.raises(ConnectionError, match="not connected"):
        device.get_action()


def test_commands_that_say_nothing_leave_a_gripper_as_it_was():
    for command in ({"command": "stop", "args": ""}, *({"command": "go", "args": args} for args in (
            "{", "[]", '{"position": NaN}', '{"position": 1%s}' % ("0" * 400)))):
        assert wire.gripper_wanted(command, 30.0) == 30.0
    assert wire.gripper_wanted({"command": "release", "args": ""}, 30.0) == 100.0


@pytest.mark.parametrize("make", [
    lambda: BaxterConfig(camera_names=["chest"]), lambda: BaxterConfig(speed_rad_s=0.0),
    lambda: BaxterTeleopConfig(source="thoughts"), lambda: BaxterEnvConfig(task="Juggle-v0"),
    lambda: BaxterEnvConfig(obs_type="state"), lambda: BaxterEnvConfig(control="thoughts")])
def test_bad_options_are_refused_with_the_choices(make):
    with pytest.raises(ValueError, match="choices are|must be above"):
        make()


def test_a_stream_is_taken_apart_and_ends_quietly_when_it_is_cut_off():
    part = b"--b\r\nContent-Type: image/jpeg\r\nContent-Length: %d\r\n\r\n%s\r\n"
    whole = part % (3, b"one") + part % (5, b"\r\n\r\nx") + part % (9, b"cut")
    assert list(cameras.parts(io.BytesIO(whole))) == [b"one", b"\r\n\r\nx"]
    with pytest.raises(ValueError, match="Content-Length"):
        list(cameras.parts(io.BytesIO(b"<html>\n" * 100)))


def test_a_camera_without_a_server_is_an_error_with_its_address(bridge):
    stream = cameras.CameraStream("http://127.0.0.1:1", "/cameras/head_camera/image", 20, 32)
    with pytest.raises(ConnectionError, match="127.0.0.1:1/stream"):
        stream.picture(1.0, 0.2)
    stream.close()


@pytest.mark.parametrize("obs_type", ["environment_state_agent_pos", "pixels_agent_pos"])
def test_an_environment_observes_what_its_configuration_says(obs_type):
    config = BaxterEnvConfig(task="Reach-v0", obs_type=obs_type, cameras=["head"], size=16)
    given = {name: value for name, value in config.gym_kwargs.items() if name != "render_mode"}
    core = Core("Reach", Choices(**given))
    seen = core.reset(np.random.default_rng(0))
    flat = {**{name: value for name, value in seen.items() if name != "pixels"},
            **{"pixels/%s" % name: pixels for name, pixels in seen.get("pixels", {}).items()}}
    core.close()
    features = dict(config.features)
    assert features.pop("action").shape == (core.action_size,)
    assert {name: feature.shape for name, feature in features.items()} == {
        name: value.shape for name, value in flat.items()}
    assert set(config.features_map) == set(config.features)
