# SPDX-License-Identifier: BSD-3-Clause
"""The page in Debian's Chromium with everything of its server but ROS: a robot of the test's own takes the commands."""
import contextlib
import json
import math

import numpy as np
import pytest
from lab_arms import SIDES
from page_server import click_until
from websocket import create_connection

from lab_testing.waiting import stretched, wait_until


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


def test_a_lost_connection_says_what_the_front_door_knows(lab, browser):
    browser.evaluate("window.fetch = async () => ({status: 503, text: async () => 'Stopped by the teacher.\\n'});"
                     "lab.served.connected({is: false})")
    browser.wait("document.getElementById('told').textContent === 'No connection: Stopped by the teacher.'")
    browser.evaluate("lab.served.connected({is: true})")
    browser.wait("document.getElementById('told').textContent === ''", timeout_s=10.0)


def test_a_click_moves_the_arm_to_its_end_while_the_browser_is_busy(lab, browser):
    def go():
        lab.robot.positions["left_s0"] = 1.5
        browser.click("#pose-neutral")
        wait_until(lambda: lab.robot.positions["left_s0"] < 1.4, "the motion", 5.0)
        # As drawing without a graphics card on a busy machine: the page does nothing else meanwhile.
        browser.evaluate("(() => { const end = performance.now() + 1800; while (performance.now() < end); })()")
        wait_until(lambda: not lab.lab.is_moving, "the end of the motion")
        return lab.robot.positions["left_s0"] == 0.0
    # The machine of the test may itself be too busy, for once.
    assert any(go() for _ in range(3)), browser.evaluate("document.getElementById('told').textContent")


def test_a_slider_shows_its_joint_when_the_motion_is_over_and_the_page_says_why_it_ended(lab, browser):
    def slide(value):
        browser.evaluate("(() => { const slider = document.getElementById('joint-left_s0'); slider.value = %g;"
                         "slider.oninput(); })()" % value)
    shown = "document.getElementById('joint-left_s0').valueAsNumber"
    told = "document.getElementById('told').textContent"
    lab.robot.walls["left_s0"] = 0.3

    def is_held():
        slide(1.5)
        with contextlib.suppress(AssertionError):
            return browser.wait(told + ".includes('the crate is near')", timeout_s=6.0)
        return False
    wait_until(is_held, "a joint that is held", 60.0)
    browser.wait("Math.abs(%s - 0.3) < 0.011" % shown)
    # A joint that comes to rest a little before its target.
    slide(0.35)
    browser.wait("Math.abs(%s - 0.35) < 0.011" % shown)
    browser.wait("Math.abs(%s - 0.3) < 0.011" % shown)
    assert browser.evaluate("document.querySelector('label[for=joint-left_s0] ~ output').textContent") == "0.30 rad"


def test_a_ghost_that_lies_on_its_arm_is_seen_whole(lab, browser):
    """In patches that differ from view to view, it would flicker."""
    browser.click("#reach-left")
    browser.wait("lab.view.ghosts.size === 1")
    browser.evaluate("(() => { lab.view.ghosts.get('left').handle.getHelper().visible = false; lab.view.look('side');"
                     "})()")

    def pixels(is_alone):
        """How many pixels of the picture are of the ghost, without its arm or on it."""
        return browser.evaluate("""(() => {
            const {scene, camera, renderer, ghosts, links, canvas} = lab.view;
            const ghost = ghosts.get("left");
            for (const number of ghost.links.keys()) links[number].visible = !%s;
            ghost.material.opacity = 1;
            renderer.render(scene, camera);
            const copy = Object.assign(document.createElement("canvas"), {width: canvas.width, height: canvas.height});
            const context = copy.getContext("2d");
            context.drawImage(canvas, 0, 0);
            const data = context.getImageData(0, 0, copy.width, copy.height).data;
            return data.filter((red, at) => at %% 4 === 0 && data[at + 1] > 60 && data[at + 1] > 1.5 * red).length;
        })()""" % json.dumps(is_alone))
    alone, on_the_arm = pixels(True), pixels(False)
    assert alone > 500 and on_the_arm > 0.98 * alone, (alone, on_the_arm)


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
                 " === 'wave: not passed, 62.5 of 100 points; 80 are needed'")
    assert browser.evaluate("document.getElementById('exercise-hint').textContent") == "Hint: the sine is too short"
    assert browser.evaluate("[...document.querySelectorAll('#exercise-runs td')].map((cell) => cell.textContent)") == [
        "path", "20 / 40", "1.5 periods"]


def test_how_much_of_a_physical_robots_interface_is_here(lab, browser):
    said = "document.getElementById('interface-said').textContent"
    browser.evaluate("document.getElementById('interface').open = true")
    assert "how many of them are here?" in browser.evaluate(said)
    click_until(browser, "#interface-compare", lambda: lab.compared)
    lab.pages.share("interface", {"is_running": True})
    browser.wait(said + ".startsWith('Comparing') && document.getElementById('interface-compare').disabled")
    lab.pages.share("interface", {
        "is_running": False, "met": 258, "of": 272, "when_s": 1.79e9,
        "groups": [{"name": "/robot", "met": 258, "of": 270}],
        "others": [{"name": "/robot/x", "verdict": "missing", "reason": "nobody publishes it"},
                   {"name": "/robot/y", "verdict": "other", "reason": "type a, not b"}]})
    browser.wait(said + ".startsWith('258 of 272 are here (') && " + said + ".includes('2026')")
    assert browser.evaluate("document.getElementById('interface-groups').textContent") == "/robot258 / 270"
    assert browser.evaluate("[...document.querySelectorAll('#interface-others li')].map((one) => one.textContent)") == [
        "/robot/x is missing: nobody publishes it", "/robot/y is other than expected: type a, not b"]
    assert browser.evaluate("!document.getElementById('interface-compare').disabled")


def test_a_picture_fills_the_screen_as_far_as_its_shape_lets_it(lab, browser, tmp_path):
    path = tmp_path / "red.svg"
    path.write_text('<svg xmlns="http://www.w3.org/2000/svg" width="100" height="100">'
                    '<rect width="100" height="100" fill="#ff8000"/></svg>')
    browser.choose_file("#screen-file", path)
    wait_until(lambda: lab.shown, "the picture")
    rows = np.frombuffer(lab.shown[0], np.uint8).reshape(600, 1024, 3)
    assert rows[300, 512].tolist() == [255, 128, 0] and rows[300, 100].tolist() == [0, 0, 0]


def test_a_paused_simulation_is_seen_in_the_first_line(lab, browser):
    said = "document.getElementById('factor').textContent"
    lab.pages.share("simulation", {"paused": True})
    browser.wait(said + " === 'Simulation paused'")
    lab.pages.share("simulation", {"paused": False})
    browser.wait(said + " !== 'Simulation paused'")


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


def test_the_page_fits_a_telephone(lab, browser):
    browser.resize(390, 844)
    try:
        browser.evaluate("document.querySelectorAll('details').forEach((part) => { part.open = true; })")
        browser.click("#reach-left")
        browser.wait("!lab.hands.hands.get('left').fields.hidden")
        assert browser.evaluate("document.documentElement.scrollWidth") <= 390
        # What the page says is in sight below STOP, wherever the button was.
        browser.evaluate("lab.served.told({code: 'held', text: 'the crate is near'})")
        browser.evaluate("document.getElementById('record').scrollIntoView({block: 'center'})")
        header, (top, bottom) = (browser.evaluate(
            "(({top, bottom}) => [top, bottom])(document.querySelector('%s').getBoundingClientRect())" % selector)
            for selector in ("header", "#told"))
        assert header[0] == 0 and header[1] <= top < bottom < 844, (header, top, bottom)
    finally:
        browser.resize(1000, 800)
