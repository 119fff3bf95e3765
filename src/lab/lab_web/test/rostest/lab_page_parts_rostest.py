#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The parts of the real page beside Baxter's lab: hands, recordings, the robot's controls, the simulation."""
import math
import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np
import rospy
from baxter_core_msgs.msg import DigitalIOState
from gazebo_msgs.srv import GetModelState
from lab_window import NEAR_RAD, SIDE, PageTest, angles, away, wait_for_rest
from sensor_msgs.msg import Image

from lab_testing.waiting import wait_for_message, wait_until

THING = "red_block"
ORANGE = (255, 128, 0)


def place_of(model):
    """Where a model is in the world, x y z [m]; None where there is none."""
    found = rospy.ServiceProxy("/gazebo/get_model_state", GetModelState)(model, "world")
    point = found.pose.position
    return (point.x, point.y, point.z) if found.success else None


class LabPageParts(PageTest):
    def setUp(self):
        super().setUp()
        self.take_control()
        self.enable()
        self.go_to("untucked")

    def check_hand_goes(self, across, down):
        """Drag the hand, and press "Go"."""
        self.browser.click("#reach-" + SIDE)
        self.browser.wait("lab.view.ghosts.has('%s')" % SIDE)
        self.drag_handle(SIDE, across, down)
        self.check_hand_goes_to_its_ghost(SIDE)
        self.browser.click("#reach-" + SIDE)

    def test_a_hand_is_dragged_and_the_arm_goes_there(self):
        self.check_hand_goes(25, 15)

    def test_a_telephone_moves_a_hand(self):
        self.open("drive", 390, 844)
        self.browser.evaluate("document.querySelectorAll('details').forEach((part) => { part.open = true; })")
        self.take_control()
        self.check_hand_goes(12, 8)
        self.browser.wait("document.querySelectorAll('#output-list label').length > 3")
        self.assertLessEqual(self.browser.evaluate("document.documentElement.scrollWidth"), 390)

    def test_a_motion_is_recorded_and_played(self):
        self.press_until("#record", lambda: self.browser.evaluate(
            "document.getElementById('record').ariaPressed === 'true'"))
        self.go_to("neutral")
        after = angles()
        self.browser.click("#record")
        self.browser.wait("!document.getElementById('play').disabled")
        self.go_to("untucked")
        self.press_until("#play", lambda: max(
            abs(angles()[name] - after[name]) for name in after if name.startswith(SIDE + "_")) < NEAR_RAD)

    def test_a_cuff_is_squeezed_until_the_next_press(self):
        self.browser.evaluate("document.getElementById('buttons').open = true")
        name = SIDE + "_lower_cuff"
        for state in (1, 0):
            self.browser.click("#press-" + name)
            wait_for_message("/robot/digital_io/%s/state" % name, DigitalIOState,
                             lambda found, state=state: found.state == state)
            self.browser.wait("document.getElementById('press-%s').ariaPressed === '%s'"
                              % (name, ["false", "true"][state]))

    def test_a_picture_comes_to_the_screen_and_its_picture_to_the_page(self):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, "orange.png")
            cv2.imwrite(str(path), np.full((300, 512, 3), ORANGE[::-1], np.uint8))
            self.browser.evaluate("document.getElementById('screen').open = true")
            self.browser.wait("!document.getElementById('screen-send').disabled")
            self.browser.choose_file("#screen-file", path)

            def is_orange(image):
                rows = np.frombuffer(image.data, np.uint8).reshape(image.height, image.width, -1)
                middle = rows[image.height // 2, image.width // 2, :3].tolist()
                return middle == list(ORANGE if image.encoding.startswith("rgb") else ORANGE[::-1])
            wait_for_message("/robot/sim/screen", Image, is_orange)
        self.browser.wait("(({hidden, naturalWidth}) => !hidden && naturalWidth > 100)"
                          "(document.getElementById('screen-picture'))")

    def test_an_object_is_added_dragged_and_deleted(self):
        self.browser.evaluate("document.getElementById('things').value = '%s'" % THING)
        self.browser.click("#add")
        self.browser.wait("lab.simulation.names.includes('%s')" % THING)
        before = wait_until(lambda: place_of(THING), "the object")
        self.browser.evaluate("document.getElementById('objects').value = '%s'" % THING)
        self.browser.click("#grab")
        self.browser.wait("lab.view.ghosts.has('object')")
        self.drag_handle("object", 40, 0)
        wait_until(lambda: math.dist(place_of(THING)[:2], before[:2]) > 0.05, "the object elsewhere")
        # The same without a pointer.
        self.browser.evaluate("(() => { const input = document.getElementById('object-y'); input.value = -0.3;"
                              "input.dispatchEvent(new Event('change')); })()")
        wait_until(lambda: abs(place_of(THING)[1] + 0.3) < 0.05, "the object at the typed place")
        self.browser.click("#delete")
        wait_until(lambda: place_of(THING) is None, "the world without the object")
        self.browser.wait("!lab.simulation.names.includes('%s')" % THING)

    def test_an_arm_goes_on_while_the_interface_is_compared(self):
        self.browser.evaluate("document.getElementById('interface').open = true")

        def goes_on():
            """Whether one press of a pose's button was enough."""
            self.go_to("untucked")
            self.start_for("neutral")
            self.browser.click("#interface-compare")
            self.browser.wait("document.getElementById('interface-compare').disabled")
            wait_until(lambda: away("neutral") < NEAR_RAD or self.says_silent(), "neutral", 60.0)
            self.browser.wait("!document.getElementById('interface-compare').disabled")
            return away("neutral") < NEAR_RAD
        # A busy machine may be too slow for the heartbeat, once or twice.
        self.assertTrue(any(goes_on() for _ in range(3)))

    def test_the_simulation_is_paused_stepped_and_reset(self):
        def time_s():
            return rospy.get_time()
        self.browser.click("#pause")
        self.browser.wait("lab.simulation.paused")
        before = wait_until(lambda: time_s(), "a time")
        self.browser.click("#step")
        wait_until(lambda: time_s() > before, "one step")
        self.assertLess(time_s(), before + 0.05)
        self.browser.click("#pause")
        self.browser.wait("!lab.simulation.paused")
        wait_until(lambda: time_s() > before + 0.5, "time that goes on")
        self.browser.click("#reset")
        self.browser.wait("lab.state.robot && lab.view.revision !== null")
        wait_for_rest()


if __name__ == "__main__":
    import rostest
    rospy.init_node("lab_page_parts")
    rostest.rosrun("lab_web", "lab_page_parts", LabPageParts, sys.argv)
