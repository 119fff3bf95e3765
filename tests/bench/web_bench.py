# SPDX-License-Identifier: BSD-3-Clause
"""The lab's page and its server: first sight, cost of viewers, delays of cameras, hands, stop and echoes."""
import base64
import bisect
import contextlib
import itertools
import json
import statistics
import threading
import time
from socket import SHUT_RDWR

import cv2
import numpy as np
from baxter_core_msgs.msg import JointCommand
from labs import Lab, Sink
from sensor_msgs.msg import JointState
from websocket import WebSocketException, create_connection

from lab_testing.browser import Browser, why_not
from lab_testing.waiting import wait_until
from lab_web.control import HEARTBEAT_S

TOKEN, VIEW_TOKEN = "drive", "look"
# Joint states come every 10 ms: the first one 15 ms after the last is the second.
VIEWERS, VIEW_MS = 10, 15
JOINTS = ("/robot/joint_states", "sensor_msgs/JointState")
STATE = ("/robot/state", "baxter_core_msgs/AssemblyState")
#: The camera that is opened, and how.
CAMERA, SETTINGS = "left_hand_camera", {"width": 640, "height": 400, "fps": 30.0}
IMAGE = ("/cameras/%s/image/compressed" % CAMERA, "sensor_msgs/CompressedImage")
#: The joint that an operator drags, and to where, in turn [rad]; above the first speed it moves, below the other one
#: it is at rest [rad/s], in that many joint states.
JOINT, GOALS = "left_s0", ({"left_s0": 1.4}, {"left_s0": -0.2})
FAST, SLOW, MOVING_ROWS, RESTING_ROWS = 0.3, 0.05, 30, 50
COMMANDS = "/robot/limb/left/joint_command"
#: Twists of the left hand that a page steers, in turn; a joint that is faster than the first speed moves, an arm whose
#: joints are all slower than the second is at rest [rad/s].
TWISTS, BEGUN, RESTS = ((0, 0, 0.4, 0, 0, 0), (0, 0, -0.4, 0, 0, 0)), 0.01, 0.002
STATUS = ("/left_servo/status", "std_msgs/Int8")
TIMEOUT_S = 60.0
#: A page says this often what is held [s].
STEERED_EVERY_S = 0.03


# Drags the left hand's handle by steps of 1 mm from a pose, and says how long each answer took to be shown [ms].
DRAGGED = """(async () => {
    const hand = lab.hands.hands.get("left"), took = [];
    const {position: [x, y, z], orientation} = %s;
    for (let number = -1; number < %d; number += 1) {
        const begin = performance.now();
        hand.dragged({position: [x + 0.001 * (Math.max(number, 0) %% 20), y, z], orientation});
        await new Promise((done) => {
            const answered = hand.answered;
            hand.answered = (answer) => {
                answered.call(hand, answer);
                if (answer.number !== hand.number || hand.wanted) return;
                delete hand.answered;
                done();
            };
        });
        if (number >= 0) took.push(performance.now() - begin);
    }
    return took;
})()"""
# Poses of the left hand in front of the robot and too far away, pointing downwards.
FRONT = {"position": [0.7, 0.3, 0.2], "orientation": [0.0, 1.0, 0.0, 0.0]}
BEYOND = {"position": [1.5, 0.3, 0.2], "orientation": [0.0, 1.0, 0.0, 0.0]}


class Socket:
    """A WebSocket whose frames arrive in a thread: ``heard(operation, time [s])``."""

    def __init__(self, address, heard):
        self._socket = create_connection(address, timeout=TIMEOUT_S)
        # It may be silent for as long as a simulator takes to start.
        self._socket.settimeout(None)
        self._heard = heard
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()

    def send(self, **operation):
        self._socket.send(json.dumps(operation))

    def beat(self):
        self._socket.send("beat")

    def cut(self):
        """End the connection without a farewell."""
        self._socket.shutdown()

    def close(self):
        # The server may have closed it before.
        with contextlib.suppress(OSError, WebSocketException):
            self._socket.send_close()
        # The server's answer ends the thread.
        self._thread.join(TIMEOUT_S)
        self._socket.shutdown()

    def _read(self):
        with contextlib.suppress(OSError, WebSocketException):
            while frame := self._socket.recv():
                if isinstance(frame, str):
                    self._heard(json.loads(frame), time.monotonic())


class Web:
    """The page's server beside a lab. Addresses of sockets: ``rosbridge``, ``page``."""

    def __init__(self, lab):
        lab.start("rosrun", "lab_web", "lab_web", "--token", TOKEN, "--view-token", VIEW_TOKEN)
        self.address = wait_until(lambda: lab.master.getParam("/bench", "/lab_web/address")[2] or None, "the page",
                                  TIMEOUT_S)
        host = self.address.replace("http", "ws")
        self.rosbridge, self.page = ("%s%s?token=%s" % (host, name, TOKEN) for name in ("rosbridge", "lab"))
        self.process = lab.process("/lab_web")

    def listen(self, topic, kind, heard, **more):
        """Subscribe over rosbridge: ``heard(message, time [s])``."""
        def take(operation, time_s):
            if operation.get("op") == "publish":
                heard(operation["msg"], time_s)
        socket = Socket(self.rosbridge, take)
        socket.send(op="subscribe", topic=topic, type=kind, **more)
        return socket


    def call(self, service, **arguments):
        """Call a service over rosbridge; return its values."""
        answers = []
        socket = Socket(self.rosbridge, lambda operation, _time_s: answers.append(operation))
        socket.send(op="call_service", service=service, args=arguments)
        answer = wait_until(lambda: next((one for one in answers if one["op"] == "service_response"), None), service,
                            TIMEOUT_S)
        socket.close()
        if not answer["result"]:
            raise SystemExit("%s: %s" % (service, answer["values"]))
        return answer["values"]


def measure(report, quick, number):
    seconds, times = (1.0, 5) if quick else (10.0, 100)
    with Lab(gui="false") as lab:
        web = Web(lab)
        viewers_cost(report, lab, web, seconds)
        echo(report, web, times)
        camera(report, web, seconds)
        if not why_not():
            page(report, web, times)
        vanish(report, lab, web, 2 if quick else 10)
        comparison(report, lab, web)
        stop(report, web, 3 if quick else 10)
        steer(report, lab, web, 4 if quick else 40)


def viewers_cost(report, lab, web, seconds):
    def share():
        before, begin = web.process.cpu_s(), time.monotonic()
        factor = lab.factor(seconds)
        return (web.process.cpu_s() - before) / (time.monotonic() - begin), factor
    counts = [0] * VIEWERS

    def count(viewer):
        def heard(_message, _time_s):
            counts[viewer] += 1
        return heard
    sockets = [web.listen(*JOINTS, count(viewer), throttle_rate=VIEW_MS) for viewer in range(VIEWERS)]
    wait_until(lambda: min(counts) > 10, "joint states at all viewers", TIMEOUT_S)
    before, begin = sum(counts), time.monotonic()
    with_viewers, factor = share()
    rate = (sum(counts) - before) / VIEWERS / (time.monotonic() - begin)
    for socket in sockets:
        socket.close()
    # Afterwards: a server that has just started is still busy with that.
    alone, _ = share()
    report.add("joint states at each of %d viewers" % VIEWERS, rate, "Hz")
    report.add("CPU of the server for them", 100.0 * (with_viewers - alone), "% of a core", most=10.0)
    report.add("real-time factor with them", factor, "", least=0.99)


def echo(report, web, times):
    came, times_s = threading.Condition(), {}

    def heard(operation, time_s):
        if operation.get("op") == "publish":
            with came:
                times_s[operation["msg"]["data"]] = time_s
                came.notify_all()
    socket = Socket(web.rosbridge, heard)
    topic = {"topic": "/bench_echo", "type": "std_msgs/String"}
    socket.send(op="advertise", **topic)
    socket.send(op="subscribe", **topic)

    def delay_s(word, timeout_s):
        begin = time.monotonic()
        socket.send(op="publish", topic=topic["topic"], msg={"data": word})
        with came:
            return times_s[word] - begin if came.wait_for(lambda: word in times_s, timeout_s) else None
    # The first ones come before the server's publisher and subscriber know each other. Each has its own text: an old
    # one that arrives late is not taken for a new one.
    tries = itertools.count()
    wait_until(lambda: delay_s("try %d" % next(tries), 0.2) is not None, "an echo", TIMEOUT_S)
    delays = [delay_s("word %d" % number, TIMEOUT_S) for number in range(times)]
    lost = delays.count(None)
    if lost:
        raise SystemExit("%d of %d echoes did not come within %g s" % (lost, times, TIMEOUT_S))
    socket.close()
    report.add("echo over rosbridge, median", 1000.0 * statistics.median(delays), "ms", samples=times, most=5.0)


def camera(report, web, seconds):
    """From the stamp of an image to its arrival at the page, counted from the arrival of the joint states of that
    stamp: simulated time may be slower than the wall's.
    """
    refused = web.call("/cameras/open", name=CAMERA, settings=SETTINGS)["err"]
    if refused:
        raise SystemExit("%s cannot be opened with %s: error %d" % (CAMERA, SETTINGS, refused))
    states, images = [], []

    def stamp_s(message):
        return message["header"]["stamp"]["secs"] + 1e-9 * message["header"]["stamp"]["nsecs"]
    sockets = [web.listen(*JOINTS, lambda message, time_s: states.append((stamp_s(message), time_s))),
               web.listen(*IMAGE, lambda message, time_s: images.append((message, time_s)))]
    wait_until(lambda: len(images) > 5, "images on " + IMAGE[0], TIMEOUT_S)
    images.clear()
    time.sleep(seconds)
    for socket in sockets:
        socket.close()
    content = np.frombuffer(base64.b64decode(images[-1][0]["data"]), np.uint8)
    height, width = cv2.imdecode(content, cv2.IMREAD_COLOR).shape[:2]
    rate = (len(images) - 1) / (images[-1][1] - images[0][1])
    delays = [time_s - states[bisect.bisect_left(states, (stamp_s(message), 0.0))][1] for message, time_s in images
              if stamp_s(message) <= states[-1][0]]
    report.add("camera %d x %d at %.0f Hz to a page: stamp to arrival, median" % (width, height, rate),
               1000.0 * statistics.median(delays), "ms", samples=len(delays), most=150.0)


def page(report, web, times):
    browser = Browser()
    try:
        # Once before, so that the browser's own start and its cache are not measured.
        for _ in range(2):
            browser.call("Page.navigate", url="about:blank")
            begin = time.monotonic()
            browser.call("Page.navigate", url="%s?token=%s" % (web.address, TOKEN))
            wait_until(lambda: browser.evaluate("Boolean(globalThis.lab?.view && lab.view.revision !== null"
                                                " && lab.view.pictures > 0 && !lab.view.planned)"), "the robot",
                       TIMEOUT_S, 0.02)
            sight_s = time.monotonic() - begin
        report.add("first sight of the robot, software GL", sight_s, "s", most=2.0)
        browser.click("#reach-left")
        browser.wait("lab.view.ghosts.size === 1 && lab.hands.hands.get('left').asked === null")
        for where, begin in (("", FRONT), (", where the arm does not reach", BEYOND)):
            delays = browser.evaluate(DRAGGED % (json.dumps(begin), times))
            report.add("handle to ghost in the page, median%s" % where, statistics.median(delays), "ms", samples=times,
                       most=30.0)
    finally:
        browser.close()


class Operator:
    """A page in control of the robot, as a context manager. ``socket``: its connection; ``goals`` {joint: [rad]} go
    with each heartbeat, as while a slider is dragged; ``heard``: operations that came; ``last_s``: the time of the last
    heartbeat [s].
    """

    def __init__(self, web, goals=None):
        self._web = web
        self.goals = goals
        self.heard = []
        self._beats = threading.Event()
        self._ended = threading.Event()
        self.last_s = 0.0

    def __enter__(self):
        self.socket = Socket(self._web.page, lambda operation, _time_s: self.heard.append(operation))
        self._thread = threading.Thread(target=self._beat)
        self.socket.beat()
        self.socket.send(op="take")
        self._beats.set()
        self._thread.start()
        return self

    def __exit__(self, *_):
        self._ended.set()
        self._thread.join()
        self.socket.close()

    def fall_silent(self):
        """Send nothing from now on, and stay connected: as behind a network that has gone."""
        self._beats.clear()

    def go(self):
        """Close the connection without a farewell: as a browser that is killed."""
        self._beats.clear()
        self.socket.cut()

    def _beat(self):
        while not self._ended.wait(HEARTBEAT_S):
            if not self._beats.is_set():
                continue
            with contextlib.suppress(OSError, WebSocketException):
                self.last_s = time.monotonic()
                self.socket.beat()
                if self.goals is not None:
                    self.socket.send(op="move", joints=self.goals)


class Heard:
    """Messages of a topic as its publisher sends them, as a context manager; ``rows``: (time [s], message)."""

    def __init__(self, lab, topic, message_class):
        self._connection, self._class = lab.sink(topic, message_class), message_class
        self.rows = []

    def __enter__(self):
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *_):
        self._connection.shutdown(SHUT_RDWR)
        self._thread.join()
        self._connection.close()

    def _read(self):
        sink = Sink(self._connection)
        # The sink's way to say that the connection has ended.
        with contextlib.suppress(OSError, SystemExit):
            while True:
                message = self._class().deserialize(sink.message())
                self.rows.append((time.monotonic(), message))


def vanish(report, lab, web, times):
    """From the last heartbeat of an operator who streams and vanishes to the arm's last command, and to its rest."""
    enable(web)
    goals = itertools.cycle(GOALS)
    for how, leave in (("falls silent", Operator.fall_silent), ("is killed", Operator.go)):
        commanded, rested = [], []
        for goal in itertools.islice(goals, times):
            with Operator(web, goal) as operator, Heard(lab, COMMANDS, JointCommand) as commands, \
                    Heard(lab, JOINTS[0], JointState) as states:
                wait_until(lambda states=states: slowest(states.rows[-MOVING_ROWS:]) > FAST, "an arm that moves",
                           TIMEOUT_S)
                leave(operator)
                wait_until(lambda states=states: fastest(states.rows[-RESTING_ROWS:]) < SLOW, "an arm at rest",
                           TIMEOUT_S)
            commanded.append(commands.rows[-1][0] - operator.last_s)
            rested.append(max(time_s for time_s, message in states.rows if fastest([(0.0, message)]) > SLOW)
                          - operator.last_s)
        report.add("an operator who drags a slider %s: last heartbeat to last command, the longest" % how,
                   1000.0 * max(commanded), "ms", samples=times, most=200.0)
        report.add("the same to an arm slower than %g rad/s" % SLOW, 1000.0 * max(rested), "ms", samples=times,
                   most=200.0)


def comparison(report, lab, web):
    """An arm that is dragged while the page compares the robot's interface: how often and how long it gets no command.
    """
    def is_compared():
        operator.goals = GOALS[int(time.monotonic()) % len(GOALS)]
        states = [one["is_running"] for one in operator.heard if one["op"] == "interface"]
        return True in states and not states[-1]
    with Operator(web, GOALS[0]) as operator, Heard(lab, COMMANDS, JointCommand) as commands:
        wait_until(lambda: len(commands.rows) > 10, "an arm that moves", TIMEOUT_S)
        begin, before = time.monotonic(), len(operator.heard)
        operator.socket.send(op="compare")
        wait_until(is_compared, "a comparison", TIMEOUT_S)
    times_s = [time_s for time_s, _ in commands.rows if time_s > begin]
    stops = [one for one in operator.heard[before:] if one.get("code") == "page_silent"]
    report.add("arms that stop while a page compares the interface", len(stops), "", most=0.0)
    report.add("the longest time without a command meanwhile",
               1000.0 * max(b - a for a, b in itertools.pairwise(times_s)), "ms", samples=len(times_s))


def speeds(rows):
    """The speed of the dragged joint in each (time, JointState) [rad/s]; 0 before it is known."""
    return [abs(dict(zip(message.name, message.velocity, strict=True)).get(JOINT, 0.0)) for _, message in rows]


def fastest(rows):
    return max(speeds(rows), default=0.0)


def slowest(rows):
    """0 before there are MOVING_ROWS."""
    return min(speeds(rows)) if len(rows) == MOVING_ROWS else 0.0


def enable(web):
    """Enable the robot, and wait for it."""
    state = {}
    states = web.listen(*STATE, lambda message, _time_s: state.update(message))
    with Operator(web) as operator:
        wait_until(lambda: state.get("enabled") or operator.socket.send(op="enable"), "an enabled robot", TIMEOUT_S,
                   1.0)
    states.close()


def stop(report, web, times):
    """From the page's operation to a state that is not enabled."""
    state, told = {}, []

    def keep(message, time_s):
        if state.get("enabled") and not message["enabled"]:
            told.append(time_s)
        state.update(message)
    states = web.listen(*STATE, keep)
    delays = []
    with Operator(web) as operator:
        for _ in range(times):
            wait_until(lambda: state.get("enabled") or operator.socket.send(op="enable"), "an enabled robot",
                       TIMEOUT_S, 1.0)
            told.clear()
            begin = time.monotonic()
            operator.socket.send(op="stop")
            wait_until(lambda: told, "a stopped robot", TIMEOUT_S, 0.001)
            delays.append(told[0] - begin)
    states.close()
    report.add("stop to disabled, the longest", 1000.0 * max(delays), "ms", samples=times, most=50.0)


def steer(report, lab, web, times):
    """From a page's operation to the first joint state in which an arm that was at rest moves."""
    lab.start("roslaunch", "moveit_servo", "baxter_servo.launch")
    there = []
    statuses = web.listen(*STATUS, lambda message, _time_s: there.append(message))
    wait_until(lambda: there, "the left arm's servo", TIMEOUT_S)
    statuses.close()
    enable(web)
    delays = []
    with Operator(web) as operator, Heard(lab, JOINTS[0], JointState) as states:
        for twist in itertools.islice(itertools.cycle(TWISTS), times):
            wait_until(lambda: len(states.rows) >= RESTING_ROWS and left_speed(states.rows[-RESTING_ROWS:]) < RESTS,
                       "an arm at rest", TIMEOUT_S)
            begin, number = time.monotonic(), len(states.rows)
            wait_until(lambda twist=twist, number=number: operator.socket.send(op="steer", hands={"left": twist})
                       or left_speed(states.rows[number:]) >= BEGUN, "an arm that moves", TIMEOUT_S, STEERED_EVERY_S)
            operator.socket.send(op="steer", hands={})
            delays.append(next(time_s for time_s, message in states.rows[number:]
                               if left_speed([(time_s, message)]) >= BEGUN) - begin)
    report.add("a page steers: operation to first motion, median", 1000.0 * statistics.median(delays), "ms",
               samples=times, most=60.0)
    report.add("the same, the longest", 1000.0 * max(delays), "ms", samples=times)


def left_speed(rows):
    """The greatest speed of the left arm's joints in (time, JointState) [rad/s]."""
    return max((abs(speed) for _, message in rows for name, speed in zip(message.name, message.velocity, strict=True)
                if name.startswith("left_") and "gripper" not in name), default=0.0)
