# SPDX-License-Identifier: BSD-3-Clause
"""The instructor's page in Debian's Chromium, on a front door whose class the test makes up."""
import asyncio
import threading
from pathlib import Path

import pytest
from tornado.httpserver import HTTPServer
from tornado.netutil import bind_sockets

from lab_class import front_door
from lab_class.labs import ClassError
from lab_class.store import ClassOptions, ClassRecord
from lab_testing.browser import Browser, why_not
from lab_testing.waiting import wait_until
from rf_checks import roster

PAGE = Path(__file__).resolve().parents[2] / "page"


def lab(name, state="running", **values):
    return {"name": name, "full_name": name.title() + " of a long family name", "state": state, "is_starting": False,
            "reason": "", "since_s": 1.0, "unused_s": 61.0, "pages": 1, "factor": 0.997, "memory_bytes": 700 << 20,
            "disk_bytes": 42 << 20, "token": "a", "view_token": "v", "verdicts": {}, **values}


class Class:
    """The supervisor's part: shows ``labs``, refuses whatever is asked of ben's lab."""

    def __init__(self):
        self.labs = [lab("anna", verdicts={"wave": {"points": 80.0, "passed": True}}),
                     lab("ben", "paused", factor=None)]
        self.asked, self.shown = [], 0

    def overview(self):
        self.shown += 1
        return {"labs": self.labs}

    def change(self, name, verb):
        if name == "ben":
            raise ClassError("ben's lab cannot")
        self.asked.append((name, verb))
        self.labs[0] = lab("anna", "stopped", factor=None, reason="by hand")


@pytest.fixture
def shown():
    """(browser, Class), with the page open."""
    if reason := why_not():
        pytest.skip(reason)
    supervisor = Class()
    record = ClassRecord.made(ClassOptions(), [roster.Student("anna", "Anna"), roster.Student("ben", "Ben")])
    sockets, loop = bind_sockets(0, "127.0.0.1"), asyncio.new_event_loop()

    async def serve():
        server = HTTPServer(front_door.application(front_door.FrontDoor(record, supervisor), PAGE))
        server.add_sockets(sockets)
        return server

    thread = threading.Thread(target=loop.run_forever)
    thread.start()
    server = asyncio.run_coroutine_threadsafe(serve(), loop).result()
    browser = Browser(1280, 800)
    browser.open("http://127.0.0.1:%d/instructor/?token=%s" % (sockets[0].getsockname()[1], record.instructor))
    browser.wait("document.querySelectorAll('#labs tr').length == 2")
    yield browser, supervisor
    browser.close()
    loop.call_soon_threadsafe(server.stop)
    loop.call_soon_threadsafe(loop.stop)
    thread.join()


def after_refresh(supervisor):
    before = supervisor.shown
    wait_until(lambda: supervisor.shown > before + 1, "the page to ask twice more", 60.0)


def test_a_class_is_shown_and_changed(shown):
    browser, supervisor = shown
    text = browser.evaluate("document.querySelector('#labs tr').innerText")
    assert all(words in text for words in ("Anna of a long", "running", "1.00", "700 MB", "42 MB", "1 min", "wave 80"))
    browser.evaluate("{window.button = document.querySelectorAll('#labs tr:first-child button')[1]; button.focus()}")
    supervisor.labs[0] = lab("anna", factor=0.5)
    browser.wait("document.querySelector('#labs tr').innerText.includes('0.50')")
    # The pointer may be down on it, or the focus in it, while the page shows something new.
    assert browser.evaluate("document.activeElement === button && button.isConnected")
    browser.evaluate("button.click()")
    browser.wait("document.querySelector('#labs tr').dataset.state === 'stopped'")
    assert supervisor.asked == [("anna", "stop")]
    assert browser.errors == []


def test_a_row_is_as_high_as_its_text_and_the_first_line_counts_labs_that_need_help(shown):
    browser, supervisor = shown
    supervisor.labs += [lab("cleo", "failed", factor=None, pages=0, reason="its files have 1.07 GB"),
                        lab("dora", "failed", factor=None, pages=0), lab("emil", "waiting", factor=None, pages=0)]
    browser.wait("document.getElementById('told').textContent === '2 of 5 have a page open, 2 failed, 1 waiting'")
    tops = browser.evaluate("[...document.querySelectorAll('#labs tr')].map((row) => "
                            "[...row.querySelectorAll('a, button')].map((one) => one.getBoundingClientRect().bottom))")
    assert all(max(row) - min(row) < 10 for row in tops) and [len(row) for row in tops] == [3, 3, 2, 2, 2]
    assert browser.evaluate("document.documentElement.scrollWidth") == 1280


def test_a_refusal_stays_until_the_next_success(shown):
    browser, supervisor = shown
    browser.evaluate("document.querySelectorAll('#labs tr')[1].querySelector('button').click()")
    browser.wait("document.body.innerText.includes(\"ben's lab cannot\")")
    after_refresh(supervisor)
    assert browser.evaluate("document.body.innerText.includes(\"ben's lab cannot\")")
    browser.evaluate("document.querySelector('#labs tr button').click()")
    browser.wait("!document.body.innerText.includes(\"ben's lab cannot\")")


def test_a_telephone_shows_it_whole(shown):
    browser, _ = shown
    browser.resize(390, 844)
    browser.wait("innerWidth === 390")
    assert browser.evaluate("document.documentElement.scrollWidth") == 390
    assert browser.evaluate("document.querySelectorAll('#labs td')[4].innerText + "
                            "getComputedStyle(document.querySelectorAll('#labs td')[4], '::before').content"
                            ) == '700 MB"Memory "'
    places = browser.evaluate("[...document.querySelectorAll('#labs button')].map((one) => "
                              "one.getBoundingClientRect()).map(({left, right}) => [left, right])")
    assert len(places) == 4 and all(0 <= left < right <= 390 for left, right in places)
