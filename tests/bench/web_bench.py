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

import cv2
import numpy as np
from labs import Lab
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
TIMEOUT_S = 60.0


class Socket:
    """A WebSocket whose frames arrive in a thread: ``heard(operation, time [s])``."""

    def __init__(self, address, heard):
        self._socket = create_connection(address, timeout=TIMEOUT_S)
        self._heard = heard
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()

    def send(self, **operation):
        self._socket.send(json.dumps(operation))

    def beat(self):
        self._socket.send("beat")

    def close(self):
        self._socket.close()
        self._thread.join(TIMEOUT_S)

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
        stop(report, web, 3 if quick else 10)


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
        delays = browser.evaluate("""(async () => {
            const hand = lab.hands.hands.get("left"), took = [];
            const {position, quaternion} = lab.view.ghosts.get("left").hand;
            const [x, y, z] = position.toArray();
            for (let number = 0; number < %d; number += 1) {
                const begin = performance.now();
                hand.dragged({position: [x + 0.001 * (number %% 20), y, z], orientation: quaternion.toArray()});
                await new Promise((done) => {
                    const answered = hand.answered;
                    hand.answered = (answer) => {
                        answered.call(hand, answer);
                        if (answer.number !== hand.number || hand.wanted) return;
                        delete hand.answered;
                        done();
                    };
                });
                took.push(performance.now() - begin);
            }
            return took;
        })()""" % times)
        report.add("handle to ghost in the page, median", statistics.median(delays), "ms", samples=times, most=30.0)
    finally:
        browser.close()


def stop(report, web, times):
    """From the page's operation to a state that is not enabled."""
    state, told = {}, []

    def keep(message, time_s):
        if state.get("enabled") and not message["enabled"]:
            told.append(time_s)
        state.update(message)
    states = web.listen(*STATE, keep)
    driver = Socket(web.page, lambda *_: None)
    ended = threading.Event()

    def beat():
        while not ended.wait(HEARTBEAT_S):
            driver.beat()
    heart = threading.Thread(target=beat)
    heart.start()
    delays = []
    try:
        driver.beat()
        driver.send(op="take")
        for _ in range(times):
            wait_until(lambda: state.get("enabled") or driver.send(op="enable"), "an enabled robot", TIMEOUT_S, 1.0)
            told.clear()
            begin = time.monotonic()
            driver.send(op="stop")
            wait_until(lambda: told, "a stopped robot", TIMEOUT_S, 0.001)
            delays.append(told[0] - begin)
    finally:
        ended.set()
        heart.join()
        driver.close()
        states.close()
    report.add("stop to disabled, the longest", 1000.0 * max(delays), "ms", samples=times, most=50.0)
