# SPDX-License-Identifier: BSD-3-Clause
"""The thread that draws: follows a simulator's snapshot, across its restarts, and hands pictures over. ROS-free."""
from __future__ import annotations

import contextlib
import queue
import threading
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from sensor_renderer.following import WorldFollower
from world_picture.background import BackgroundDrawings
from world_picture.snapshot import SnapshotError
from world_window.clock import Clock
from world_window.sharpness import Sharpness
from world_window.stage import WindowStage

if TYPE_CHECKING:
    import os

    from sensor_renderer.gl_renderer import GlRenderer
    from sensor_renderer.tiny_renderer import TinyRenderer
    from world_window.overlay import Shape
    from world_window.stage import Pull

#: At most so many pictures a second; where drawing takes longer, it takes at most this share of the time.
MAX_RATE, DRAWING_SHARE = 30.0, 0.8
# How often a simulator is looked for [s], and the message of a pull is repeated [s].
_SEEK_S, _PULL_S = 0.25, 0.05
# Times and names in the status line are renewed this often [s].
_STATUS_S = 0.2
# A picture of fewer pixels is drawn again with all of them when nothing has moved for so long [s].
_REST_S = 0.3


class Frame(NamedTuple):
    """``pixels`` (height, width, 3), uint8, red first, or None where only the rest is new; ``shapes`` over them;
    ``clock``: (simulated time [s], paused, real-time factor or None), None without a simulator; ``models``: {name: its
    links}; ``selected``, ``followed``: (model, link) or None; ``rate`` [pictures/s]."""

    pixels: np.ndarray | None
    shapes: list[Shape]
    clock: tuple[float, bool, float | None] | None
    models: dict[str, list[str]]
    selected: tuple[str, str] | None
    followed: tuple[str, str] | None
    rate: float


class Viewer(threading.Thread):
    """Draws until :meth:`end`. Work for its thread comes through :meth:`post`."""

    def __init__(self, find_folder: Callable[[], str | os.PathLike[str] | None],
                 make_renderer: Callable[[], GlRenderer | TinyRenderer], on_frame: Callable[[Frame], object],
                 pull: Callable[[Pull | None], object], warn: Callable[[str], object]) -> None:
        """``find_folder()``: the folder of the simulator's snapshot, or None; ``make_renderer()``: as
        :func:`sensor_renderer.best.best_renderer`'s; ``on_frame(frame)`` gets each :class:`Frame`; ``pull(pull)``: the
        simulator's spring, a :class:`world_window.stage.Pull` or None for its end; ``warn(text)``. All are called in
        this thread."""
        super().__init__(name="viewer", daemon=True)
        self.stage = WindowStage()
        self._find_folder, self._make_renderer, self._on_frame = find_folder, make_renderer, on_frame
        self._pull, self._warn = pull, warn
        self._work = queue.SimpleQueue()
        self._ending = threading.Event()
        self._renderer = self._follower = None
        self._clock = Clock()
        self._drawn = self._shown_at = None
        self._sharpness, self._drawn_scale = Sharpness(), 1.0
        self._visible = True
        self._spent_s = 0.0
        self._drawn_at = []
        self._pull_told = None, 0.0

    def post(self, function: Callable[..., object], *arguments: Any) -> None:
        """Any thread: call ``function(stage, *arguments)`` in the viewer's thread."""
        self._work.put((function, arguments))

    def set_visible(self, visible: bool) -> None:
        """Any thread: whether the pictures are visible; none are drawn otherwise."""
        self.post(lambda _: setattr(self, "_visible", visible))

    def end(self) -> None:
        """Any thread: stop, and wait for it."""
        self._ending.set()
        self.post(lambda _: None)
        if self is not threading.current_thread() and self.is_alive():
            self.join(5.0)

    def run(self) -> None:
        """The thread's loop."""
        next_at = seek_at = 0.0
        while not self._ending.is_set():
            now = time.monotonic()
            if self._follower is None and now >= seek_at:
                self._follower, seek_at = self._open(), now + _SEEK_S
            self._work_until(next_at)
            if self._ending.is_set():
                break
            began = time.monotonic()
            try:
                self._turn(began)
            except SnapshotError as error:
                self._warn(str(error))
            self._spent_s = time.monotonic() - began
            next_at = began + max(1.0 / MAX_RATE, self._spent_s / DRAWING_SHARE)
        if self._renderer is not None:
            self._renderer.close()

    def _work_until(self, deadline):
        """Execute what is posted until ``deadline``, and at least what is there already."""
        while True:
            left = deadline - time.monotonic()
            try:
                function, arguments = self._work.get(timeout=left) if left > 0.0 else self._work.get_nowait()
            except queue.Empty:
                return
            function(self.stage, *arguments)

    def _open(self):
        folder = self._find_folder()
        if folder is None:
            return None
        with contextlib.suppress(SnapshotError):  # left by an earlier simulator
            follower = WorldFollower(folder, self._warn, BackgroundDrawings())
            if follower.is_alive:
                return follower
        return None

    def _turn(self, now):
        follower, stage = self._follower, self.stage
        if follower is not None and not follower.is_alive:
            follower = self._follower = None
            stage.let_go()
        if follower is not None:
            before = follower.revision
            if follower.follow() and follower.snapshot is not None:
                self._clock.take(follower.snapshot.time_s, follower.snapshot.paused, now)
                stage.take(follower.mirror, follower.revision != before)
        self._tell_pull(now)
        self._show(now)

    def _tell_pull(self, now):
        """Repeat a running pull, so that the simulator ends it when this process has gone."""
        told, at = self._pull_told
        pull = self.stage.pull
        if pull is not None and (pull is not told or now - at >= _PULL_S) or pull is None and told is not None:
            self._pull_told = pull, now
            self._pull(pull)

    def _show(self, now):
        stage, follower = self.stage, self._follower
        pixels = None
        if follower is not None and self._visible and follower.revision is not None:
            mirror = follower.mirror
            state = (id(follower), mirror.version, mirror.picture_versions, stage.version, stage.pinhole)
            if state != self._drawn:
                self._drawn = state
                pixels = self._picture(mirror, now, self._sharpness.scale)
                pinhole = stage.pinhole
                self._sharpness.take(time.monotonic() - now, pinhole.width * pinhole.height)
            elif self._drawn_scale < 1.0 and now - self._drawn_at[-1] > _REST_S:
                pixels = self._picture(mirror, now, 1.0)
        if pixels is None and self._shown_at is not None and now - self._shown_at < _STATUS_S:
            return
        self._shown_at = now
        self._drawn_at = [then for then in self._drawn_at if now - then < 1.0] or self._drawn_at[-1:]
        bodies = follower.mirror.bodies if follower is not None else {}
        clock = self._clock
        self._on_frame(Frame(
            pixels, stage.shapes() if pixels is not None else [],
            None if follower is None else (clock.simulated_s, clock.paused, clock.factor),
            {name: body.link_names for name, body in bodies.items()}, stage.selected, stage.followed,
            float(len([then for then in self._drawn_at if now - then < 1.0]))))

    def _picture(self, mirror, now, scale):
        if self._renderer is None:
            self._renderer = self._make_renderer()
        self._drawn_scale = scale
        self._drawn_at.append(now)
        pixels, _ = self._renderer.render(mirror, self.stage.smaller_pinhole(scale), self.stage.eye.pose())
        return pixels
