# SPDX-License-Identifier: BSD-3-Clause
"""The page in Debian's Chromium with everything of its server but ROS: a robot of the test's own takes the commands."""
import contextlib
import json
import math
import threading
from pathlib import Path
from types import SimpleNamespace

import lab_arms
import numpy as np
import pytest
from lab_arms import JOINTS, LIMIT_RAD, SIDES, URDF, VELOCITY
from tornado import web, websocket
from websocket import create_connection

from lab_testing.browser import Browser, why_not
from lab_testing.waiting import stretched, wait_until
from lab_web.buttons import Buttons
from lab_web.clouds import packed
from lab_web.errands import Errands
from lab_web.hands import Hands, ghost
from lab_web.lab import Lab
from lab_web.libraries import LibrariesError, fetched
from lab_web.motion import Limits
from lab_web.playback import Recorder, play
from lab_web.scene import SceneFollower
from lab_web.serving import Pages, routes, upload_routes
from loop_ros.faults import Faults
from urdf_model import parse_urdf
from web_bridge.access import Access
from web_bridge.loop_thread import LoopThread
from web_bridge.serving import Serving
from world_picture.snapshot import SnapshotWriter

NUMBERS = "/lab/numbers"
PAGE = Path(__file__).resolve().parents[2] / "page"
pytestmark = pytest.mark.once
IS_DRAWN = """(() => {
    const canvas = document.getElementById("%s");
    const data = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
    return data.some((value, number) => number %% 4 === 3 && value > 0) && canvas.width > 100;
})()"""


class Robot:
    """Follows its commands at once."""

    def __init__(self):
        self.positions = lab_arms.posture()
        self.limits = dict.fromkeys(JOINTS, Limits(-LIMIT_RAD, LIMIT_RAD, VELOCITY))
        self.poses = {"neutral": dict(self.positions)}
        self.enabled, self.stopped = False, False
        self.switched = []

    def measured(self):
        return dict(self.positions)

    def why_not_ready(self):
        return "stopped" if self.stopped else "" if self.enabled else "not enabled"

    def command(self, setpoints):
        self.positions.update(setpoints)

    def stop(self):
        self.enabled, self.stopped = False, True

    def enable(self):
        self.enabled, self.stopped = True, False

    def disable(self):
        self.enabled = False

    def switch(self, *what):
        self.switched.append(what)


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


async def say(sockets, robot, time_s):
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
    for socket in list(sockets):
        for topic in socket.topics & messages.keys():
            with contextlib.suppress(websocket.WebSocketClosedError):
                await socket.write_message(json.dumps({"op": "publish", "topic": topic, "msg": messages[topic]}))


class Frame(web.RequestHandler):
    """Instead of JupyterLab."""

    def get(self):
        self.finish("<p>jupyter of %s" % self.get_query_argument("token"))


class Server:
    """The page's server; its address is ``address``."""

    def __init__(self, libraries, folder):
        self.robot = Robot()
        self._ended = threading.Event()
        self._sockets = set()
        self.loop = LoopThread()
        self.pages = Pages(Access({"drive": True, "look": False}, names=[]), self.loop)
        self.lab = self.pages.lab = Lab(self.robot, self.pages.control_changed, self.pages.tell)
        hands = Hands(self.robot.measured, lambda chain, joints: ghost(self.pages.picture, chain, joints),
                      self.pages.answer)
        description = parse_urdf(URDF, source="robot")
        hands.know(description, {side: ("base", side + "_gripper") for side in SIDES}, pytest.fail)
        errands = Errands(self.pages.tell, Faults(SimpleNamespace(error=pytest.fail)))
        buttons = Buttons(self.robot.switch, errands)
        self.lab.when_lost(buttons.release_all)
        recorder = Recorder(lambda state: self.pages.share("recording", state))
        self.shown, self.planned, self.notebook_asks, self.watched = [], [], [], {}
        self.lab.add("watch", self.watched.__setitem__, needs_control=False, for_viewers=True)
        for name, serve in {"press": buttons.press, "turn": buttons.turn,
                            "screen": lambda client, operation: self.shown.append(operation["content"]),
                            "plan": self.plan,
                            "play": lambda client, operation: play(self.lab, client, recorder)}.items():
            self.lab.add(name, serve)
        for name, serve in {"notebook": lambda *asked: self.notebook_asks.append(asked), "reach": hands.ask,
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
            "poses": ["neutral"], "hands": hands.sides, "grippers": [], "cameras": [], "has_scene": True,
            "can_plan": True, "can_press": True, "things": ["block"]})
        application = web.Application([*routes(self.pages, PAGE, libraries), *upload_routes(self.pages, recorder),
                                       (r"/notebook/lab.*", Frame),
                                       (r"/rosbridge", Rosbridge, {"sockets": self._sockets})])
        self._serving = Serving(self.loop, application, 0, "127.0.0.1")
        self.address = "http://127.0.0.1:%d/?token=" % self._serving.port
        self._threads = [threading.Thread(target=target, args=(self._ended.is_set,))
                         for target in (self.lab.run, hands.run, errands.run, self._run)]
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
            self.loop.run(say(self._sockets, self.robot, 0.02 * self.ticks))

    def close(self):
        self._ended.set()
        for thread in self._threads:
            thread.join()
        self._serving.close()
        self.loop.stop()
        self._writer.close()


@pytest.fixture(scope="module")
def libraries():
    if reason := why_not():
        pytest.skip(reason)
    try:
        return fetched(PAGE)
    except LibrariesError as error:
        pytest.skip(str(error))


@pytest.fixture(scope="module")
def browser(libraries):
    made = Browser(1000, 800)
    yield made
    made.close()


def click_until(browser, selector, condition):
    """Press an element until the condition is true: a busy machine may be too slow for the heartbeat."""
    def done():
        browser.click(selector)
        with contextlib.suppress(AssertionError):
            return wait_until(condition, timeout_s=5.0)
        return False
    wait_until(done, selector, 120.0)


@pytest.fixture
def lab(libraries, browser, tmp_path):
    """A server whose page has the control of an enabled robot."""
    server = Server(libraries, tmp_path)
    try:
        browser.open(server.address + "drive")
        browser.wait("globalThis.lab?.state.connected && lab.state.robot && lab.view.revision !== null")
        browser.wait("!document.getElementById('control').disabled")
        browser.click("#control")
        browser.wait("lab.state.mine && !document.getElementById('enable').disabled")
        click_until(browser, "#enable", lambda: server.robot.enabled)
        browser.wait("lab.state.robot.enabled")
        browser.errors.clear()
        yield server
        assert browser.errors == []
    finally:
        browser.call("Page.navigate", url="about:blank")
        server.close()


def hand(browser, side):
    """(does the arm get there, what the page says, its joints {name: [rad]}, the numbers x y z [m], roll pitch yaw)."""
    browser.wait("(({asked, wanted}) => asked === null && !wanted)(lab.hands.hands.get('%s'))" % side)
    return browser.evaluate("(({reaches, said, joints, inputs}) => [reaches, said.textContent, joints,"
                            "inputs.map((input) => input.valueAsNumber)])(lab.hands.hands.get('%s'))" % side)


def drag(browser, handle, across, down):
    """Drag a handle of the 3D view by pixels."""
    browser.evaluate("scrollTo(0, 0)")
    column, row = browser.evaluate("""(() => {
        const {camera, canvas, ghosts} = lab.view;
        const place = ghosts.get("%s").hand.getWorldPosition(camera.position.clone()).project(camera);
        const {left, top, width, height} = canvas.getBoundingClientRect();
        return [left + (place.x + 1) / 2 * width, top + (1 - place.y) / 2 * height];
    })()""" % handle)
    browser.drag((column, row), (column + across, row + down))


def go_until(browser, robot, joints):
    """Press "Go" until the joints are there: a busy machine may be too slow for the heartbeat."""
    def there():
        if all(abs(robot.positions[name] - angle) < 0.01 for name, angle in joints.items()):
            return True
        if browser.evaluate("!document.getElementById('reach-go').disabled"):
            browser.click("#reach-go")
        return False
    wait_until(there, "the joints at their targets", 120.0, interval_s=1.0)


def test_both_hands_are_dragged_and_go_together(lab, browser):
    for side in SIDES:
        browser.click("#reach-" + side)
    browser.wait("lab.view.ghosts.size === 2")
    before, joints = {side: hand(browser, side) for side in SIDES}, {}
    for side, across in (("left", 25), ("right", -25)):
        drag(browser, side, across, 15)
        reaches, said, found, numbers = hand(browser, side)
        assert reaches, said
        assert 0.02 < math.dist(numbers[:3], before[side][3][:3]) < 0.4
        assert max(abs(number) for number in np.subtract(numbers[3:], before[side][3][3:])) < 0.2
        joints.update(found)
    start = dict(lab.robot.positions)
    assert max(abs(joints[name] - start[name]) for name in joints) > 0.02
    go_until(browser, lab.robot, joints)


def test_a_hand_out_of_reach_says_so_and_does_not_go(lab, browser):
    browser.click("#reach-left")
    browser.wait("lab.view.ghosts.size === 1")
    assert hand(browser, "left")[0]
    browser.evaluate("(() => { const {inputs} = lab.hands.hands.get('left'); inputs[0].value = 3;"
                     "inputs[0].onchange(); })()")
    reaches, said, _, _ = hand(browser, "left")
    assert not reaches and said.startswith("Out of reach: ") and "move it" in said
    assert browser.evaluate("document.getElementById('reach-go').disabled")
    assert browser.evaluate("lab.view.ghosts.get('left').material.color.getHexString()") == "d0342c"
    # Back to where the hand is.
    browser.evaluate("lab.hands.hands.get('left').ask({})")
    assert hand(browser, "left")[0] and browser.evaluate("!document.getElementById('reach-go').disabled")


def test_a_hint_goes_when_it_has_been_followed(lab, browser):
    browser.click("#stop")
    browser.wait("lab.state.robot.stopped && document.getElementById('told').textContent.includes('Enable the robot')")
    click_until(browser, "#enable", lambda: lab.robot.enabled)
    browser.wait("document.getElementById('told').textContent === ''", timeout_s=10.0)
    browser.click("#control")
    browser.wait("!lab.state.mine")
    browser.evaluate("lab.send({op: 'pose', name: 'neutral'})")
    browser.wait("document.getElementById('told').textContent.includes('Take control')")
    browser.click("#control")
    browser.wait("lab.state.mine && document.getElementById('told').textContent === ''", timeout_s=10.0)


def test_a_second_page_asks_for_itself_and_moves_nothing(lab, browser):
    browser.click("#reach-left")
    browser.wait("lab.view.ghosts.size === 1")
    drag(browser, "left", 25, 15)
    other = create_connection(lab.address.replace("http", "ws").replace("/?", "/lab?") + "drive",
                              timeout=stretched(60))
    try:
        for operation in ({"op": "reach", "side": "left", "number": 5},
                          {"op": "move", "joints": {"left_s0": 0.5}}, {"op": "press", "name": "b", "pressed": True}):
            other.send(json.dumps(operation))
        frames = (json.loads(frame) for frame in iter(other.recv, None) if isinstance(frame, str))
        answers = [next(frame for frame in frames if frame["op"] in ("reach", "told")) for _ in range(3)]
    finally:
        other.close()
    (reached,) = (answer for answer in answers if answer["op"] == "reach")
    assert (reached["side"], reached["number"], reached["why"]) == ("left", 5, "")
    assert [answer["code"] for answer in answers if answer["op"] == "told"] == ["not_in_control"] * 2
    assert reached["position"] != pytest.approx(hand(browser, "left")[3][:3], abs=1e-2)
    assert lab.lab.is_moving is False and lab.robot.switched == []


def test_a_button_is_held_as_long_as_the_pointer_and_no_longer_than_the_control(lab, browser):
    browser.evaluate("document.getElementById('buttons').open = true")
    def last(name):
        return ([None] + [action for action, component, _ in lab.robot.switched if component == name])[-1]
    click_until(browser, "#press-left_lower_button", lambda: last("left_lower_button") == "release")
    assert ("press", "left_lower_button", 0) in lab.robot.switched
    click_until(browser, "#turn-left_wheel-up", lambda: ("turn", "left_wheel", 1) in lab.robot.switched)
    click_until(browser, "#press-right_lower_cuff", lambda: ("press", "right_lower_cuff", 0) in lab.robot.switched)
    browser.click("#control")
    wait_until(lambda: last("right_lower_cuff") == "release", "the release of the cuff")


def test_poses_and_hands_are_planned_where_the_page_wants_it(lab, browser):
    said = "document.getElementById('plan-said').textContent"
    browser.click("#plan-first")
    click_until(browser, "#pose-neutral", lambda: lab.planned)
    browser.wait(said + " === 'The arms would touch something there: the crate is there'")
    assert lab.planned[-1] == {"op": "plan", "name": "neutral"} and lab.lab.is_moving is False
    browser.evaluate("(() => { const list = document.getElementById('language'); list.value = 'zh';"
                     "return list.onchange(); })()")
    browser.wait(said + " === '手臂在目标处会发生碰撞：the crate is there'")
    browser.evaluate("(() => { const list = document.getElementById('language'); list.value = 'en';"
                     "return list.onchange(); })()")
    browser.click("#reach-left")
    browser.wait("lab.view.ghosts.size === 1")
    _, _, joints, _ = hand(browser, "left")
    click_until(browser, "#reach-go", lambda: "joints" in lab.planned[-1])
    assert lab.planned[-1]["joints"] == pytest.approx(joints)
    browser.click("#plan-first")
    browser.evaluate("localStorage.clear()")


def test_an_exercises_verdict_is_beside_the_robot(lab, browser):
    assert browser.evaluate("document.getElementById('exercise').hidden")
    lab.pages.share("result", {
        "exercise": "wave", "passed": False, "points": 62.5, "due": 80.0, "why": "", "hint": "the sine is too short",
        "runs": [{"call": "", "criteria": [{"name": "path", "points": 20.0, "of": 40.0, "found": "1.5 periods"}]}]})
    browser.wait("document.getElementById('exercise-verdict').textContent"
                 " === 'wave: not passed, 62.5 of 100 points; 80 are due'")
    assert browser.evaluate("document.getElementById('exercise-hint').textContent") == "Hint: the sine is too short"
    assert browser.evaluate("[...document.querySelectorAll('#exercise-runs td')].map((cell) => cell.textContent)") == [
        "path", "20 / 40", "1.5 periods"]


def share_notebook(lab, state, number="", why=""):
    lab.pages.share("notebook", {"state": state, "why": why, "number": number, "files": ["src/1_first_steps.ipynb"]})


@pytest.fixture
def notebook(lab, browser):
    """A page with an open notebook; its server."""
    assert browser.evaluate("document.getElementById('notebook-toggle').hidden")
    share_notebook(lab, "off")
    browser.wait("!document.getElementById('notebook-toggle').hidden")
    browser.click("#notebook-toggle")
    wait_until(lambda: lab.notebook_asks, "a page that asks for the notebook")
    share_notebook(lab, "starting")
    browser.wait("document.getElementById('notebook-said').textContent.includes('starting')")
    share_notebook(lab, "running", "1")
    browser.wait(FRAME + ".contentDocument?.body?.textContent === 'jupyter of drive'")
    yield lab
    browser.evaluate("localStorage.clear()")
    browser.resize(1000, 800)


FRAME = "document.getElementById('notebook-frame')"
BOX = ("(({left, right, top, bottom}) => [left, right, top, bottom])"
       "(document.querySelector('%s').getBoundingClientRect())")


def test_the_notebook_is_beside_the_robot_and_keys_and_the_pointer_divide_the_width(notebook, browser):
    def share():
        return int(browser.evaluate("document.getElementById('split').getAttribute('aria-valuenow')"))
    browser.evaluate("document.getElementById('split').focus()")
    for key, after in (("Home", 20), ("ArrowRight", 25), ("End", 80), ("ArrowLeft", 75)):
        browser.press(key, key)
        assert share() == after
        _, right, _, _ = browser.evaluate(BOX % "#notebook-frame")
        left, end, _, _ = browser.evaluate(BOX % "#view")
        assert 0 < right < left < end <= 1000 and abs(right - 10 * after) < 30
    left, right, top, bottom = browser.evaluate(BOX % "#split")
    browser.drag(((left + right) / 2, (top + bottom) / 2), (400, 300))
    assert abs(share() - 40) <= 1
    browser.evaluate("scrollTo(0, document.body.scrollHeight)")
    _, _, top, bottom = browser.evaluate(BOX % "#notebook-frame")
    assert 0 < top < bottom <= 800  # it stays while the panels scroll


def test_a_notebook_is_chosen_and_a_new_server_is_loaded_again(notebook, browser):
    browser.evaluate("(() => { const list = document.getElementById('notebook-file'); list.selectedIndex = 1;"
                     "list.onchange(); })()")
    browser.wait(FRAME + ".contentWindow.location.pathname === '/notebook/lab/tree/src/1_first_steps.ipynb'")
    browser.evaluate(FRAME + ".contentWindow.old = true")
    share_notebook(notebook, "running", "1")
    share_notebook(notebook, "failed", why="no space")
    browser.wait("document.getElementById('notebook-said').textContent.startsWith('No notebook: no space.')")
    assert browser.evaluate(FRAME + ".contentWindow.old")
    before = len(notebook.notebook_asks)
    for is_open in (False, True):
        browser.click("#notebook-toggle")
        assert browser.evaluate("document.getElementById('notebook').hidden") is not is_open
    wait_until(lambda: len(notebook.notebook_asks) == before + 1, "another try")
    share_notebook(notebook, "running", "2")
    browser.wait("!%s.contentWindow.old" % FRAME)


def test_the_notebook_is_above_the_robot_on_a_telephone(notebook, browser):
    browser.resize(390, 844)
    assert browser.evaluate("document.documentElement.scrollWidth") <= 390
    _, _, _, bottom = browser.evaluate(BOX % "#notebook")
    _, _, top, _ = browser.evaluate(BOX % "#view")
    assert bottom < top
    left, right, top, bottom = browser.evaluate(BOX % "#stop")
    assert 0 <= left < right <= 390 and 0 <= top < bottom <= 844


def test_a_page_that_only_watches_has_no_notebook(lab, browser):
    share_notebook(lab, "running", "1")
    browser.open(lab.address + "look")
    browser.wait("globalThis.lab?.state.connected && lab.notebook.state")
    assert browser.evaluate("document.getElementById('notebook-toggle').hidden && !%s.src" % FRAME)


def test_a_picture_fills_the_screen_as_far_as_its_shape_lets_it(lab, browser, tmp_path):
    path = tmp_path / "red.svg"
    path.write_text('<svg xmlns="http://www.w3.org/2000/svg" width="100" height="100">'
                    '<rect width="100" height="100" fill="#ff8000"/></svg>')
    browser.choose_file("#screen-file", path)
    wait_until(lambda: lab.shown, "the picture")
    rows = np.frombuffer(lab.shown[0], np.uint8).reshape(600, 1024, 3)
    assert rows[300, 512].tolist() == [255, 128, 0] and rows[300, 100].tolist() == [0, 0, 0]


def test_a_motion_is_recorded_and_played(lab, browser):
    browser.click("#record")
    browser.wait("document.getElementById('record').ariaPressed === 'true'")
    lab.robot.positions["left_s0"] = 0.4
    before = lab.ticks
    wait_until(lambda: lab.ticks > before + 15, "rows of the recording")
    browser.click("#record")
    browser.wait("!document.getElementById('play').disabled")
    text = browser.evaluate("fetch(document.getElementById('recording-save').href).then((answer) => answer.text())")
    assert text.startswith("time,left_s0,") and len(text.splitlines()) > 5
    lab.robot.positions["left_s0"] = -0.2
    browser.click("#play")

    def played():
        if lab.robot.positions["left_s0"] == pytest.approx(0.4, abs=1e-3):
            return True
        if not lab.lab.is_moving:
            browser.click("#play")
        return False
    wait_until(played, "the end of the recording", 120.0, interval_s=0.5)


def test_curves_of_joints_are_drawn(lab, browser):
    browser.evaluate("document.getElementById('plots').open = true")
    browser.wait(IS_DRAWN % "plot-position")
    assert browser.evaluate("document.querySelectorAll('#plot-key li').length") == 7


def test_numbers_of_any_topic_are_drawn(lab, browser):
    def choose(topic):
        browser.evaluate("(() => { const field = document.getElementById('numbers-topic'); field.value = '%s';"
                         "field.onchange(); })()" % topic)
    lab.pages.share("topics", {"types": {NUMBERS: "lab_msgs/Numbers", "/camera": "sensor_msgs/Image"}})
    browser.evaluate("document.getElementById('numbers').open = true")
    browser.wait("document.querySelectorAll('#numbers-topics option').length === 1")
    choose("/camera")
    browser.wait("document.getElementById('numbers-said').textContent === 'Nobody publishes numbers on /camera.'")
    choose(NUMBERS)
    fields = "[...document.querySelectorAll('#numbers-fields option')].map((option) => option.value)"
    browser.wait(fields + ".length > 0")
    assert browser.evaluate(fields) == ["near", "wrench.force.x", "values[a]", "values[b]", "rest[0]"]
    browser.evaluate("document.querySelectorAll('#numbers-fields option').forEach((option, number) =>"
                     "{ option.selected = number === 1 || number === 3; })")
    key = "[...document.querySelectorAll('#numbers-key li')].map((label) => label.textContent)"
    found = browser.wait("(%s.length === 2 && %s)" % (key, key))
    assert found[0].startswith("wrench.force.x = ") and found[1] == "values[b] = 2"
    browser.wait(IS_DRAWN % "numbers-canvas")
    browser.evaluate("document.getElementById('numbers').open = false")


def test_points_and_frames_are_seen_where_they_are(lab, browser):
    lab.pages.share("topics", {"types": {"/kinect/points": "sensor_msgs/PointCloud2", "/other": "std_msgs/String"}})
    browser.wait("document.querySelectorAll('#points option').length === 2")
    browser.evaluate("(() => { const list = document.getElementById('points'); list.value = '/kinect/points';"
                     "list.onchange(); document.getElementById('show-frames').click(); })()")
    number = browser.evaluate("lab.state.number")
    wait_until(lambda: lab.watched.get(number) == {"op": "watch", "points": "/kinect/points", "frames": True},
               lambda: "what the page wants, not %s" % lab.watched)
    pose = np.eye(4)
    pose[:3, 3] = 0.5, 0.0, 1.0
    # A red wall in front of the robot.
    wall = np.array([[0.0, 0.01 * column, 0.01 * row] for column in range(40) for row in range(40)], np.float32)
    lab.pages.show(number, packed(wall, np.full((1600, 3), (255, 0, 0), np.uint8), pose))
    lab.pages.answer(number, {"op": "frames", "frames": [["base", pose[:3].ravel().tolist()]]})
    browser.wait("lab.overlay.points && lab.overlay.frames && !lab.view.planned")
    browser.evaluate("scrollTo(0, 0)")
    column, row = browser.evaluate("""(() => {
        const {camera, canvas} = lab.view;
        const place = camera.position.clone().set(0.5, 0.2, 1.2).project(camera);
        const {left, top, width, height} = canvas.getBoundingClientRect();
        return [left + (place.x + 1) / 2 * width, top + (1 - place.y) / 2 * height];
    })()""")

    def red_share():
        near = browser.picture()[round(row) - 6:round(row) + 7, round(column) - 6:round(column) + 7].astype(int)
        return (near[:, :, 0] - near[:, :, 1:].max(axis=2) > 100).mean()
    wait_until(lambda: red_share() > 0.1, "red points")
    browser.evaluate("(() => { const list = document.getElementById('points'); list.value = ''; list.onchange();"
                     "document.getElementById('show-frames').click(); })()")
    browser.wait("!lab.overlay.points && !lab.overlay.frames && !lab.view.planned")
    wait_until(lambda: red_share() == 0.0, "the picture without points")


def test_the_page_fits_a_telephone(lab, browser):
    browser.resize(390, 844)
    try:
        browser.evaluate("document.querySelectorAll('details').forEach((part) => { part.open = true; })")
        browser.click("#reach-left")
        browser.wait("!lab.hands.hands.get('left').fields.hidden")
        assert browser.evaluate("document.documentElement.scrollWidth") <= 390
    finally:
        browser.resize(1000, 800)
