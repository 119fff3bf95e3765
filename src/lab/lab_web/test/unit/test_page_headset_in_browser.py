# SPDX-License-Identifier: BSD-3-Clause
"""Hands led by a headset's controllers, in Chromium with WebXR's emulator from npm, unmodified."""
import contextlib

import pytest

from lab_testing import web_clients
from lab_testing.waiting import wait_until
from lab_web.steering import FRESH_S

GRIP = "device.controllers.%s.updateButtonValue('%s', %d)"
# The longest time between two of some frames [ms].
LONGEST_FRAME_MS = """new Promise((done) => {
  const times = [];
  const next = () => {
    times.push(performance.now());
    if (times.length < 20) lab.headset.session.requestAnimationFrame(next);
    else done(Math.max(...times.slice(1).map((time, number) => time - times[number])));
  };
  next();
})"""


@pytest.fixture
def worn(lab, browser):
    """The lab, its page in an emulated headset: the user looks along -z, both controllers are in front."""
    try:
        emulator = web_clients.of_npm() / "node_modules/iwer/build/iwer.min.js"
    except web_clients.NotThere as error:
        pytest.skip(str(error))
    browser.evaluate("document.getElementById('steering-open').open = true")
    browser.evaluate(emulator.read_text() + "; globalThis.device = new IWER.XRDevice(IWER.metaQuest3); "
                     "device.installRuntime({forceInstall: true}); lab.headset.look(); 1")
    browser.wait("document.getElementById('steer-headset').checkVisibility()")
    browser.wait("!document.getElementById('steer-headset').disabled")
    for side, x in (("left", -0.2), ("right", 0.2)):
        browser.evaluate("device.controllers.%s.position.set(%g, 1.3, -0.4)" % (side, x))
    browser.click("#steer-headset")
    browser.wait("lab.headset.session?.inputSources.length === 2 && lab.view.renderer.xr.isPresenting")
    yield lab
    browser.evaluate("lab.headset.session?.end()")
    browser.wait("lab.headset.session === null && !lab.view.renderer.xr.isPresenting")


def wait_until_led(browser, condition, what):
    """Wait for something that a led hand does; skip where who wears the headset could not lead one either, because a
    hand stops at each frame that takes too long."""
    try:
        wait_until(condition, what, 90.0)
    except AssertionError:
        longest_s = 1e-3 * browser.evaluate(LONGEST_FRAME_MS)
        if longest_s < FRESH_S:
            raise
        pytest.skip("a headset's pictures take up to %.1f s here; a hand needs one every %g s" % (longest_s, FRESH_S))


def press(browser, side, button, is_down=True):
    browser.evaluate(GRIP % (side, button, is_down))


def grip(browser, side):
    """Grip again, where the controller is; whether the page leads the hand: a busy machine may be too slow for it."""
    press(browser, side, "squeeze", False)
    browser.wait("lab.headset.grips.size === 0")
    press(browser, side, "squeeze")
    browser.wait("lab.headset.grips.size === 1")
    return browser.evaluate("lab.steering.led.has('%s')" % side)


def lead(lab, browser, side, by, twist):
    """Grip, and move the controller as the script ``by`` says, until the hand is steered by ``twist``."""
    sent, controller = lab.servos[side].sent, "device.controllers." + side

    def follows():
        browser.evaluate(controller + ".quaternion.set(0, 0, 0, 1)")
        if not grip(browser, side):
            return False
        browser.evaluate(controller + by)
        with contextlib.suppress(AssertionError):
            return wait_until(lambda: sent and sent[-1] == (pytest.approx(twist, abs=0.03), False), timeout_s=3.0)
        return False
    wait_until_led(browser, follows, lambda: "%s after %s" % (twist, sent[-1:]))


@pytest.mark.parametrize("side", ["left", "right"])
def test_a_gripped_controller_leads_its_hand(worn, browser, side):
    servo, other = worn.servos[side], worn.servos[{"left": "right", "right": "left"}[side]]
    # 2 cm away from the user, of a hand that does not come after.
    lead(worn, browser, side, ".position.z -= 0.02", [0.6, 0, 0, 0, 0, 0])
    lead(worn, browser, side, ".position.x -= 0.02", [0, 0.6, 0, 0, 0, 0])
    lead(worn, browser, side, ".position.y += 0.01", [0, 0, 0.3, 0, 0, 0])
    press(browser, side, "squeeze", False)
    wait_until(lambda: not servo.moves, "a hand that rests", 60.0)
    assert not other.moves
    count = len(servo.sent)
    browser.evaluate("device.controllers.%s.position.z -= 0.3" % side)
    browser.wait("!lab.steering.isMoving")
    assert len(servo.sent) == count


def test_a_turn_of_the_controller_turns_the_hand(worn, browser):
    servo = worn.servos["left"]

    def turns():
        browser.evaluate("device.controllers.left.quaternion.set(0, 0, 0, 1)")
        if not grip(browser, "left"):
            return False
        browser.evaluate("device.controllers.left.quaternion.set(0, Math.sin(0.02), 0, Math.cos(0.02))")
        with contextlib.suppress(AssertionError):
            # The emulated grip is not where the controller turns, so that it shifts a little, too.
            return wait_until(lambda: servo.moves and servo.sent[-1][0][3:] == pytest.approx([0, 0, 0.4], abs=0.03),
                              timeout_s=3.0)
        return False
    wait_until_led(browser, turns, lambda: "a hand that turns after %s" % servo.sent[-1:])


def test_a_grip_that_is_taken_from_outside_must_be_gripped_again(worn, browser):
    right = worn.servos["right"]
    lead(worn, browser, "right", ".position.x -= 0.01", [0, 0.3, 0, 0, 0, 0])
    browser.evaluate("dispatchEvent(new Event('blur'))")
    wait_until(lambda: not right.moves, "a hand that rests", 60.0)
    browser.evaluate("device.controllers.right.position.x -= 0.01")
    ticks = worn.ticks
    wait_until(lambda: worn.ticks > ticks + 20, "frames", 60.0)
    assert not right.moves
    lead(worn, browser, "right", ".position.x -= 0.01", [0, 0.3, 0, 0, 0, 0])
    browser.evaluate("lab.headset.session.end()")
    wait_until(lambda: not right.moves, "a hand that rests", 60.0)


def test_triggers_and_buttons(worn, browser):
    for _ in range(2):
        press(browser, "left", "trigger")
        browser.wait("lab.headset.down.get('left 0')?.was")
        press(browser, "left", "trigger", False)
        browser.wait("!lab.headset.down.get('left 0').was")
    press(browser, "right", "b-button")
    wait_until(lambda: worn.marks == ["failure"], "a mark", 60.0)
    assert worn.robot.gripped == [("left", "close"), ("left", "open")]
