# SPDX-License-Identifier: BSD-3-Clause
"""The window's buttons on Qt's offscreen platform."""
import locale
import os

import pytest

from world_window.stage import WindowStage
from world_window.viewer import Frame

os.environ["QT_QPA_PLATFORM"] = "offscreen"  # before Qt is loaded
widgets = pytest.importorskip("PyQt5.QtWidgets", reason="./baxter.sh setup installs PyQt5")

BLOCK = ("block", "body")


class FakeViewer:
    """Does what is posted when the test says so, as the viewer's thread does it later."""

    def __init__(self):
        self.stage, self._posted = WindowStage(), []

    def post(self, function, *arguments):
        self._posted.append((function, arguments))

    def set_visible(self, visible):
        pass

    def work(self):
        while self._posted:
            function, arguments = self._posted.pop(0)
            function(self.stage, *arguments)


class FakeSimulator:
    """None of these tests asks it for anything."""

    def __getattr__(self, name):
        return lambda *arguments: None


@pytest.fixture(scope="module")
def application():
    before = locale.setlocale(locale.LC_ALL)
    yield widgets.QApplication.instance() or widgets.QApplication(["gazebo"])
    locale.setlocale(locale.LC_ALL, before)  # Qt takes the environment's for the whole process


@pytest.fixture
def window(application):
    from world_window.window import Window

    window = Window()
    window.viewer = FakeViewer()
    window.build(window.viewer, FakeSimulator())
    yield window
    window.close()


def show(window, selected, followed):
    window.frame(Frame(None, [], (1.0, False, 1.0), {}, selected, followed, 0.0))


def action(window, text):
    return next(action for action in window.actions() if action.text() == text)


@pytest.mark.parametrize("before, after", [(None, BLOCK), (BLOCK, None)])
def test_an_older_frame_does_not_undo_follow(window, before, after):
    window.viewer.work()
    window.viewer.stage.selected, window.viewer.stage.followed = BLOCK, before
    show(window, BLOCK, before)
    action(window, "Follow").trigger()
    show(window, BLOCK, before)  # drawn before the viewer has seen the click
    window.viewer.work()
    assert window.viewer.stage.followed == after
    show(window, BLOCK, after)
    assert action(window, "Follow").isChecked() == (after is not None)
    window.viewer.work()
    assert window.viewer.stage.followed == after


def test_escape_ends_pulls_and_selects_nothing(window):
    action(window, "Pull").trigger()
    window.viewer.work()
    assert window.viewer.stage.pulls_by_left
    window.viewer.stage.select(*BLOCK)
    action(window, "Stop").trigger()
    window.viewer.work()
    assert not window.viewer.stage.pulls_by_left and window.viewer.stage.selected is None
    assert not action(window, "Pull").isChecked()


@pytest.mark.parametrize("layer", ["Frames", "Contacts", "Names"])
def test_layers_are_shown_and_hidden(window, layer):
    for shown in (True, False):
        action(window, layer).trigger()
        window.viewer.work()
        assert window.viewer.stage.layers[layer.lower()] == shown
