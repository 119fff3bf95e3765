# SPDX-License-Identifier: BSD-3-Clause
"""The page without a mouse, in Debian's Chromium: the Tab key, Enter, and what a screen reader is told."""
import pytest

from lab_testing.waiting import wait_until

#: All controls that can be used now, numbered in the order of the page.
CONTROLS = """[...document.querySelectorAll("a[href], button, input, select, summary, [tabindex]")].filter((one) =>
    one.checkVisibility() && !one.disabled && one.tabIndex >= 0)"""
OF_NO_CONTROL = ("", "none", "generic", "paragraph", "StaticText")


def test_the_tab_key_comes_to_every_control_and_each_has_a_role_and_a_name(lab, browser):
    browser.evaluate("document.querySelectorAll('details').forEach((part) => { part.open = true; })")
    browser.click("#reach-left")
    browser.wait("lab.hands.hands.get('left').reaches && !document.getElementById('reach-go').disabled")
    browser.wait("document.querySelectorAll('#button-rows button').length > 0")
    count = browser.evaluate("(() => { const all = %s; all.forEach((one, number) => { one.dataset.number = number; });"
                             "all.at(-1).focus(); return all.length; })()" % CONTROLS)
    assert count > 50
    reached, unnamed, unseen = set(), [], []
    # After the last control the browser itself has the keyboard before the first one.
    for _ in range(count + 2):
        browser.press("Tab", "Tab")
        number, html, outline = browser.evaluate(
            "((one) => [one.dataset.number, one.outerHTML.slice(0, 150), getComputedStyle(one).outlineStyle])"
            "(document.activeElement)")
        if number is None:
            continue
        reached.add(int(number))
        role, name = browser.focused()
        if role in OF_NO_CONTROL or not name.strip():
            unnamed.append((html, role, name))
        if outline == "none":
            unseen.append(html)
    missed = [browser.evaluate("document.querySelector('[data-number=\"%d\"]').outerHTML.slice(0, 150)" % number)
              for number in sorted(set(range(count)) - reached)]
    assert not missed
    assert not unnamed
    assert not unseen


@pytest.mark.parametrize("width", [390, 1000])
def test_what_is_scrolled_to_is_not_behind_the_header(lab, browser, width):
    browser.resize(width, 400)
    browser.evaluate("document.querySelectorAll('details').forEach((part) => { part.open = true; })")
    behind = browser.evaluate("""[...document.querySelectorAll("main h2, main summary")]
        .filter((one) => one.checkVisibility()).filter((one) => {
            one.scrollIntoView();
            const {left, top} = one.getBoundingClientRect();
            return document.elementFromPoint(left + 1, top + 1)?.closest("h2, summary") !== one;
        }).map((one) => one.textContent)""")
    browser.resize(1000, 800)
    assert behind == []


def test_enter_switches_a_checkbox_and_the_space_bar_stops(lab, browser):
    browser.evaluate("document.getElementById('show-frames').focus()")
    for wanted in (True, False):
        browser.press("Enter", "Enter")
        browser.wait("document.getElementById('show-frames').checked === %s" % str(wanted).lower())
        wait_until(lambda wanted=wanted: any(one["frames"] is wanted for one in lab.watched.values()), "the server",
                   60.0)
    browser.press(" ", "Space")
    wait_until(lambda: lab.robot.stopped, "a stopped robot", 60.0)
    assert not browser.evaluate("document.getElementById('show-frames').checked")


def test_enter_presses_a_button(lab, browser):
    browser.evaluate("document.getElementById('control').focus()")
    browser.press("Enter", "Enter")
    browser.wait("!lab.state.mine")
