# SPDX-License-Identifier: BSD-3-Clause
"""The graph and the window on Qt's offscreen platform: curves are drawn, topics come late, curves are removed."""
import locale
import os

import numpy as np
import pytest

from live_plot.fields import PlotError, UnknownTopic
from live_plot.recording import PlotRecording

os.environ["QT_QPA_PLATFORM"] = "offscreen"  # before Qt is loaded
pyqtgraph = pytest.importorskip("pyqtgraph", reason="./baxter.sh setup installs pyqtgraph")


@pytest.fixture(scope="module")
def application():
    before = locale.setlocale(locale.LC_ALL)
    yield pyqtgraph.mkQApp()
    locale.setlocale(locale.LC_ALL, before)  # Qt takes the environment's for the whole process


@pytest.fixture
def recording():
    recording = PlotRecording()
    times = np.linspace(100.0, 105.0, 200)
    for number in range(6):
        label = "/t/position[%d]" % number
        recording.add(label)
        for time_s in times:
            recording.append(label, time_s, number + np.sin(time_s))
    return recording


def pixels(widget, application):
    """(height, width, 3): what the widget looks like, red first."""
    widget.show()
    application.processEvents()
    image = widget.grab().toImage().convertToFormat(pyqtgraph.QtGui.QImage.Format.Format_RGB32)
    data = image.constBits().asstring(image.sizeInBytes())
    rows = np.frombuffer(data, np.uint8).reshape(image.height(), image.bytesPerLine() // 4, 4)
    return rows[:, :image.width(), 2::-1].astype(int)


def count(picture, colour):
    wanted = np.array([int(colour[k:k + 2], 16) for k in (1, 3, 5)])
    return np.count_nonzero(np.abs(picture - wanted).max(axis=2) < 40)


def test_every_curve_is_seen(application, recording):
    from live_plot.graph import COLOURS, PlotGraph

    graph = PlotGraph()
    graph.resize(800, 500)
    empty = pixels(graph, application)
    graph.draw(recording)
    picture = pixels(graph, application)
    for colour in COLOURS:
        assert count(picture, colour) > count(empty, colour) + 500, colour
    recording.remove("/t/position[1]")
    graph.draw(recording)
    assert count(pixels(graph, application), COLOURS[1]) < 50
    begin, end = graph.viewRange()[0]
    assert begin <= 0.0 and 5.0 <= end < 6.0, "time does not count from the first sample"


def test_autoscroll_shows_the_last_seconds(application, recording):
    from live_plot.graph import PlotGraph

    graph = PlotGraph()
    graph.draw(recording, span_s=2.0)
    assert graph.viewRange()[0] == pytest.approx([3.0, 5.0])
    graph.draw(recording, span_s=10.0)
    assert graph.viewRange()[0] == pytest.approx([0.0, 10.0])


def test_curves_beyond_the_colours_differ_by_their_dashes(application):
    from live_plot.graph import COLOURS, PlotGraph

    recording, graph = PlotRecording(), PlotGraph()
    for number in range(2 * len(COLOURS)):
        recording.add("/t/x%d" % number)
    graph.draw(recording)
    pens = [line.opts["pen"] for line in graph.getPlotItem().listDataItems()]
    assert len({(pen.color().name(), pen.style()) for pen in pens}) == 2 * len(COLOURS)


class Topics:
    """Stands for the ROS side."""

    def __init__(self, recording):
        self.recording, self.there = recording, set()

    def subscribe(self, path):
        if path == "/bad/x":
            raise PlotError("/bad has no field 'x'; it has y (float64)")
        if path not in self.there:
            raise UnknownTopic("no topic begins '%s' so far" % path)
        self.recording.add(path)


@pytest.fixture
def window(application):
    from live_plot.window import PlotWindow

    recording = PlotRecording()
    topics = Topics(recording)
    window = PlotWindow(recording, topics.subscribe, recording.remove, 10.0)
    window.topics, window.recording = topics, recording
    return window


def status(window):
    return "\n".join(label.text() for label in window.findChildren(pyqtgraph.QtWidgets.QLabel))


def test_late_topic_is_waited_for(window, application):
    window.topics.there.add("/a/y")
    assert not window.add("/a/x:y")
    assert "waiting: no topic begins '/a/x'" in status(window) and window.recording.labels == ["/a/y"]
    window.topics.there.add("/a/x")
    timer = pyqtgraph.QtCore.QElapsedTimer()
    timer.start()
    while "/a/x" not in window.recording.labels:
        assert timer.elapsed() < 60_000, "the late topic was not plotted within a minute"
        application.processEvents(pyqtgraph.QtCore.QEventLoop.ProcessEventsFlag.WaitForMoreEvents, 100)
    assert "waiting" not in status(window)


@pytest.mark.parametrize("argument, text", [("/bad/x", "it has y (float64)"), ("/a[", "not of the form")])
def test_window_says_what_is_wrong(window, argument, text):
    assert not window.add(argument)
    assert text in status(window)


def test_menu_removes_curves(window):
    window.topics.there |= {"/a/x", "/a/y"}
    assert window.add("/a/x:y")
    (menu,) = window.findChildren(pyqtgraph.QtWidgets.QMenu)
    menu.aboutToShow.emit()
    actions = {action.text(): action for action in menu.actions()}
    assert list(actions) == ["/a/x", "/a/y", "all"]
    actions["/a/x"].trigger()
    assert window.recording.labels == ["/a/y"]
