#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The real page in a real browser beside Baxter's lab: what it shows, what its buttons do, what stops the arms."""
import math
import sys
import unittest
from pathlib import Path

import numpy as np
import rospkg
import rospy
import tf2_ros
from baxter_core_msgs.msg import AssemblyState
from sensor_msgs.msg import JointState

from baxter_model import poses
from lab_testing.browser import Browser, why_not
from lab_testing.skipping import skip
from lab_testing.waiting import wait_for_message, wait_until
from lab_web.libraries import LibrariesError, fetched

# Links whose frames lie inside of their shapes.
SEEN = ("left_lower_elbow", "right_lower_elbow", "left_lower_forearm", "right_lower_forearm", "left_wrist", "head")
SIDE = "left"
NEAR_RAD = 0.03


class Joints:
    """The newest joint states; ``time_s`` is their stamp."""

    def __init__(self):
        self.angles, self.time_s = {}, -1.0
        rospy.Subscriber("/robot/joint_states", JointState, self._keep, queue_size=1)

    def _keep(self, message):
        self.angles.update(zip(message.name, message.position, strict=True))
        self.time_s = message.header.stamp.to_sec()


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


def wait_briefly(condition):
    """Whether the condition becomes true within a second."""
    try:
        return wait_until(condition, timeout_s=1.0)
    except AssertionError:
        return False


def wait_for_state(**wanted):
    wait_for_message("/robot/state", AssemblyState,
                     lambda state: all(getattr(state, name) == value for name, value in wanted.items()))


class LabPage(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.reason = why_not()
        try:
            fetched(Path(rospkg.RosPack().get_path("lab_web")) / "page")
        except LibrariesError as error:
            cls.reason = cls.reason or str(error)
        if cls.reason:
            return
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
        self.browser.errors.clear()
        self.open("drive")

    def tearDown(self):
        if not self.reason:
            self.assertEqual(self.browser.errors, [])

    def open(self, token, width=1280, height=800):
        self.browser.resize(width, height)
        self.browser.call("Page.navigate", url="about:blank")
        self.browser.open(self.address + "?token=" + token)
        self.browser.wait("globalThis.lab?.state.connected && lab.state.robot")
        self.browser.wait("lab.view && lab.view.revision !== null && lab.view.pictures > 0")

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

    def says_silent(self):
        return self.browser.evaluate("document.getElementById('told').textContent.includes('in time')")

    def pixels_of(self, links):
        """{link: (column, row)} by tf and the page's camera, in the window."""
        view = self.browser.evaluate("""(() => {
            const {camera, controls, canvas} = lab.view;
            const {left, top, width, height} = canvas.getBoundingClientRect();
            return {eye: camera.position.toArray(), target: controls.target.toArray(), fov: camera.fov,
                    left, top, width, height};
        })()""")
        eye, ahead = np.array(view["eye"]), np.subtract(view["target"], view["eye"])
        ahead /= np.linalg.norm(ahead)
        right = np.cross(ahead, (0.0, 0.0, 1.0))
        right /= np.linalg.norm(right)
        up = np.cross(right, ahead)
        scale = view["height"] / 2.0 / math.tan(math.radians(view["fov"]) / 2.0)
        # The simulated world has its floor at 0, tf's world is the robot's base.
        base = self.browser.evaluate("(() => { const [r] = [lab.view.links.find((link) => link.children.length > 0)];"
                                     "return r.matrix.elements[14]; })()")
        found = {}
        for link in links:
            place = TF.lookup_transform("base", link, rospy.Time(), rospy.Duration(10.0)).transform.translation
            offset = np.array([place.x, place.y, place.z + base]) - eye
            depth = offset @ ahead
            found[link] = (round(view["left"] + view["width"] / 2.0 + scale * (offset @ right) / depth),
                           round(view["top"] + view["height"] / 2.0 - scale * (offset @ up) / depth))
        return found

    def robot_mask(self):
        """Where the robot is in the window: what its checkbox hides."""
        pictures = []
        for _ in range(2):
            # Pressing an element scrolls to it.
            self.browser.evaluate("scrollTo(0, 0)")
            before = self.browser.evaluate("lab.view.pictures")
            self.browser.evaluate("lab.view.draw()")
            self.browser.wait("lab.view.pictures > %d && !lab.view.planned" % before)
            pictures.append(self.browser.picture().astype(int))
            self.browser.click("#show-world")
        return np.abs(pictures[0] - pictures[1]).sum(axis=2) > 12

    def check_picture(self):
        mask = self.robot_mask()
        self.browser.evaluate("scrollTo(0, 0)")
        pixels = self.pixels_of(SEEN)
        for link, (column, row) in pixels.items():
            self.assertTrue(mask[row - 1:row + 2, column - 1:column + 2].all(), "%s at %s" % (link, (column, row)))
        return mask, pixels

    def test_the_robot_is_seen_where_tf_has_it_before_and_after_a_motion(self):
        self.take_control()
        self.enable()
        self.go_to("untucked")
        _, before = self.check_picture()
        self.go_to("neutral")
        mask, after = self.check_picture()
        self.assertGreater(math.dist(before["left_wrist"], after["left_wrist"]), 20.0)
        self.assertLess(mask.mean(), 0.5)

    def test_stop_in_mid_motion_by_the_space_bar_and_by_its_button(self):
        self.take_control()
        for press in (lambda: self.browser.press(" ", "Space"), lambda: self.browser.click("#stop")):
            self.enable()
            pose = max(("neutral", "untucked"), key=away)
            self.start_for(pose)
            press()
            wait_for_state(stopped=True, enabled=False)
            wait_for_rest()
            self.assertGreater(away(pose), 0.2)
            self.browser.wait("lab.state.robot.stopped && document.getElementById('told').textContent")
            self.enable()
            self.go_to(pose)

    def test_the_arm_stops_when_the_browser_hangs(self):
        self.take_control()
        self.enable()
        pose = max(("neutral", "untucked"), key=away)
        self.start_for(pose)
        self.browser.freeze()
        try:
            wait_for_rest()
            self.assertGreater(away(pose), 0.2)
        finally:
            self.browser.thaw()
        wait_for_state(enabled=True)

    def test_a_slider_moves_its_joint_and_keys_move_sliders(self):
        self.take_control()
        self.enable()
        wait_for_rest()
        before = angles()[SIDE + "_w2"]
        self.browser.evaluate("document.getElementById('joint-%s_w2').focus()" % SIDE)

        def moved():
            self.browser.press("ArrowLeft", "ArrowLeft")
            return angles()[SIDE + "_w2"] < before - 0.05
        wait_until(moved, "a joint that follows its slider", 60.0, interval_s=0.2)

    def test_the_view_token_watches_and_may_stop(self):
        self.open("look")
        self.assertTrue(self.browser.evaluate("document.getElementById('control').disabled"))
        self.assertTrue(self.browser.evaluate("document.getElementById('joint-left_s0').disabled"))
        self.browser.click("#stop")
        wait_for_state(stopped=True)

    def test_a_telephone_shows_everything_and_stop_stays_in_sight(self):
        for token in ("drive", "look"):
            self.open(token, 390, 844)
            for place in ("0", "document.body.scrollHeight"):
                self.browser.evaluate("scrollTo(0, %s)" % place)
                stop = self.browser.evaluate(
                    "(({left, top, right, bottom}) => [left, top, right, bottom])"
                    "(document.getElementById('stop').getBoundingClientRect())")
                self.assertTrue(0 <= stop[0] < stop[2] <= 390 and 0 <= stop[1] < stop[3] <= 844, stop)
            self.assertLessEqual(self.browser.evaluate("document.documentElement.scrollWidth"), 390)

    def test_both_languages_both_themes_and_a_camera(self):
        self.browser.evaluate("(() => { const list = document.getElementById('language'); list.value = 'zh';"
                              "return list.onchange(); })()")
        self.browser.wait("document.getElementById('stop').textContent === '停止'")
        grounds = []
        for theme in ("light", "dark"):
            self.browser.evaluate("(() => { const list = document.getElementById('theme'); list.value = '%s';"
                                  "list.onchange(); })()" % theme)
            grounds.append(self.browser.evaluate("getComputedStyle(document.body).backgroundColor"))
        self.assertNotEqual(*grounds)
        self.browser.evaluate("localStorage.clear()")
        self.browser.wait("document.querySelectorAll('#camera option').length > 1")
        self.browser.evaluate("(() => { const list = document.getElementById('camera'); list.selectedIndex = 1;"
                              "list.onchange(); })()")
        self.browser.wait("document.getElementById('picture').naturalWidth > 100")


if __name__ == "__main__":
    import rostest
    rospy.init_node("lab_page")
    JOINTS = Joints()
    TF = tf2_ros.Buffer()
    LISTENER = tf2_ros.TransformListener(TF)
    rostest.rosrun("lab_web", "lab_page", LabPage, sys.argv)
