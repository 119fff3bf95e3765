# SPDX-License-Identifier: BSD-3-Clause
"""Steering by the page in Debian's Chromium: what is held moves the hand, and every way of letting go stops it."""
import pytest

from lab_testing.waiting import wait_until
from lab_web.control import SILENCE_S

UP = "#steer-up"
PAD = """globalThis.pad = {connected: true, mapping: "standard", axes: [0, 0, 0, 0],
    buttons: Array.from({length: 17}, () => ({pressed: false}))}; navigator.getGamepads = () => [null, pad]"""


@pytest.fixture
def steered(lab, browser):
    """The lab with the panel of steering open, the left hand chosen."""
    browser.evaluate("document.getElementById('steering-open').open = true")
    browser.wait("!document.querySelector('%s').disabled" % UP)
    browser.evaluate("document.activeElement.blur()")
    return lab


def mouse(browser, selector, kind):
    place = browser.evaluate("""(() => {
        const one = document.querySelector("%s");
        one.scrollIntoView({block: "center"});
        const {left, top, width, height} = one.getBoundingClientRect();
        return {x: left + width / 2, y: top + height / 2};
    })()""" % selector)
    browser.call("Input.dispatchMouseEvent", type=kind, button="left", clickCount=1, **place)


def key(browser, name, kind="keyDown"):
    browser.call("Input.dispatchKeyEvent", type=kind, key=name, code="Key" + name.upper())


def wait_for(servo, moves):
    wait_until(lambda: servo.moves is moves, "a hand that %s" % ("moves" if moves else "rests"), 60.0)


def hold_a_key(lab, browser, name="r"):
    """Press a key until the hand moves: a busy machine may be too slow for the heartbeat."""
    def moves():
        if not lab.servos["left"].moves:
            key(browser, name, "keyUp")
            key(browser, name)
        return lab.servos["left"].moves
    wait_until(moves, "a hand that moves", 60.0, interval_s=0.5)


def test_on_a_telephone_the_robot_is_in_sight_above_the_buttons(steered, browser):
    browser.resize(390, 844)
    try:
        for selector in ("#steer-motions .hold:first-child", "#steer-motions .hold:last-child"):
            browser.evaluate("document.querySelector('%s').scrollIntoView({block: 'center'})" % selector)
            header, world, button = (browser.evaluate(
                "(({top, bottom}) => [top, bottom])(document.querySelector('%s').getBoundingClientRect())" % one)
                for one in ("header", "#view", selector))
            assert header[0] == 0 and header[1] <= world[0] + 1 < world[1] - 200, (header, world)
            assert world[1] <= button[0] < button[1] <= 844, (world, button)
        assert browser.evaluate("document.documentElement.scrollWidth") <= 390
    finally:
        browser.resize(1000, 800)


def test_a_button_moves_the_hand_while_it_is_held(steered, browser):
    left = steered.servos["left"]
    mouse(browser, UP, "mousePressed")
    wait_for(left, True)
    assert left.sent[-1] == ([0.0, 0.0, pytest.approx(0.4), 0.0, 0.0, 0.0], False)
    assert not steered.servos["right"].sent
    mouse(browser, UP, "mouseReleased")
    wait_for(left, False)
    count = len(left.sent)
    browser.wait("!lab.steering.isMoving")
    assert len(left.sent) == count


def test_keys_steer_the_chosen_hand_in_the_chosen_axes_at_the_chosen_speed(steered, browser):
    right = steered.servos["right"]
    for name in ("h", "t"):
        key(browser, name)
        key(browser, name, "keyUp")
    browser.evaluate("(() => { const speed = document.getElementById('steer-speed'); speed.value = 100;"
                     "speed.oninput(); })()")
    key(browser, "w")
    key(browser, "j")
    wait_until(lambda: right.sent and right.sent[-1] == ([1.0, 0.0, 0.0, 0.0, 0.0, 1.0], True), "both motions", 60.0)
    key(browser, "w", "keyUp")
    wait_until(lambda: right.sent[-1] == ([0.0, 0.0, 0.0, 0.0, 0.0, 1.0], True), "one motion", 60.0)
    key(browser, "j", "keyUp")
    wait_for(right, False)
    assert not steered.servos["left"].sent
    # Who types a number does not steer.
    browser.click("#steer-both")
    browser.evaluate("document.getElementById('numbers').open = true")
    browser.evaluate("document.getElementById('numbers-topic').focus()")
    key(browser, "w")
    key(browser, "w", "keyUp")
    browser.evaluate("document.activeElement.blur()")
    assert not steered.servos["left"].sent


@pytest.mark.parametrize("lose", [
    "dispatchEvent(new Event('blur'))", "document.getElementById('numbers-topic').focus()",
    "document.getElementById('steering-open').open = false", "document.getElementById('control').click()",
    "document.getElementById('stop').click()", "document.getElementById('steer-right').click()",
    # Another page's.
    "lab.served.told({code: 'stopped', text: ''})"])
def test_a_key_whose_release_nobody_hears_holds_nothing(steered, browser, lose):
    browser.evaluate("document.getElementById('numbers').open = true")
    hold_a_key(steered, browser)
    browser.evaluate(lose)
    wait_for(steered.servos["left"], False)
    browser.wait("!lab.steering.isMoving")
    key(browser, "r", "keyUp")


def test_a_tab_that_is_closed_stops_the_hand(steered, browser):
    hold_a_key(steered, browser)
    browser.call("Page.navigate", url="about:blank")
    wait_for(steered.servos["left"], False)
    key(browser, "r", "keyUp")


def test_a_browser_that_hangs_stops_the_hand(steered, browser):
    hold_a_key(steered, browser)
    left = steered.servos["left"]
    browser.freeze()
    try:
        wait_for(left, False)
    finally:
        browser.thaw()
    key(browser, "r", "keyUp")
    assert SILENCE_S < 0.2


def test_a_gamepad_steers_while_its_shoulder_button_is_held(steered, browser):
    left = steered.servos["left"]
    browser.evaluate(PAD)
    browser.evaluate("pad.axes = [0, -1, 0.05, -0.5]")
    ticks = steered.ticks
    wait_until(lambda: steered.ticks > ticks + 20, "looks at the gamepad")
    assert not left.sent
    browser.evaluate("pad.buttons[5].pressed = true")
    along_and_up = pytest.approx([0.4, 0.0, 0.2, 0.0, 0.0, 0.0])
    wait_until(lambda: left.sent and left.sent[-1][0] == along_and_up, "a motion", 60.0)
    browser.evaluate("pad.buttons[4].pressed = true")
    wait_for(left, False)
    browser.wait("lab.steering.chosen === 'right'")
    # What was held before the change has to be held again.
    browser.evaluate("pad.buttons[4].pressed = false")
    ticks = steered.ticks
    wait_until(lambda: steered.ticks > ticks + 20, "looks at the gamepad")
    assert not steered.servos["right"].moves
    browser.evaluate("pad.buttons[5].pressed = false")
    browser.wait("!lab.steering.padLocked")
    browser.evaluate("pad.buttons[5].pressed = true")
    wait_for(steered.servos["right"], True)
    browser.evaluate("pad.connected = false")
    wait_for(steered.servos["right"], False)
    browser.evaluate("delete navigator.getGamepads")


def test_what_holds_the_arm_is_told_beside_the_robot_and_red_on_it(steered, browser):
    colours = ("[...lab.view.marked.keys()].map((number) => lab.view.links[number].children[0].material.color"
               ".getHexString())")
    said = "[...document.querySelectorAll('#steer-state li')].map((one) => [one.className, one.textContent])"
    browser.wait("document.querySelectorAll('#steer-state li.good').length === 2")
    steered.servos["left"].status = 5
    steered.servos["left"].reason = "100 % of the motion is held back by the limits of left_e1"
    browser.wait("document.querySelectorAll('#steer-state li.bad').length === 1")
    assert browser.evaluate(said)[0] == ["bad", "Left hand: " + steered.servos["left"].reason]
    assert browser.evaluate(colours) == ["d0342c"]
    steered.servos["left"].status, steered.servos["left"].reason = 0, ""
    browser.wait("document.querySelectorAll('#steer-state li.good').length === 2")
    assert browser.evaluate("lab.view.marked.size") == 0
    assert browser.evaluate("lab.view.links.every((link) => link.children.every(({material}) => "
                            "material.emissive.getHex() === 0))")


def test_without_servos_the_panel_says_what_starts_them(steered, browser):
    described = dict(steered.pages._shared["robot"], servos=[])
    described.pop("op")
    hold_a_key(steered, browser)
    steered.pages.share("robot", described)
    wait_for(steered.servos["left"], False)
    browser.wait("document.getElementById('steer-off').checkVisibility()")
    assert "baxter_servo.launch" in browser.evaluate("document.getElementById('steer-off').textContent")
    assert browser.evaluate("document.querySelector('%s').disabled" % UP)
    key(browser, "r", "keyUp")
