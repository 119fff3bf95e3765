# SPDX-License-Identifier: BSD-3-Clause
"""The lab's page in a real browser beside Baxter's lab, for the tests of this folder."""
import os
import unittest
from pathlib import Path

import cv2
import rospkg
import rospy
from baxter_core_msgs.msg import AssemblyState
from sensor_msgs.msg import JointState

from baxter_model import poses
from lab_testing.browser import Browser, why_not
from lab_testing.skipping import skip
from lab_testing.waiting import wait_for_message, wait_until
from lab_web.libraries import LibrariesError, fetched

SIDE = "left"
NEAR_RAD = 0.03


class Joints:
    """The newest joint states; ``time_s`` is their stamp."""

    def __init__(self):
        self.angles, self.time_s = {}, -1.0

    def listen(self):
        """Subscribe."""
        rospy.Subscriber("/robot/joint_states", JointState, self._keep, queue_size=1)

    def _keep(self, message):
        self.angles.update(zip(message.name, message.position, strict=True))
        self.time_s = message.header.stamp.to_sec()


JOINTS = Joints()


def angles():
    """{joint: [rad]} of now."""
    return dict(JOINTS.angles)


def away(pose):
    """How far the arm is from a pose: the largest angle [rad]."""
    now = angles()
    return max(abs(now[joint] - angle) for joint, angle in poses().angles(pose, SIDE).items())


def wait_for_rest():
    """Wait until the arm has not moved for 0.3 s of simulated time."""
    def rests():
        before, begin_s = angles(), JOINTS.time_s
        wait_until(lambda: JOINTS.time_s > begin_s + 0.3, "joint states", 60.0)
        now = angles()
        return max(abs(now[joint] - before[joint]) for joint in poses().angles("neutral", SIDE)) < 1e-3
    wait_until(rests, "an arm at rest", 60.0)


def wait_briefly(condition, timeout_s=1.0):
    """Whether the condition becomes true soon."""
    try:
        return wait_until(condition, timeout_s=timeout_s)
    except AssertionError:
        return False


def wait_for_state(**wanted):
    wait_for_message("/robot/state", AssemblyState,
                     lambda state: all(getattr(state, name) == value for name, value in wanted.items()))


class PageTest(unittest.TestCase):
    """A test with an open page, whose console must say no error."""

    @classmethod
    def setUpClass(cls):
        cls.reason = why_not()
        try:
            fetched(Path(rospkg.RosPack().get_path("lab_web")) / "page")
        except LibrariesError as error:
            cls.reason = cls.reason or str(error)
        if cls.reason:
            return
        JOINTS.listen()
        wait_for_message("/robot/state", AssemblyState)
        wait_until(lambda: SIDE + "_s0" in JOINTS.angles, "joint states", 60.0)
        wait_until(lambda: rospy.has_param("/lab_web/address"), "the page's address", 60.0)
        cls.address = rospy.get_param("/lab_web/address")
        cls.browser = Browser()

    @classmethod
    def tearDownClass(cls):
        if not cls.reason:
            cls.browser.close()

    def setUp(self):
        if self.reason:
            skip(self, self.reason)
        self.open("drive")

    def tearDown(self):
        if self.reason:
            return
        # How the page looked at the end, of a failed test too.
        self.keep(self.id().rsplit(".", 1)[-1])
        said = self.browser.errors[:10]
        # The next test's page begins as a new one. What a page says that is left while it loads is no error of it.
        self.browser.evaluate("localStorage.clear()")
        self.browser.call("Page.navigate", url="about:blank")
        self.browser.wait("location.href === 'about:blank'")
        self.browser.errors.clear()
        self.assertEqual(said, [])

    def open(self, token, width=1280, height=800):
        self.browser.resize(width, height)
        self.browser.call("Page.navigate", url="about:blank")
        self.browser.open(self.address + "?token=" + token)
        self.browser.wait("globalThis.lab?.state.connected && lab.state.robot")
        self.browser.wait("lab.view && lab.view.revision !== null && lab.view.pictures > 0")

    def keep(self, name):
        """Save a picture of the window beside the test's other results."""
        folder = os.environ.get("ROS_TEST_RESULTS_DIR")
        if folder:
            cv2.imwrite(str(Path(folder) / (name + ".png")), self.browser.picture()[:, :, ::-1])

    def take_control(self):
        self.browser.wait("!document.getElementById('control').disabled")
        self.browser.click("#control")
        self.browser.wait("lab.state.mine")

    def enable(self):
        if not self.browser.evaluate("lab.state.robot.enabled"):
            self.browser.wait("!document.getElementById('enable').disabled")
            self.browser.click("#enable")
        wait_for_state(enabled=True)
        self.browser.wait("lab.state.robot.enabled")

    def go_to(self, pose):
        """Press the pose's button; again where a busy machine was too slow for the heartbeat."""
        def arrived():
            if away(pose) < NEAR_RAD:
                return True
            before = away(pose)
            self.browser.click("#pose-" + pose)
            wait_until(lambda: away(pose) < NEAR_RAD or self.says_silent() or abs(away(pose) - before) > 0.05,
                       "a motion to " + pose, interval_s=0.1)
            wait_for_rest()
            return away(pose) < NEAR_RAD
        wait_until(arrived, lambda: "%s, %.2f rad away" % (pose, away(pose)), 90.0)

    def start_for(self, pose):
        """Press a pose's button and wait until the arm is under way."""
        before = away(pose)
        self.assertGreater(before, 0.5)

        def moves():
            if self.says_silent() or abs(away(pose) - before) < 0.01:
                self.browser.click("#pose-" + pose)
            return wait_briefly(lambda: before - away(pose) > 0.1)
        wait_until(moves, "a motion to " + pose, 60.0)

    def press_until(self, selector, condition):
        """Press an element until the condition is true: a busy machine may be too slow for the heartbeat."""
        def done():
            self.browser.wait("!document.querySelector('%s').disabled" % selector)
            self.browser.click(selector)
            return wait_briefly(condition, 5.0)
        wait_until(done, selector, 120.0)

    def drag_handle(self, name, across, down):
        """Drag a handle of the 3D view by pixels."""
        self.browser.evaluate("scrollTo(0, 0)")
        column, row = self.browser.evaluate("""(() => {
            const {camera, canvas, ghosts} = lab.view;
            const place = ghosts.get("%s").hand.getWorldPosition(camera.position.clone()).project(camera);
            const {left, top, width, height} = canvas.getBoundingClientRect();
            return [left + (place.x + 1) / 2 * width, top + (1 - place.y) / 2 * height];
        })()""" % name)
        self.browser.drag((column, row), (column + across, row + down))

    def check_hand_goes_to_its_ghost(self, side):
        """Press "Go" until the arm is where its ghost is."""
        self.browser.wait("(({asked, wanted}) => asked === null && !wanted)(lab.hands.hands.get('%s'))" % side)
        reaches, said, joints = self.browser.evaluate(
            "(({reaches, said, joints}) => [reaches, said.textContent, joints])(lab.hands.hands.get('%s'))" % side)
        self.assertTrue(reaches, said)

        def away():
            now = angles()
            return max(abs(now[name] - angle) for name, angle in joints.items())
        self.assertGreater(away(), NEAR_RAD)
        self.press_until("#reach-go", lambda: away() < NEAR_RAD)

    def says_silent(self):
        return self.browser.evaluate("document.getElementById('told').textContent.includes('in time')")
