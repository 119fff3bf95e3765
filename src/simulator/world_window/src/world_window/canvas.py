# SPDX-License-Identifier: BSD-3-Clause
"""The widget with the picture: shows frames, and passes mouse and wheel on."""
from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, cast

from PyQt5.QtCore import QPointF, Qt
from PyQt5.QtGui import QColor, QFont, QImage, QPainter, QPen
from PyQt5.QtWidgets import QWidget

from world_window import overlay
from world_window.stage import LEFT, MIDDLE, RIGHT

if TYPE_CHECKING:
    import numpy as np
    from PyQt5.QtGui import QMouseEvent, QPaintEvent, QResizeEvent, QWheelEvent

    from world_window.window import CanvasEvents

_BUTTONS = {Qt.MouseButton.LeftButton: LEFT, Qt.MouseButton.MiddleButton: MIDDLE, Qt.MouseButton.RightButton: RIGHT}
_SKY = QColor(158, 178, 204)
_PER_NOTCH = 120.0  # of Qt's wheel


class Canvas(QWidget):
    """``events``: has ``press``, ``move``, ``release``, ``wheel`` and ``resize`` with the arguments of
    :class:`world_window.stage.WindowStage`'s."""

    def __init__(self, events: CanvasEvents, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._events = events
        self._image: QImage | None = None
        self._shapes: Sequence[overlay.Shape] = ()
        #: Words in the middle while there is no picture.
        self.words = "waiting for the simulator"
        self._font = QFont("Sans", 9)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setAttribute(Qt.WidgetAttribute.WA_OpaquePaintEvent)
        self.setMinimumSize(200, 150)

    def show_frame(self, pixels: np.ndarray, shapes: Sequence[overlay.Shape]) -> None:
        """Show ``pixels`` (height, width, 3) with ``shapes`` of :mod:`world_window.overlay` over them."""
        height, width = pixels.shape[:2]
        self._shapes = shapes
        data = cast("bytes", pixels.data)  # Qt takes any buffer
        # Qt enlarges this format in half of the time, and the copy outlives the pixels.
        self._image = QImage(data, width, height, 3 * width, QImage.Format.Format_RGB888).convertToFormat(
            QImage.Format.Format_RGB32)
        self.update()

    def show_nothing(self, words: str) -> None:
        """Show ``words`` instead of a picture."""
        self._image, self.words = None, words
        self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        if self._image is None:
            painter.fillRect(self.rect(), _SKY)
            painter.drawText(self.rect(), Qt.AlignmentFlag.AlignCenter, self.words)
            return
        if self._image.size() == self.size():
            painter.drawImage(0, 0, self._image)
        else:
            painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform)
            painter.drawImage(self.rect(), self._image)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setFont(self._font)
        for shape in self._shapes:
            _paint(painter, shape)

    def resizeEvent(self, event: QResizeEvent) -> None:
        self._events.resize(event.size().width(), event.size().height())

    def mousePressEvent(self, event: QMouseEvent) -> None:
        button = _BUTTONS.get(event.button())
        if button is not None:
            keys = event.modifiers()
            self._events.press(button, event.x(), event.y(), bool(keys & Qt.KeyboardModifier.ShiftModifier),
                               bool(keys & Qt.KeyboardModifier.ControlModifier))

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        self._events.move(event.x(), event.y())

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        button = _BUTTONS.get(event.button())
        if button is not None:
            self._events.release(button, event.x(), event.y())

    def wheelEvent(self, event: QWheelEvent) -> None:
        steps = event.angleDelta().y() / _PER_NOTCH
        if steps:
            self._events.wheel(steps, event.x(), event.y())


def _paint(painter, shape):
    if isinstance(shape, overlay.ScreenLine):
        painter.setPen(QPen(QColor(*shape.colour), shape.width))
        painter.drawLine(QPointF(shape.x0, shape.y0), QPointF(shape.x1, shape.y1))
    elif isinstance(shape, overlay.Dot):
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(QColor(*shape.colour))
        painter.drawEllipse(QPointF(shape.x, shape.y), shape.radius, shape.radius)
    else:
        place = QPointF(shape.x, shape.y)
        painter.setPen(QColor(0, 0, 0, 160))
        painter.drawText(place + QPointF(1.0, 1.0), shape.words)
        painter.setPen(QColor(255, 255, 255))
        painter.drawText(place, shape.words)
