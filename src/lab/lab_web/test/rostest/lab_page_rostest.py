#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The real page in a real browser beside Baxter's lab: what it shows, what its buttons do, what stops the arms."""
import math
import sys

import numpy as np
import rospy
import tf2_ros
from lab_window import SIDE, PageTest, angles, away, wait_for_rest, wait_for_state

from lab_testing.waiting import wait_until

# Links whose frames lie inside of their shapes.
SEEN = ("left_lower_elbow", "right_lower_elbow", "left_lower_forearm", "right_lower_forearm", "left_wrist", "head")


class LabPage(PageTest):
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
    TF = tf2_ros.Buffer()
    LISTENER = tf2_ros.TransformListener(TF)
    rostest.rosrun("lab_web", "lab_page", LabPage, sys.argv)
