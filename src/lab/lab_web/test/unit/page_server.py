# SPDX-License-Identifier: BSD-3-Clause
"""The page's server with everything but ROS: a robot of the test's own takes the commands."""
import contextlib
import json
import threading
import time
from pathlib import Path
from types import SimpleNamespace

import lab_arms
import numpy as np
import pytest
from lab_arms import JOINTS, LIMIT_RAD, SIDES, URDF, VELOCITY
from tornado import web, websocket

from lab_testing.waiting import wait_until
from lab_web.buttons import Buttons
from lab_web.episodes import Episodes
from lab_web.hands import HandAnswers, ghost
from lab_web.lab import PageLab
from lab_web.motion import PageJointLimits
from lab_web.playback import MotionRecorder, play
from lab_web.scene import SceneFollower
from lab_web.serving import Pages, episode_routes, routes, upload_routes
from lab_web.steering import SteeredMotion
from lab_web.steering import operation as steer_operation
from lab_web.task_queue import TaskQueue
from loop_ros.faults import Faults
from urdf_model import parse_urdf
from web_bridge.access import Access
from web_bridge.loop_thread import LoopThread
from web_bridge.serving import Serving
from world_picture.snapshot import SnapshotWriter

NUMBERS = "/lab/numbers"
CAMERA = "/cameras/lab/image/compressed"
PAGE = Path(__file__).resolve().parents[2] / "page"


class Robot:
    """Follows its commands at once."""

    def __init__(self):
        self.positions = lab_arms.posture()
        self.limits = dict.fromkeys(JOINTS, PageJointLimits(-LIMIT_RAD, LIMIT_RAD, VELOCITY))
        self.poses = {"neutral": dict(self.positions)}
        self.enabled, self.stopped = False, False
        self.switched, self.gripped = [], []
        #: {joint: how far it gets [rad]}
        self.walls = {}

    def measured(self):
        return dict(self.positions)

    def why_not_ready(self):
        return "stopped" if self.stopped else "" if self.enabled else "not enabled"

    @property
    def time_s(self):
        return time.monotonic()

    def command(self, setpoints):
        self.positions.update({joint: min(angle, self.walls.get(joint, angle)) for joint, angle in setpoints.items()})

    def explain(self, joint, tell):
        tell("the crate is near")

    def stop(self):
        self.enabled, self.stopped = False, True

    def enable(self):
        self.enabled, self.stopped = True, False

    def disable(self):
        self.enabled = False

    def switch(self, *what):
        self.switched.append(what)

    def grip(self, *what):
        self.gripped.append(what)


class Servo:
    """Keeps what steers it. ``status``, ``reason``: what it says of itself."""

    def __init__(self):
        self.is_there, self.status, self.reason, self.sent = True, 0, "", []
        self.speeds = 0.2, 0.6

    def steer(self, twist, in_tool):
        self.sent.append((twist.tolist(), in_tool))

    @property
    def moves(self):
        return bool(self.sent) and any(self.sent[-1][0])


class EpisodeRecorder:
    """Instead of the recorder's process. ``asked``: what pages have asked for, task and camera of each recording."""

    def __init__(self):
        self.asked, self.said, self._ended = [], None, None

    def start(self, task, camera, said, ended):
        self.asked.append((task, camera))
        self.said, self._ended = said, ended
        return self

    def end(self):
        threading.Thread(target=self._ended).start()

    def join(self):
        pass


class Rosbridge(websocket.WebSocketHandler):
    """Says the robot's state and joints to its subscribers, and nothing else."""

    def initialize(self, sockets):
        self._sockets = sockets
        self.topics = set()

    def open(self):
        self._sockets.add(self)

    def on_message(self, message):
        operation = json.loads(message)
        if operation["op"] == "subscribe":
            self.topics.add(operation["topic"])

    def on_close(self):
        self._sockets.discard(self)


async def say(sockets, robot, time_s, camera, servos):
    """In the loop: messages of now."""
    joints = list(robot.positions)
    messages = {
        "/robot/state": {"enabled": robot.enabled, "stopped": robot.stopped},
        "/robot/joint_states": {
            "header": {"stamp": {"secs": int(time_s), "nsecs": round(time_s % 1.0 * 1e9)}}, "name": joints,
            "position": [robot.positions[name] for name in joints], "velocity": [0.0] * len(joints),
            "effort": [1.0] * len(joints)},
        NUMBERS: {"header": {"seq": 3, "stamp": {"secs": int(time_s), "nsecs": 0}}, "text": "x", "near": True,
                  "wrench": {"force": {"x": time_s, "y": None}}, "names": ["a", "b"], "values": [1.0, 2.0],
                  "rest": [5]}}
    for side, servo in servos.items():
        messages["/%s_servo/status" % side] = {"data": servo.status}
        messages["/%s_servo/status_reason" % side] = {"data": servo.reason}
    if camera:
        messages[CAMERA] = {"format": "png", "data": camera}
    for socket in list(sockets):
        for topic in socket.topics & messages.keys():
            with contextlib.suppress(websocket.WebSocketClosedError):
                await socket.write_message(json.dumps({"op": "publish", "topic": topic, "msg": messages[topic]}))


class Frame(web.RequestHandler):
    """Instead of JupyterLab."""

    def get(self):
        self.finish("<script>jupyterapp = {restored: Promise.resolve(), shell: {collapseLeft() { closed_list = true; },"
                    "collapseRight() {}}}</script><p>jupyter of %s" % self.get_query_argument("token"))


class Server:
    """The page's server; its address is ``address``."""

    def __init__(self, libraries, folder):
        self.robot = Robot()
        #: Its picture in base64, "" as long as it sends none.
        self.camera = ""
        self._ended = threading.Event()
        self._sockets = set()
        self.loop = LoopThread()
        self.lab = PageLab(self.robot, lambda: self.pages.control_changed(), lambda *told: self.pages.tell(*told),
                           rested=lambda client: self.pages.answer(client, {"op": "rested"}))
        self.pages = Pages(Access({"drive": True, "look": False}, names=[]), self.loop, self.lab)
        hands = HandAnswers(self.robot.measured, lambda chain, joints: ghost(self.pages.picture, chain, joints),
                            self.pages.answer)
        description = parse_urdf(URDF, source="robot")
        hands.know(description, {side: ("base", side + "_gripper") for side in SIDES}, pytest.fail)
        tasks = TaskQueue(self.pages.tell, Faults(SimpleNamespace(error=pytest.fail)))
        buttons = Buttons(self.robot.switch, tasks)
        self.lab.when_lost(buttons.release_all)
        self.servos = {side: Servo() for side in SIDES}
        steering = SteeredMotion(lambda: self.servos, lambda side: None, hands.pose)
        self.lab.add("steer", steer_operation(self.lab, steering, lambda: self.servos))
        self.marks = []
        self.lab.add("mark", lambda client, asked: self.marks.append(asked["mark"]))
        self.episode_recorder = EpisodeRecorder()
        self.episodes = Episodes(folder / "episodes", self.episode_recorder.start, self.marks.append, tasks,
                                 lambda state: self.pages.share("episodes", state))
        self.lab.add("episodes", self.episodes.ask, needs_control=False)
        recorder = MotionRecorder(lambda state: self.pages.share("recording", state))
        self.shown, self.planned, self.notebook_asks, self.watched, self.compared = [], [], [], {}, []
        self.lab.add("watch", self.watched.__setitem__, needs_control=False, for_viewers=True)
        for name, serve in {"press": buttons.press, "turn": buttons.turn,
                            "screen": lambda client, operation: self.shown.append(operation["content"]),
                            "plan": self.plan,
                            "play": lambda client, operation: play(self.lab, client, recorder)}.items():
            self.lab.add(name, serve)
        for name, serve in {"compare": lambda client, _operation: self.compared.append(client),
                            "notebook": lambda *asked: self.notebook_asks.append(asked), "reach": hands.ask,
                            "record": recorder.record, "load": recorder.load}.items():
            self.lab.add(name, serve, needs_control=False)
        self._recorder = recorder
        self._writer = SnapshotWriter(folder)
        self._writer.write_scene([{"name": "robot", "urdf": URDF, "joints": JOINTS}])
        self.ticks = 0
        self._write()
        self._follower = SceneFollower(self._writer.folder, pytest.fail)
        self._follow()
        self.pages.share("robot", {
            "joints": [{"name": name, "lower": row.lower, "upper": row.upper} for name, row in
                       self.robot.limits.items()],
            "poses": ["neutral"], "hands": hands.sides, "servos": SIDES, "grippers": SIDES,
            "cameras": [CAMERA], "has_scene": True, "can_plan": True, "can_press": True, "things": ["block"]})
        application = web.Application([*routes(self.pages, PAGE, libraries), *upload_routes(self.pages, recorder),
                                       *episode_routes(self.pages, self.episodes),
                                       (r"/notebook/(?:lab|doc).*", Frame),
                                       (r"/rosbridge", Rosbridge, {"sockets": self._sockets})])
        self._serving = Serving(self.loop, application, 0, "127.0.0.1")
        self.address = "http://127.0.0.1:%d/?token=" % self._serving.port
        self._threads = [threading.Thread(target=target, args=(self._ended.is_set,))
                         for target in (self.lab.run, hands.run, tasks.run, self._run)]
        for thread in self._threads:
            thread.start()

    def plan(self, client, operation):
        self.planned.append(operation)
        self.pages.answer(client, {"op": "plan", "why": "goal_in_collision", "text": "the crate is there"})

    def _write(self):
        self.ticks += 1
        joints = [self.robot.positions[name] for name in JOINTS]
        self._writer.write(self.ticks, 0.02 * self.ticks, [np.array([0.0, 0.0, 0.9, 0.0, 0.0, 0.0, 1.0, *joints])])

    def _follow(self):
        if self._follower.follow():
            self.pages.show_poses(self._follower.picture, self._follower.poses())

    def _run(self, ends):
        while not self._ended.wait(0.02):
            self._write()
            self._follow()
            self._recorder.take(0.02 * self.ticks, self.robot.positions)
            self.loop.run(say(self._sockets, self.robot, 0.02 * self.ticks, self.camera, self.servos))

    def close(self):
        self._ended.set()
        for thread in self._threads:
            thread.join()
        self._serving.close()
        self.loop.stop()
        self._writer.close()


def click_until(browser, selector, condition):
    """Press an element until the condition is true: a busy machine may be too slow for the heartbeat."""
    def done():
        browser.click(selector)
        with contextlib.suppress(AssertionError):
            return wait_until(condition, timeout_s=5.0)
        return False
    wait_until(done, selector, 120.0)
