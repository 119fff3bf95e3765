# SPDX-License-Identifier: BSD-3-Clause
"""The window: the canvas, its buttons and keys, the list of models, the status line."""
from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from PyQt5.QtCore import QPoint, Qt, pyqtSignal
from PyQt5.QtGui import QKeySequence
from PyQt5.QtWidgets import (
    QAction,
    QDockWidget,
    QLabel,
    QMainWindow,
    QMenu,
    QMessageBox,
    QSpinBox,
    QStyle,
    QToolBar,
    QTreeWidget,
    QTreeWidgetItem,
)

from world_window.canvas import Canvas
from world_window.simulator import MAX_STEPS
from world_window.stage import RIGHT, WindowStage

if TYPE_CHECKING:
    from PyQt5.QtCore import QEvent

    from world_window.simulator import Simulator
    from world_window.viewer import Frame, Viewer

_MESSAGE_MS = 8000
HELP = """<table cellspacing="4">
<tr><td><b>left drag</b></td><td>move the view sideways</td></tr>
<tr><td><b>middle drag, shift + left drag</b></td><td>orbit about the point under the pointer</td></tr>
<tr><td><b>wheel, right drag</b></td><td>nearer, farther</td></tr>
<tr><td><b>left click</b></td><td>select</td></tr>
<tr><td><b>right click</b></td><td>menu of the thing under the pointer</td></tr>
<tr><td><b>ctrl + left drag</b></td>
<td>pull the thing under the pointer by a spring; the wheel moves it away or nearer</td></tr>
<tr><td><b>T, Esc</b></td><td>the left button pulls; it moves the view again</td></tr>
<tr><td><b>space</b></td><td>pause, go on</td></tr>
<tr><td><b>.</b></td><td>steps, as many as the box beside the button says</td></tr>
<tr><td><b>ctrl + R</b></td><td>all models back to their start</td></tr>
<tr><td><b>ctrl + shift + R</b></td><td>the same, and time to zero</td></tr>
<tr><td><b>F, G, Del</b></td><td>follow, go to, delete the selected thing</td></tr>
<tr><td><b>H</b></td><td>look at the whole world</td></tr>
<tr><td><b>X, C, N</b></td><td>frames, contacts, names</td></tr>
<tr><td><b>M, F11, ctrl + Q</b></td>
<td>list of models, full screen, close the window (the world goes on)</td></tr>
</table>"""


class CanvasEvents:
    """The canvas' events, for the viewer's thread."""

    def __init__(self, viewer: Viewer, on_menu: Callable[[str, str, int, int], object]) -> None:
        self._post, self._on_menu = viewer.post, on_menu

    def resize(self, width: int, height: int) -> None:
        self._post(WindowStage.resize, width, height)

    def press(self, button: str, x: int, y: int, shift: bool, control: bool) -> None:
        self._post(WindowStage.press, button, x, y, shift, control)

    def move(self, x: int, y: int) -> None:
        self._post(WindowStage.move, x, y)

    def wheel(self, steps: float, x: int, y: int) -> None:
        self._post(WindowStage.wheel, steps, x, y)

    def release(self, button: str, x: int, y: int) -> None:
        self._post(self._release, button, x, y)

    def _release(self, stage, button, x, y):
        hit = stage.release(button, x, y)
        if button == RIGHT and hit is not None and stage.selected:
            self._on_menu(hit.model, hit.link, x, y)


class Window(QMainWindow):
    """The window of a :class:`world_window.viewer.Viewer` and a :class:`world_window.simulator.Simulator`."""

    _frame_came = pyqtSignal()
    _told = pyqtSignal(str)
    _menu_wanted = pyqtSignal(str, str, int, int)
    _built = False  # Qt sends events before the window is built
    _viewer: Viewer
    _simulator: Simulator

    def __init__(self) -> None:
        super().__init__()
        self.setWindowTitle("Gazebo")
        self._waiting = None  # the newest frame that the window has not shown
        self._paused, self._models, self._selected, self._followed = False, {}, None, None
        self._frame_came.connect(self._take_frame)
        self._told.connect(lambda text: self.statusBar().showMessage(text, _MESSAGE_MS))
        self._menu_wanted.connect(self._open_menu)

    def build(self, viewer: Viewer, simulator: Simulator) -> None:
        """Fill the window."""
        self._viewer, self._simulator = viewer, simulator
        self.canvas = Canvas(CanvasEvents(viewer, self._menu_wanted.emit), self)
        self.setCentralWidget(self.canvas)
        self._add_buttons()
        self._add_list()
        self._status = QLabel()
        self.statusBar().addPermanentWidget(self._status)
        self.resize(1000, 760)
        self.canvas.setFocus()
        self._built = True

    # -- any thread -----------------------------------------------------------------------------------------------

    def frame(self, frame: Frame) -> None:
        """The viewer has a new frame."""
        before, self._waiting = self._waiting, frame
        if before is not None and frame.pixels is None:
            self._waiting = frame._replace(pixels=before.pixels, shapes=before.shapes)
        if before is None:
            self._frame_came.emit()

    def tell(self, text: str) -> None:
        """Show a line of text in the status line for some seconds."""
        self._told.emit(text)

    # -- inside ---------------------------------------------------------------------------------------------------

    def _take_frame(self):
        frame, self._waiting = self._waiting, None
        if frame is None:
            return
        if frame.clock is None:
            self.canvas.show_nothing("waiting for the simulator")
            self._status.setText("no simulator")
        else:
            if frame.pixels is not None:
                self.canvas.show_frame(frame.pixels, frame.shapes)
            self._show_clock(*frame.clock, frame.rate)
        self._selected, self._followed = frame.selected, frame.followed
        self._follow.setChecked(frame.followed is not None)
        for action in (self._follow, self._go, self._delete):
            action.setEnabled(bool(frame.selected or (action is self._follow and frame.followed)))
        if frame.models != self._models:
            self._models = frame.models
            self._fill_list()

    def _show_clock(self, simulated_s, paused, factor, rate):
        self._paused = paused
        icon = QStyle.StandardPixmap.SP_MediaPlay if paused else QStyle.StandardPixmap.SP_MediaPause
        self._pause.setIcon(self.style().standardIcon(icon))
        self._pause.setText("Go on" if paused else "Pause")
        minutes, seconds = divmod(simulated_s, 60.0)
        pace = "paused" if paused else "real-time factor %s" % ("–" if factor is None else "%.2f" % factor)
        chosen = "::".join(part for part in self._selected or () if part)
        self._status.setText("%s%s    time %d:%06.3f    %.0f pictures/s"
                             % (chosen + "    " if chosen else "", pace, minutes, seconds, rate))

    def _add_buttons(self):
        bar = QToolBar("world", self)
        bar.setMovable(False)
        bar.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextBesideIcon)
        self.addToolBar(bar)
        simulator, post = self._simulator, self._viewer.post
        icon = self.style().standardIcon
        self._pause = self._action(bar, "Pause", "Space", "pause the world, or let it go on", self._pause_or_go_on)
        self._action(bar, "Step", ".", "make some steps, then pause", lambda: simulator.step(self._steps.value())
                     ).setIcon(icon(QStyle.StandardPixmap.SP_MediaSkipForward))
        self._steps = QSpinBox()
        self._steps.setRange(1, MAX_STEPS)
        self._steps.setToolTip("steps of the button")
        self._steps.setFocusPolicy(Qt.FocusPolicy.ClickFocus)
        self._steps.editingFinished.connect(self.canvas.setFocus)
        bar.addWidget(self._steps)
        self._action(bar, "Reset", "Ctrl+R", "put all models back to their start", simulator.reset_world
                     ).setIcon(icon(QStyle.StandardPixmap.SP_BrowserReload))
        reset_time = self._action(None, "Reset time, too", "Ctrl+Shift+R",
                                  "put all models back to their start, and time to zero", simulator.reset_simulation)
        separator = bar.addSeparator()
        self._pulls = self._action(bar, "Pull", "T", "the left button pulls things by a spring",
                                   lambda on: post(_set_pulls, on), checkable=True)
        self._follow = self._action(bar, "Follow", "F", "the view moves along with the selected thing",
                                    lambda on: post(_follow_selected, on), checkable=True)
        self._go = self._action(None, "Go to", "G", "look at the selected thing from nearby",
                                lambda: post(WindowStage.go_to_selected))
        self._delete = self._action(None, "Delete", "Del", "take the selected model out of the world",
                                    self._delete_selected)
        self._action(bar, "Home", "H", "look at the whole world", lambda: post(WindowStage.home))
        bar.addSeparator()
        for layer, key in (("frames", "X"), ("contacts", "C"), ("names", "N")):
            self._action(bar, layer.capitalize(), key, "show or hide %s" % layer,
                         lambda on, layer=layer: self._show_layer(layer, on), checkable=True)
        self._bar = bar
        self._action(None, "Full screen", "F11", "full screen", self._full_screen)
        self._action(None, "Close", "Ctrl+Q", "close the window; the world goes on", self.close)
        self._action(None, "Stop", "Esc", "select nothing; the left button moves the view", self._stop)
        self._help = self._action(None, "Help", "F1", "mouse and keys", self._show_help)
        bar.insertAction(separator, reset_time)

    def _action(self, bar, text, key, tip, function, checkable=False):
        action = QAction(text, self)
        action.setCheckable(checkable)
        action.setToolTip("%s (%s)" % (tip, key))
        action.setShortcut(QKeySequence(key))
        # Only what the user does counts: a frame from before the last click sets buttons back for a moment.
        action.triggered.connect(function if checkable else lambda *_: function())
        self.addAction(action)
        if bar is not None:
            bar.addAction(action)
        return action

    def _add_list(self):
        self._tree = QTreeWidget()
        self._tree.setHeaderHidden(True)
        self._tree.itemClicked.connect(
            lambda item: self._viewer.post(WindowStage.select, *item.data(0, Qt.ItemDataRole.UserRole)))
        self._tree.itemDoubleClicked.connect(lambda *_: self._viewer.post(WindowStage.go_to_selected))
        dock = QDockWidget("Models", self)
        dock.setWidget(self._tree)
        self.addDockWidget(Qt.DockWidgetArea.LeftDockWidgetArea, dock)
        dock.hide()
        show = dock.toggleViewAction()
        show.setShortcut("M")
        show.setToolTip("list of models (M)")
        self._bar.addAction(show)
        self._bar.addAction(self._help)

    def _fill_list(self):
        opened = {self._tree.topLevelItem(k).text(0) for k in range(self._tree.topLevelItemCount())
                  if self._tree.topLevelItem(k).isExpanded()}
        self._tree.clear()
        for model, links in self._models.items():
            item = QTreeWidgetItem([model])
            item.setData(0, Qt.ItemDataRole.UserRole, (model, ""))
            for link in links:
                child = QTreeWidgetItem([link or model])
                child.setData(0, Qt.ItemDataRole.UserRole, (model, link))
                item.addChild(child)
            self._tree.addTopLevelItem(item)
            item.setExpanded(model in opened)

    def _pause_or_go_on(self):
        (self._simulator.go_on if self._paused else self._simulator.pause)()

    def _show_layer(self, layer, on):
        self._viewer.post(WindowStage.show, layer, on)
        if layer == "contacts":
            self._simulator.show_contacts(on)

    def _delete_selected(self):
        if self._selected:
            self._simulator.delete(self._selected[0])

    def _stop(self):
        self._pulls.setChecked(False)
        self._viewer.post(_set_pulls, False)
        self._viewer.post(WindowStage.let_go)
        self._viewer.post(WindowStage.select, None)

    def _full_screen(self):
        (self.showNormal if self.isFullScreen() else self.showFullScreen)()

    def _show_help(self):
        box = QMessageBox(QMessageBox.Icon.NoIcon, "Mouse and keys", HELP, QMessageBox.StandardButton.Close, self)
        box.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        box.open()

    def _open_menu(self, model, link, x, y):
        menu = QMenu(self)
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        title = menu.addAction("%s::%s" % (model, link))
        title.setEnabled(False)
        menu.addSeparator()
        for action in (self._go, self._follow, self._delete):
            action.setEnabled(True)
            menu.addAction(action)
        menu.popup(self.canvas.mapToGlobal(QPoint(x, y)))

    def changeEvent(self, event: QEvent) -> None:
        if self._built:
            self._viewer.set_visible(not self.isMinimized())
        super().changeEvent(event)


def _set_pulls(stage, on):
    stage.pulls_by_left = on


def _follow_selected(stage, on):
    if on != (stage.followed is not None):
        stage.follow(stage.selected if on else None)
