# SPDX-License-Identifier: BSD-3-Clause
"""A notebook beside the robot, on the page in Debian's Chromium."""
import pytest

from lab_testing.waiting import wait_until

FRAME = "document.getElementById('notebook-frame')"
BOX = ("(({left, right, top, bottom}) => [left, right, top, bottom])"
       "(document.querySelector('%s').getBoundingClientRect())")


def share_notebook(lab, state, number="", why=""):
    lab.pages.share("notebook", {"state": state, "why": why, "number": number, "files": ["src/1_first_steps.ipynb"]})


@pytest.fixture
def notebook(lab, browser):
    """A page with an open notebook; its server."""
    assert browser.evaluate("document.getElementById('notebook-toggle').hidden")
    share_notebook(lab, "off")
    browser.wait("!document.getElementById('notebook-toggle').hidden")
    browser.click("#notebook-toggle")
    wait_until(lambda: lab.notebook_asks, "a page that asks for the notebook")
    share_notebook(lab, "starting")
    browser.wait("document.getElementById('notebook-said').textContent.includes('starting')")
    share_notebook(lab, "running", "1")
    browser.wait(FRAME + ".contentDocument?.body?.textContent === 'jupyter of drive'")
    yield lab
    browser.evaluate("localStorage.clear()")
    browser.resize(1000, 800)


def test_the_notebook_is_beside_the_robot_and_keys_and_the_pointer_divide_the_width(notebook, browser):
    def share():
        return int(browser.evaluate("document.getElementById('split').getAttribute('aria-valuenow')"))
    browser.evaluate("document.getElementById('split').focus()")
    for key, after in (("Home", 20), ("ArrowRight", 25), ("End", 80), ("ArrowLeft", 75)):
        browser.press(key, key)
        assert share() == after
        _, right, _, _ = browser.evaluate(BOX % "#notebook-frame")
        left, end, _, _ = browser.evaluate(BOX % "#view")
        assert 0 < right < left < end <= 1000 and abs(right - 10 * after) < 30
    left, right, top, bottom = browser.evaluate(BOX % "#split")
    browser.drag(((left + right) / 2, (top + bottom) / 2), (400, 300))
    assert abs(share() - 40) <= 1
    browser.evaluate("scrollTo(0, document.body.scrollHeight)")
    _, _, top, bottom = browser.evaluate(BOX % "#notebook-frame")
    assert 0 < top < bottom <= 800  # it stays while the panels scroll


@pytest.mark.parametrize("width", [1000, 390])
def test_what_is_said_in_place_of_the_view_is_not_over_the_notebook(notebook, browser, width):
    browser.resize(width, 800)
    browser.evaluate("Object.assign(document.getElementById('view-note'), {textContent: 'no view', hidden: false})")
    note, view = (browser.evaluate(BOX % selector) for selector in ("#view-note", "#view"))
    browser.evaluate("document.getElementById('view-note').hidden = true")
    assert view[0] <= note[0] < note[1] <= view[1] and view[2] < note[2] < note[3] < view[3], (note, view)


def test_a_notebook_is_chosen_and_a_new_server_is_loaded_again(notebook, browser):
    # With JupyterLab's list of files beside it only where there is room for both.
    for width, mode in ((1920, "lab"), (1000, "doc")):
        browser.resize(width, 800)
        browser.evaluate("(() => { const list = document.getElementById('notebook-file'); list.selectedIndex = 1;"
                         "list.onchange(); })()")
        browser.wait(FRAME + ".contentWindow.location.pathname === '/notebook/%s/tree/src/1_first_steps.ipynb'" % mode)
    browser.evaluate(FRAME + ".contentWindow.old = true")
    share_notebook(notebook, "running", "1")
    share_notebook(notebook, "failed", why="no space")
    browser.wait("document.getElementById('notebook-said').textContent.startsWith('No notebook: no space.')")
    assert browser.evaluate(FRAME + ".contentWindow.old")
    before = len(notebook.notebook_asks)
    for is_open in (False, True):
        browser.click("#notebook-toggle")
        assert browser.evaluate("document.getElementById('notebook').hidden") is not is_open
    wait_until(lambda: len(notebook.notebook_asks) == before + 1, "another try")
    share_notebook(notebook, "running", "2")
    browser.wait("!%s.contentWindow.old" % FRAME)


def test_the_notebook_is_above_the_robot_on_a_telephone(notebook, browser):
    browser.resize(390, 844)
    assert browser.evaluate("document.documentElement.scrollWidth") <= 390
    _, _, _, bottom = browser.evaluate(BOX % "#notebook")
    _, _, top, _ = browser.evaluate(BOX % "#view")
    assert bottom < top
    left, right, top, bottom = browser.evaluate(BOX % "#stop")
    assert 0 <= left < right <= 390 and 0 <= top < bottom <= 844


def test_the_list_of_files_is_closed_where_it_leaves_no_room_unless_it_was_chosen(notebook, browser):
    def choose(number):
        browser.evaluate(FRAME + ".contentWindow.old = true")
        browser.evaluate("(() => { const list = document.getElementById('notebook-file'); list.selectedIndex = %d;"
                         "list.onchange(); })()" % number)
        browser.wait("!%s.contentWindow.old && %s.contentWindow.jupyterapp" % (FRAME, FRAME))
    browser.resize(844, 390)
    choose(1)
    browser.wait(FRAME + ".contentWindow.closed_list")
    choose(0)
    browser.evaluate("lab.notebook.closeList()")
    assert not browser.evaluate(FRAME + ".contentWindow.closed_list")
    browser.resize(1920, 800)
    choose(1)
    browser.evaluate("lab.notebook.closeList()")
    assert not browser.evaluate(FRAME + ".contentWindow.closed_list")
    left, right, top, bottom = browser.evaluate(BOX % "#stop")
    assert 0 <= left < right <= 1920 and 0 <= top < bottom <= 800


def test_a_page_that_only_watches_has_no_notebook(lab, browser):
    share_notebook(lab, "running", "1")
    browser.open(lab.address + "look")
    browser.wait("globalThis.lab?.state.connected && lab.notebook.state")
    assert browser.evaluate("document.getElementById('notebook-toggle').hidden && !%s.src" % FRAME)
