# SPDX-License-Identifier: BSD-3-Clause
"""The live window: entry of curves, autoscroll, pause, and the graph."""
from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from pyqtgraph.Qt import QtCore, QtWidgets

from . import fields
from .graph import PlotGraph

if TYPE_CHECKING:
    from live_plot.recording import PlotRecording

REDRAW_MS = 50
# Drawing a whole long recording is slow, so it is drawn less often.
DRAWING_SHARE = 0.25
RETRY_MS = 1000


class PlotWindow(QtWidgets.QWidget):
    """subscribe(path) -> labels (raises PlotError), unsubscribe(label): add and remove curves of the recording.

    A path whose topic does not exist yet is tried again every second.
    """

    # May be emitted from any thread.
    problem = QtCore.Signal(str)  # pyright: ignore[reportAttributeAccessIssue]  (pyqtgraph's name for it)

    def __init__(self, recording: PlotRecording, subscribe: Callable[[str], list[str]],
                 unsubscribe: Callable[[str], None], span_s: float) -> None:
        super().__init__()
        self._recording, self._subscribe, self._unsubscribe = recording, subscribe, unsubscribe
        self._span_s = span_s
        self._waiting = []
        self.setWindowTitle("plot")
        self.resize(900, 600)

        self._entry = QtWidgets.QLineEdit()
        self._entry.setPlaceholderText("/topic/field[0]")
        self._autoscroll = QtWidgets.QCheckBox("autoscroll")
        self._autoscroll.setChecked(True)
        self.pause = QtWidgets.QCheckBox("pause")
        self._remove_menu = QtWidgets.QMenu(self)
        add, remove, clear = (QtWidgets.QToolButton() for _ in range(3))
        for button, text in ((add, "+"), (remove, "−"), (clear, "clear")):
            button.setText(text)
        remove.setMenu(self._remove_menu)
        remove.setPopupMode(QtWidgets.QToolButton.ToolButtonPopupMode.InstantPopup)
        row = QtWidgets.QHBoxLayout()
        for item in (QtWidgets.QLabel("Topic"), self._entry, add, remove, self._autoscroll, self.pause, clear):
            row.addWidget(item)
        self._graph = PlotGraph()
        self._status = QtWidgets.QLabel()
        self._status.setWordWrap(True)
        layout = QtWidgets.QVBoxLayout(self)
        layout.addLayout(row)
        layout.addWidget(self._graph, stretch=1)
        layout.addWidget(self._status)

        for signal in (add.clicked, self._entry.returnPressed):
            signal.connect(self._add_entry)
        self._remove_menu.aboutToShow.connect(self._fill_remove_menu)
        clear.clicked.connect(recording.clear)
        self._autoscroll.toggled.connect(lambda on: on or self._graph.enableAutoRange())
        self.problem.connect(self._status.setText)
        self._redraw_timer, self._retry_timer = QtCore.QTimer(self), QtCore.QTimer(self)
        self._redraw_timer.timeout.connect(self._redraw)
        self._retry_timer.timeout.connect(self._retry_all)
        self._redraw_timer.start(REDRAW_MS)
        self._retry_timer.start(RETRY_MS)

    def add(self, argument: str) -> bool:
        """Add the curves of a command line argument. Return whether it succeeded; if not, the window shows why."""
        try:
            self._waiting += fields.expand(argument)
        except fields.PlotError as error:
            self._status.setText(str(error))
            return False
        return self._retry()

    def _add_entry(self) -> None:
        if self._entry.text() and self.add(self._entry.text()):
            self._entry.clear()

    def _retry_all(self) -> None:
        self._retry()

    def _retry(self) -> bool:
        if not self._waiting:
            return True
        paths, self._waiting = self._waiting, []
        problems = []
        for path in paths:
            try:
                self._subscribe(path)
            except fields.UnknownTopic as error:
                self._waiting.append(path)
                problems.append("waiting: %s" % error)
            except fields.PlotError as error:
                problems.append(str(error))
        self._status.setText("\n".join(problems))
        return not problems

    def _fill_remove_menu(self) -> None:
        self._remove_menu.clear()
        labels = self._recording.labels
        for label in labels:
            self._remove_menu.addAction(label, lambda label=label: self._unsubscribe(label))
        if self._waiting:
            self._remove_menu.addAction("the topics that are waited for", self._waiting.clear)
        if len(labels) > 1:
            self._remove_menu.addAction("all", self._remove_all)

    def _remove_all(self) -> None:
        for label in self._recording.labels:
            self._unsubscribe(label)

    def _redraw(self) -> None:
        if self.pause.isChecked():
            return
        watch = QtCore.QElapsedTimer()
        watch.start()
        self._graph.draw(self._recording, self._span_s if self._autoscroll.isChecked() else None)
        self._graph.viewport().repaint()
        self._redraw_timer.setInterval(max(REDRAW_MS, int(watch.elapsed() / DRAWING_SHARE)))
