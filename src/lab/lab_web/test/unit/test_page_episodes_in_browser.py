# SPDX-License-Identifier: BSD-3-Clause
"""Demonstrations on the page, in Debian's Chromium: recorded, marked, listed with strips, deleted, fetched."""
import numpy as np
from page_server import click_until

from demonstrations.frames import ACTION, PICTURES, Schema, numbers, picture
from demonstrations.writing import SetWriter
from lab_testing.waiting import wait_until

SCHEMA = Schema(10, {ACTION: numbers([("a", "")]), PICTURES + "head": picture(96, 160)}, about={"task": "on the robot"})
ROWS = "[...document.querySelectorAll('#episode-list li')]"


def write(folder):
    """Two episodes of 2 s in which a white square goes from left to right."""
    with SetWriter(folder, SCHEMA) as writer:
        for number in range(2):
            for frame in range(20):
                pixels = np.full((96, 160, 3), (40, 70 + 90 * number, 120), np.uint8)
                pixels[30:60, 6 * frame:6 * frame + 30] = 255
                writer.frame({ACTION: [0.0], PICTURES + "head": pixels})
            writer.keep("Pick up the block.", number == 0)


def test_episodes_are_recorded_listed_deleted_and_fetched(lab, browser):
    recorder = lab.episode_recorder
    browser.evaluate("document.getElementById('episodes-open').open = true")
    browser.wait("document.getElementById('episode-success').disabled")
    browser.evaluate("document.getElementById('episode-camera').value = 'head'")
    click_until(browser, "#episode-record", lambda: recorder.asked)
    assert recorder.asked == [("Pick up the block.", "head")]
    browser.wait("document.getElementById('episode-record').getAttribute('aria-pressed') === 'true'")
    assert browser.evaluate("document.getElementById('episode-success').disabled")  # the recorder starts
    recorder.said("an episode of 3 frames is dropped: no news of head")
    browser.wait("document.getElementById('episode-said').classList.contains('bad')")
    recorder.said("recording into set, which has 0 episodes")
    browser.wait("!document.getElementById('episode-success').disabled")
    assert not browser.evaluate("document.getElementById('episode-said').classList.contains('bad')")
    click_until(browser, "#episode-success", lambda: lab.marks)
    assert set(lab.marks) == {"success"}
    write(lab.episodes.folder)
    recorder.said("episode 1 is kept as a failure: 20 frames")
    browser.wait("document.getElementById('episode-said').textContent.includes('is kept')")
    assert browser.wait(ROWS + ".length === 2 && %s.map((row) => row.children[0].textContent)" % ROWS) == [
        "1: Failure", "0: Success"]
    assert browser.evaluate(ROWS + "[0].children[1].textContent") == "2.0 s"
    browser.evaluate("document.getElementById('episode-list').scrollIntoView()")
    assert browser.wait("(%s.every((row) => row.querySelector('img').naturalWidth > 0)"
                        "&& %s[0].querySelector('img').naturalWidth)" % (ROWS, ROWS)) == 6 * 80
    assert browser.evaluate("document.querySelector('#episode-list button').disabled")  # while it records
    click_until(browser, "#episode-record", lambda: not lab.episodes._recorder)
    browser.wait("!document.querySelector('#episode-list button').disabled")
    assert browser.evaluate("document.getElementById('episode-camera').disabled")  # it is the set's
    size = browser.evaluate(
        "fetch(document.getElementById('episodes-save').href).then((answer) => answer.arrayBuffer())"
        ".then((data) => new TextDecoder().decode(data.slice(0, 2)) + data.byteLength)")
    assert size.startswith("PK") and int(size[2:]) > 5000
    browser.evaluate("document.querySelector('#episode-list button').click()")
    browser.wait("document.querySelector('#episode-list button').textContent === 'Really delete?'")
    browser.evaluate("lab.episodes.refresh()")  # as with every news of the robot
    assert browser.evaluate("document.querySelector('#episode-list button').textContent") == "Really delete?"
    assert browser.evaluate(ROWS + ".length") == 2
    browser.evaluate("document.querySelector('#episode-list button').click()")
    browser.wait(ROWS + ".length === 1 && %s[0].children[0].textContent === '0: Success'" % ROWS)
    wait_until(lambda: len(list(lab.episodes.folder.glob("videos/*/*/*.mp4"))) == 1, "one film")
