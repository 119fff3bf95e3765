# SPDX-License-Identifier: BSD-3-Clause
"""Plot numbers of messages over time: in a window, or with --png into a file, for which no display is needed."""
from __future__ import annotations

import argparse
import os
import signal
import sys
import time
from collections.abc import Callable

import rosgraph
import rospy

from command_line.options import counted, seconds
from live_plot import fields
from live_plot.recording import PlotRecording
from live_plot.subscriptions import Subscriptions, topic_types
from rospy_nodes.start import limit_ports

POLL_S = 0.2
END_POLL_MS = 50


def parse(name: str, arguments: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog=name, description=__doc__,
        epilog="/joint_states/position[0], /odom/pose/pose/position/x:y, /a/data,/b/data: with : fields of the same "
               "message, with , or a space any others. A message stands for all numbers in it.")
    parser.add_argument("topics", nargs="*", metavar="/TOPIC/FIELD", help="what to plot")
    parser.add_argument("-P", "--pause", action="store_true", help="do not draw until pause is switched off")
    parser.add_argument("-e", "--empty", action="store_true", help="start without any curve")
    parser.add_argument("--span", type=seconds(), default=10.0, metavar="S", help="autoscroll: time shown [s] (10)")
    parser.add_argument("--png", metavar="FILE", help="no window: write a picture")
    parser.add_argument("--seconds", type=seconds(), default=10.0, metavar="N", help="--png: time recorded [s] (10)")
    parser.add_argument("--timeout", type=seconds(), default=10.0, metavar="S",
                        help="--png: how long to wait for a topic and its first message [s] (10)")
    options = parser.parse_args(arguments)
    if options.empty:
        options.topics = []
    if options.png and not options.topics:
        parser.error("--png needs something to plot, for example /joint_states/position[0]")
    if options.png and not os.path.isdir(os.path.dirname(os.path.abspath(options.png))):
        parser.error("--png: there is no folder %s" % os.path.dirname(os.path.abspath(options.png)))
    return options


def wait_for(done: Callable[[], object], deadline: float) -> bool:
    """Poll until done() or the deadline [s, time.monotonic]; return whether it was done. Returns early when the node
    ends."""
    while not done():
        if time.monotonic() > deadline or rospy.is_shutdown():
            return False
        time.sleep(POLL_S)
    return True


def subscribe_all(subscriptions: Subscriptions, paths: list[str], deadline: float) -> None:
    """Raises PlotError for a topic that does not exist at the deadline."""
    while True:
        try:
            types = topic_types()
            for path in paths:
                subscriptions.open(path, types)
            return
        except fields.UnknownTopic:
            if time.monotonic() > deadline or rospy.is_shutdown():
                raise
            time.sleep(POLL_S)


def save_picture(options: argparse.Namespace) -> None:
    """Record, draw, write, print a summary. Raises PlotError."""
    os.environ["QT_QPA_PLATFORM"] = "offscreen"  # before Qt is loaded
    import pyqtgraph

    from live_plot.graph import PlotGraph

    recording = PlotRecording()
    problems: list[str] = []
    subscriptions = Subscriptions(recording, problems.append)
    paths = [path for argument in options.topics for path in fields.expand(argument)]
    deadline = time.monotonic() + options.timeout
    subscribe_all(subscriptions, paths, deadline)

    def silent() -> list[str]:
        return [label for label, samples in recording.samples()[0].items() if not samples.size]

    if not wait_for(lambda: not silent() or problems, deadline) or problems:
        raise fields.PlotError("; ".join(problems) or "no message within %g s for %s" % (
            options.timeout, ", ".join(silent())))
    wait_for(lambda: False, time.monotonic() + options.seconds)

    application = pyqtgraph.mkQApp()
    graph = PlotGraph()
    graph.resize(1000, 600)
    graph.show()
    graph.draw(recording)
    application.processEvents()
    if not graph.grab().save(options.png, "PNG"):
        raise fields.PlotError("%s cannot be written" % options.png)
    for label, (times, values) in recording.samples()[0].items():
        print("%s: %s in %.2f s, %.6g to %.6g" % (
            label, counted(times.size, "sample"), times[-1] - times[0], values.min(), values.max()))
    print("written: %s" % options.png)


def show_window(options: argparse.Namespace) -> None:
    if not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise fields.PlotError("there is no display (DISPLAY is not set); --png FILE --seconds N needs none")
    is_over = False

    def end(*_: object) -> None:
        nonlocal is_over
        is_over = True

    # An event loop that does not run yet cannot be quit: set a flag, which a timer of the loop checks.
    for name in (signal.SIGINT, signal.SIGTERM):
        signal.signal(name, end)
    rospy.on_shutdown(end)
    import pyqtgraph
    from pyqtgraph.Qt import QtCore

    from live_plot.window import PlotWindow

    application = pyqtgraph.mkQApp("plot")
    recording = PlotRecording()
    subscriptions = Subscriptions(recording, lambda text: window.problem.emit(text))
    window = PlotWindow(
        recording, lambda path: subscriptions.open(path, topic_types()), subscriptions.close, options.span)
    window.pause.setChecked(options.pause)
    for argument in options.topics:
        window.add(argument)
    window.show()
    end_timer = QtCore.QTimer()
    end_timer.setInterval(END_POLL_MS)
    end_timer.timeout.connect(lambda: application.quit() if is_over else None)
    end_timer.start()
    application.exec_()


def main(name: str) -> None:
    """The command ``name``: reads the command line; exits with a one-line error if it cannot continue."""
    options = parse(name, rospy.myargv()[1:])
    if not rosgraph.is_master_online():
        sys.exit("%s: no ROS master at %s; start roscore or a launch file" % (name, rosgraph.get_master_uri()))
    limit_ports()
    rospy.init_node(name, anonymous=True, disable_signals=not options.png)
    try:
        (save_picture if options.png else show_window)(options)
    except fields.PlotError as error:
        sys.exit("%s: %s" % (name, error))
