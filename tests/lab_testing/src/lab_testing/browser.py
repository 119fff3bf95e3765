# SPDX-License-Identifier: BSD-3-Clause
"""Debian's Chromium without a screen, driven by its DevTools protocol; draws WebGL in software.

`python3 -m lab_testing.browser ADDRESS FILE.png [WIDTH HEIGHT]` writes a picture of the lab's page.
"""
import argparse
import base64
import contextlib
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import urllib.request
from pathlib import Path

import cv2
import numpy as np
import websocket

from lab_testing.waiting import stretched, wait_until

PROGRAM = "chromium"
_OPTIONS = ("--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--use-angle=swiftshader",
            "--enable-unsafe-swiftshader", "--remote-debugging-port=0", "--remote-allow-origins=*", "--no-first-run",
            "--disable-background-networking", "--disable-component-update", "--disable-extensions", "--disable-sync",
            "--hide-scrollbars", "--lang=en-US", "about:blank")
_START_S, _ANSWER_S = 60.0, 150.0
# What Chromium answers to a command for a page that is replaced meanwhile.
_LEFT = "Inspected target navigated"
# What the browser itself does with a key goes by its number and text.
_KEYS = {"Tab": {"windowsVirtualKeyCode": 9}, "Enter": {"windowsVirtualKeyCode": 13, "text": "\r"}}


def why_not():
    """Why there is no browser for tests on this machine, or ""."""
    return "" if shutil.which(PROGRAM) else "no %s (set-up installs it on Debian)" % PROGRAM


class PageLeft(AssertionError):
    """The page has been left before it answered."""


class Browser:
    """One window with one page. ``errors``: what its console has said of errors so far."""

    def __init__(self, width=1280, height=800):
        self._folder = tempfile.mkdtemp(prefix="lab_browser_")
        environment = {**os.environ, "LANGUAGE": "en", "HOME": self._folder, "TMPDIR": self._folder}
        self.process = subprocess.Popen([PROGRAM, "--user-data-dir=" + self._folder, *_OPTIONS], env=environment,
                                        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)
        self.errors = []
        self._number = 0
        try:
            self._socket = websocket.create_connection(self._page_address(), timeout=stretched(_ANSWER_S))
        except BaseException:
            self.close()
            raise
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(domain + ".enable")
        self.resize(width, height)

    def call(self, method, **parameters):
        """The result of a DevTools command. Raises AssertionError where it fails, and PageLeft."""
        self._number += 1
        self._socket.send(json.dumps({"id": self._number, "method": method, "params": parameters}))
        while True:
            frame = json.loads(self._socket.recv())
            if frame.get("id") == self._number:
                return _result(method, frame)
            self._note(frame)

    def evaluate(self, expression):
        """The value of a JavaScript expression, a promise's after it has come. Raises AssertionError for its error."""
        found = self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in found, "%s: %s" % (expression, found["exceptionDetails"])
        return found["result"].get("value")

    def wait(self, expression, timeout_s=60.0):
        """Wait until a JavaScript expression is true, also of a page that is just being opened; returns its value."""
        def value():
            with contextlib.suppress(PageLeft):
                return self.evaluate(expression)
            return None

        return wait_until(value, expression, timeout_s, interval_s=0.1)

    def open(self, address):
        """Load a page and wait until it is complete."""
        self.call("Page.navigate", url=address)
        self.wait("location.href !== 'about:blank' && document.readyState === 'complete'")

    def resize(self, width, height):
        """Size of the window [pixels]."""
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1,
                  mobile=width < 600)

    def click(self, selector):
        """Press the middle of an element with the mouse. Raises AssertionError where it is disabled or covered."""
        place = self.evaluate("""(() => {
            const element = document.querySelector(%s);
            if (!element || element.disabled) return null;
            element.scrollIntoView({block: "center"});
            const {left, top, width, height} = element.getBoundingClientRect();
            const [x, y] = [left + width / 2, top + height / 2];
            return element.contains(document.elementFromPoint(x, y)) ? {x, y} : null;
        })()""" % json.dumps(selector))
        assert place, "%s cannot be pressed" % selector
        for kind in ("mousePressed", "mouseReleased"):
            self.call("Input.dispatchMouseEvent", type=kind, button="left", clickCount=1, **place)

    def drag(self, begin, end, steps=10):
        """Drag with the mouse between two places (column, row) of the window."""
        (column, row), (to_column, to_row) = begin, end

        def mouse(kind, share, buttons):
            self.call("Input.dispatchMouseEvent", type=kind, button="left", buttons=buttons, clickCount=1,
                      x=column + share * (to_column - column), y=row + share * (to_row - row))
        mouse("mouseMoved", 0.0, 0)
        mouse("mousePressed", 0.0, 1)
        for step in range(1, steps + 1):
            mouse("mouseMoved", step / steps, 1)
        mouse("mouseReleased", 1.0, 0)

    def choose_file(self, selector, path):
        """Choose a file in an input of type file."""
        root = self.call("DOM.getDocument")["root"]["nodeId"]
        node = self.call("DOM.querySelector", nodeId=root, selector=selector)["nodeId"]
        self.call("DOM.setFileInputFiles", files=[str(path)], nodeId=node)

    def press(self, key, code):
        """Press a key, such as (" ", "Space")."""
        more = _KEYS.get(key, {})
        for kind in ("keyDown", "keyUp"):
            self.call("Input.dispatchKeyEvent", type=kind, key=key, code=code, **more)

    def focused(self):
        """(role, name) of the element that has the keyboard, as a screen reader is told them."""
        found = self.call("Runtime.evaluate", expression="document.activeElement")["result"]["objectId"]
        node = self.call("Accessibility.getPartialAXTree", objectId=found, fetchRelatives=False)["nodes"][0]
        return tuple(node.get(what, {}).get("value", "") for what in ("role", "name"))

    def picture(self):
        """The window's picture, uint8 (height, width, 3), red first."""
        # What has been drawn is on the screen one picture later.
        self.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
        png = base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"])
        return cv2.cvtColor(cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR), cv2.COLOR_BGR2RGB)

    def freeze(self):
        """Stop all processes of the browser, as a machine that hangs; ``thaw`` lets them go on."""
        os.killpg(self.process.pid, signal.SIGSTOP)

    def thaw(self):
        """Let the processes go on."""
        os.killpg(self.process.pid, signal.SIGCONT)

    def close(self):
        """End the browser and remove its files."""
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()
        # Its last children may still write.
        shutil.rmtree(self._folder, ignore_errors=True)

    def _page_address(self):
        port = Path(self._folder, "DevToolsActivePort")

        def lines():
            assert self.process.poll() is None, "%s ended with %s" % (PROGRAM, self.process.returncode)
            return port.exists() and port.read_text().split()
        found = wait_until(lines, "%s's port" % PROGRAM, _START_S)
        with urllib.request.urlopen("http://127.0.0.1:%s/json" % found[0], timeout=stretched(_ANSWER_S)) as answer:
            return next(page for page in json.load(answer) if page["type"] == "page")["webSocketDebuggerUrl"]

    def _note(self, frame):
        said = frame.get("params", {})
        if frame.get("method") == "Page.javascriptDialogOpening":
            # Nothing goes on before the answer: a page with unsaved changes asks whether it may be left.
            self._number += 1
            self._socket.send(json.dumps({"id": self._number, "method": "Page.handleJavaScriptDialog",
                                          "params": {"accept": True}}))
        elif frame.get("method") == "Runtime.exceptionThrown":
            details = said["exceptionDetails"]
            self.errors.append(details.get("exception", {}).get("description") or details["text"])
        elif frame.get("method") == "Runtime.consoleAPICalled" and said["type"] in ("error", "assert"):
            self.errors.append(" ".join(str(part.get("value", part.get("description"))) for part in said["args"]))
        elif frame.get("method") == "Log.entryAdded" and said["entry"]["level"] == "error":
            self.errors.append("%s %s" % (said["entry"]["text"], said["entry"].get("url", "")))


def _result(method, frame):
    """The result in the answer to a DevTools command. Raises AssertionError, PageLeft."""
    error = frame.get("error")
    if error is not None and _LEFT in error.get("message", ""):
        raise PageLeft("%s: %s" % (method, error))
    assert error is None, "%s: %s" % (method, error)
    return frame["result"]


def write_picture(address, path, width, height):
    """Write a picture of the lab's page to ``path``, after the robot has appeared."""
    browser = Browser(width, height)
    try:
        browser.open(address)
        browser.wait("globalThis.lab?.view && lab.view.revision !== null && lab.view.pictures > 0 && !lab.view.planned")
        if browser.evaluate("document.querySelectorAll('#camera option').length > 1"):
            browser.evaluate("""(() => {
                const list = document.getElementById("camera");
                const hand = [...list.options].find((option) => option.value.includes("hand"));
                list.value = (hand ?? list.options[1]).value;
                list.onchange();
            })()""")
            browser.wait("!document.getElementById('picture').hidden")
        cv2.imwrite(str(path), cv2.cvtColor(browser.picture(), cv2.COLOR_RGB2BGR), [cv2.IMWRITE_PNG_COMPRESSION, 9])
    finally:
        browser.close()


def main():
    """Returns the exit code."""
    parser = argparse.ArgumentParser(prog="python3 -m lab_testing.browser", description=__doc__)
    parser.add_argument("address", help="the address that ./baxter.sh web printed")
    parser.add_argument("file", help="the PNG to write")
    parser.add_argument("size", nargs="*", type=int, default=[1280, 800], help="width and height [pixels]")
    options = parser.parse_args()
    write_picture(options.address, options.file, *options.size)
    return 0


if __name__ == "__main__":
    sys.exit(main())
