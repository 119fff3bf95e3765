# SPDX-License-Identifier: BSD-3-Clause
"""Curves over time, drawn by PyQtGraph: the picture in the window and in the file."""
from __future__ import annotations

from typing import TYPE_CHECKING

import pyqtgraph

if TYPE_CHECKING:
    import numpy as np
    from PyQt5.QtGui import QPen

    from live_plot.recording import PlotRecording

# Distinguishable on white, also for colour-blind readers; the seventh curve uses the first colour again, dashed.
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#333333")


class PlotGraph(pyqtgraph.PlotWidget):
    """draw() shows a recording; with `span_s` its last seconds, otherwise all of it, or the range chosen by mouse."""

    def __init__(self) -> None:
        super().__init__(background="w")
        self.showGrid(x=True, y=True, alpha=0.3)
        self.setLabel("bottom", "time [s]")
        self.addLegend(offset=(10, 10), labelTextColor="k", brush=pyqtgraph.mkBrush(255, 255, 255, 130))
        for side in ("bottom", "left"):
            self.getAxis(side).setPen("k")
            self.getAxis(side).setTextPen("k")
        self._lines = {}

    def draw(self, recording: PlotRecording, span_s: float | None = None) -> None:
        """Draw a PlotRecording. span_s: time shown before the newest sample [s]; None keeps the view."""
        samples, begin_s = recording.samples(span_s)
        self._match_lines(samples)
        end_s = begin_s
        for label, (times, values) in samples.items():
            self._lines[label].setData(times - begin_s, values)
            if times.size:
                end_s = max(end_s, times[-1])
        if span_s is not None and end_s > begin_s:
            left, right = max(0.0, end_s - begin_s - span_s), max(end_s - begin_s, span_s)
            self.setXRange(left, right, padding=0)  # pyright: ignore[reportCallIssue]

    def _match_lines(self, samples: dict[str, np.ndarray]) -> None:
        for label in [label for label in self._lines if label not in samples]:
            self.removeItem(self._lines.pop(label))
        for label in samples:
            if label not in self._lines:
                self._lines[label] = self.plot(name=label, pen=self._free_pen(), autoDownsample=True, clipToView=True)

    def _free_pen(self) -> QPen:
        """The first unused combination of colour and dashes."""
        taken = {(line.opts["pen"].color().name(), line.opts["pen"].style()) for line in self._lines.values()}
        style = pyqtgraph.QtCore.Qt.PenStyle
        for dashes in (style.SolidLine, style.DashLine, style.DotLine, style.DashDotLine):
            for colour in COLOURS:
                if (colour, dashes) not in taken:
                    return pyqtgraph.mkPen(colour, width=1.5, style=dashes)
        return pyqtgraph.mkPen("#999999", width=1.5)
