# SPDX-License-Identifier: BSD-3-Clause
"""Curves, numbers, points and frames of topics, on the page in Debian's Chromium."""
import base64

import cv2
import numpy as np
from page_server import CAMERA, NUMBERS

from lab_testing.waiting import wait_until
from lab_web.clouds import packed

IS_DRAWN = """(() => {
    const canvas = document.getElementById("%s");
    const data = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
    return data.some((value, number) => number %% 4 === 3 && value > 0) && canvas.width > 100;
})()"""


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


def test_a_camera_that_sends_nothing_yet_is_awaited_in_words(lab, browser):
    def choose(topic):
        browser.evaluate("(() => { const list = document.getElementById('camera'); list.value = '%s';"
                         "list.onchange(); })()" % topic)
    said = "document.getElementById('picture-said').textContent"
    choose(CAMERA)
    assert browser.evaluate(said) == "No picture has come yet …"
    browser.wait(said + ".includes('processor time')")
    lab.pages.share("simulation", {"paused": True})
    browser.wait(said + ".includes('paused')")
    lab.pages.share("simulation", {"paused": False})
    lab.camera = base64.b64encode(cv2.imencode(".png", np.zeros((20, 30, 3), np.uint8))[1]).decode()
    browser.wait("document.getElementById('picture').naturalWidth === 30 && !%s" % said)
    lab.camera = ""
    choose("")
    assert browser.evaluate("document.getElementById('picture').hidden") and not browser.evaluate(said)


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
