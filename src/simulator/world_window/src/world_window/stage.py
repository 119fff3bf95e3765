# SPDX-License-Identifier: BSD-3-Clause
"""Handles mouse and keys, and keeps what is shown of the world. ROS-free; one thread uses it.

The mouse moves the eye as in Gazebo's window: the left button pans, the middle one (or the left one with shift) orbits
about the point under the pointer, the wheel and the right button zoom. With control, or with the tool "pull", the left
button pulls the thing under the pointer by a spring.
"""
from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sensor_renderer.pinhole import Pinhole
from sensor_renderer.viewpoint import extent, overview
from world_window import picking
from world_window.eye import Eye
from world_window.overlay import Overlay, bounds_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from sensor_renderer.mirror import DrawnModel, Mirror
    from world_window.overlay import Shape, ShownContact

LEFT, MIDDLE, RIGHT = "left", "middle", "right"
#: What may be drawn over the picture.
LAYERS = ("frames", "contacts", "names")
# Gazebo's camera of the user: its place, its look and the field of view.
FIRST_EYE = Eye((5.0, -5.0, 2.0), 2.35619, -0.275643)
FIELD_OF_VIEW_RAD = 1.047
_NEAR_M, _FAR_M = 0.03, 200.0
# A press and a release no farther apart than this are a click [pixels].
_CLICK_PX = 4
# Where nothing is under the pointer, things count as this far away [m].
_EMPTY_M = 3.0
# The first view shows at least this much of the world in each direction [m].
_MIN_VIEW_M = 0.8
_ORBIT_RAD_PER_PX = 0.006
_ZOOM_PER_STEP, _ZOOM_PER_PX = 0.85, 0.99


class Pull(NamedTuple):
    """A pull by a spring: the link's ``model`` and ``link``; ``grip`` (3,) in the link's frame, ``target`` (3,) in the
    world [m]."""

    model: str
    link: str
    grip: np.ndarray
    target: np.ndarray


class _Gesture(NamedTuple):
    kind: str
    button: str
    start: tuple[float, float]
    point: np.ndarray  # under the pointer at the press


class WindowStage:
    """The eye, the selection, a pull, and the layers; ``version`` counts changes of the picture that they cause."""

    def __init__(self, width: int = 1000, height: int = 700) -> None:
        """``width``, ``height`` of the picture [pixels]."""
        self.version = 0
        self.eye = FIRST_EYE
        #: (model, link) or None; the link may be "" for the whole model.
        self.selected: tuple[str, str] | None = None
        self.followed: tuple[str, str] | None = None
        self.pull: Pull | None = None
        #: Whether the left button pulls without control.
        self.pulls_by_left = False
        self.layers: dict[str, bool] = dict.fromkeys(LAYERS, False)
        self._contacts: Sequence[ShownContact] = ()
        self._mirror: Mirror | None = None
        self._gesture: _Gesture | None = None
        self._pointer = (0.0, 0.0)
        self._is_drag = False  # the gesture is no click any more
        self._moved_by_user = False
        self._fitted_to = None
        self._followed_at = None
        self.resize(width, height)

    # -- the picture ----------------------------------------------------------------------------------------------

    def resize(self, width: int, height: int) -> None:
        """The picture has another size [pixels]."""
        self.pinhole = Pinhole.from_field_of_view(width, height, FIELD_OF_VIEW_RAD, _NEAR_M, _FAR_M)
        self.version += 1

    def smaller_pinhole(self, scale: float) -> Pinhole:
        """The same view in a picture of ``scale`` times the width and height."""
        width, height = (max(round(scale * size), 1) for size in self.pinhole[:2])
        return Pinhole.from_field_of_view(width, height, FIELD_OF_VIEW_RAD, _NEAR_M, _FAR_M)

    def take(self, mirror: Mirror, has_new_scene: bool) -> None:
        """The world has moved, or is another one; call it after each change of the mirror."""
        self._mirror = mirror
        if has_new_scene:
            self._drop_what_is_gone()
            if not self._moved_by_user and self.followed is None:
                self._fit()
        self._follow()

    def shapes(self) -> list[Shape]:
        """The shapes to draw over the picture, :mod:`world_window.overlay`'s shapes."""
        overlay = Overlay(self.pinhole, self.eye.pose())
        if self._mirror is None:
            return overlay.shapes
        chosen = {self.selected[0]} & self._mirror.bodies.keys() if self.selected else ()
        if self.layers["frames"]:
            for model in chosen or self._mirror.bodies:
                self._draw_frames(overlay, self._mirror.bodies[model])
        if self.layers["names"]:
            for model, body in self._mirror.bodies.items():
                self._draw_names(overlay, model, body, model in chosen and not self.layers["frames"])
        if self.layers["contacts"]:
            for contact in self._contacts:
                overlay.contact(contact)
        if self.selected:
            self._draw_selection(overlay, *self.selected)
        if self.pull:
            body = self._mirror.bodies.get(self.pull.model)
            if body is not None:
                matrix = body.link_matrix(self.pull.link)
                overlay.spring(matrix[:3, :3] @ self.pull.grip + matrix[:3, 3], self.pull.target)
        return overlay.shapes

    def link_pose(self, model: str, link: str) -> np.ndarray | None:
        """Pose (4, 4) of a link, of the model's root for ""; None if it is gone."""
        body = self._mirror.bodies.get(model) if self._mirror is not None else None
        if body is None or (link and link not in body.link_names):
            return None
        return body.link_matrix(link) if link else body.matrices[0]

    # -- mouse and wheel ------------------------------------------------------------------------------------------

    def press(self, button: str, x: float, y: float, shift: bool = False, control: bool = False) -> None:
        """A button goes down at ``x``, ``y`` [pixels]."""
        if self._gesture is not None:
            return
        self._pointer, self._is_drag = (x, y), False
        hit, point = self._under(x, y)
        kind = {LEFT: "pan", MIDDLE: "orbit", RIGHT: "zoom"}[button]
        if button == LEFT and shift:
            kind = "orbit"
        elif button == LEFT and (control or self.pulls_by_left) and hit is not None and self._can_move(hit):
            kind = "pull"
            matrix = self._bodies[hit.model].link_matrix(hit.link)
            self.pull = Pull(hit.model, hit.link, matrix[:3, :3].T @ (hit.point - matrix[:3, 3]), hit.point)
            self.selected = hit.model, hit.link
            self.version += 1
        self._gesture = _Gesture(kind, button, (x, y), point)

    def move(self, x: float, y: float) -> None:
        """The pointer is at ``x``, ``y`` [pixels] now."""
        if self._gesture is None:
            return
        kind, _, start, point = self._gesture
        if not self._is_drag and max(abs(x - start[0]), abs(y - start[1])) <= _CLICK_PX:
            return  # perhaps a click
        self._is_drag = True
        (old_x, old_y), self._pointer = self._pointer, (x, y)
        right, down = x - old_x, y - old_y
        if kind == "pull":
            self._pull_to(x, y)
            return
        if kind == "pan":
            depth = float((point - self.eye.position) @ self.eye.rotation()[:, 2])
            self._look(self.eye.panned(right, down, self.pinhole, max(depth, _NEAR_M)))
        elif kind == "orbit":
            self._look(self.eye.orbited(point, -_ORBIT_RAD_PER_PX * right, -_ORBIT_RAD_PER_PX * down))
        else:
            self._look(self.eye.zoomed(point, _ZOOM_PER_PX ** -down))

    def release(self, button: str, x: float, y: float) -> picking.Hit | None:
        """A button goes up. Returns the :class:`picking.Hit` under a click, None for a drag or for nothing."""
        gesture = self._gesture
        if gesture is None or gesture.button != button:
            return None
        self.move(x, y)
        self._gesture = None
        if gesture.kind == "pull":
            self.let_go()
            return None
        if self._is_drag:
            return None
        hit, _ = self._under(x, y)
        if button != MIDDLE:
            if hit is not None and self._is_thing(hit):
                self.select(hit.model, hit.link)
            else:
                self.select(None)
        return hit

    def wheel(self, steps: float, x: float, y: float) -> None:
        """The wheel turns by ``steps``, forwards positive: nearer to what is under the pointer. During a pull: the
        thing goes away from the eye or comes nearer."""
        if self.pull:
            away = self.pull.target - self.eye.position
            self.pull = self.pull._replace(target=np.asarray(self.eye.position) + away * 1.05 ** steps)
            self.version += 1
            return
        self._look(self.eye.zoomed(self._under(x, y)[1], _ZOOM_PER_STEP ** steps))

    def let_go(self) -> None:
        """End a pull."""
        self.pull = None
        if self._gesture is not None and self._gesture.kind == "pull":
            self._gesture = None
        self.version += 1

    # -- keys and buttons -----------------------------------------------------------------------------------------

    def select(self, model: str | None, link: str = "") -> None:
        """Select a link of a model, a whole model, or, with None, nothing."""
        self.selected = (model, link) if model else None
        self.version += 1

    def follow(self, target: tuple[str, str] | None) -> None:
        """Let the eye move along with ``target``, (model, link), or with nothing for None."""
        self.followed, self._followed_at = target, None
        self._follow()

    def go_to_selected(self) -> None:
        """Look at the selected thing from nearby, in the present direction."""
        place = self.selected and self._centre(*self.selected)
        if place is not None:
            centre, radius = place
            ahead = self.eye.rotation()[:, 2]
            self._look(self.eye.at(centre - ahead * max(3.0 * radius, 0.3)))

    def home(self) -> None:
        """Look at the whole world again, or, if it is empty, from where Gazebo's camera is."""
        self._moved_by_user = False
        self.followed = None
        self._fit()

    def show(self, layer: str, on: bool) -> None:
        """Draw one of :data:`LAYERS`, or do not."""
        self.layers[layer] = on
        self.version += 1

    def take_contacts(self, contacts: Sequence[ShownContact]) -> None:
        """The present contacts, a list of :class:`world_window.overlay.ShownContact`; shown by the layer "contacts"."""
        self._contacts = contacts
        self.version += self.layers["contacts"]

    # -- inside ---------------------------------------------------------------------------------------------------

    @property
    def _bodies(self) -> Mapping[str, DrawnModel]:
        return {} if self._mirror is None else self._mirror.bodies

    def _look(self, eye):
        self.eye = eye
        self._moved_by_user = True
        self.version += 1

    def _fit(self):
        low, high = extent(self._mirror) if self._mirror is not None and self._has_things() else (None, None)
        if low is None:
            self.eye = FIRST_EYE
        else:
            missing = np.maximum(_MIN_VIEW_M - (high - low), 0.0) / 2.0
            position, target = overview(low - missing, high + missing, self.pinhole.width / self.pinhole.height,
                                        FIELD_OF_VIEW_RAD)
            self.eye = Eye.looking_at(position, target)
        self.version += 1

    def _has_things(self):
        return any(bounds_of(parts) is not None for body in self._bodies.values() for parts in body.parts)

    def _follow(self):
        if self.followed is None:
            return
        pose = self.link_pose(*self.followed)
        if pose is None:
            return
        place = pose[:3, 3].copy()
        if self._followed_at is not None and not np.allclose(place, self._followed_at, atol=1e-6):
            self.eye = self.eye.at(self.eye.position + (place - self._followed_at))
            self.version += 1
        self._followed_at = place

    def _drop_what_is_gone(self):
        for name in ("selected", "followed"):
            target = getattr(self, name)
            if target and self.link_pose(*target) is None:
                setattr(self, name, None)
        if self.pull and self.link_pose(self.pull.model, self.pull.link) is None:
            self.let_go()

    def _under(self, x, y):
        """(the :class:`picking.Hit` or None, a point on the ray through the pixel)."""
        origin, direction = picking.ray(self.pinhole, self.eye.pose(), x, y)
        hit = None if self._mirror is None else picking.first_hit(self._mirror, origin, direction)
        return hit, (origin + _EMPTY_M * direction if hit is None else hit.point)

    def _is_thing(self, hit):
        return not any(part.is_floor for parts in self._bodies[hit.model].parts for part in parts)

    def _can_move(self, hit):
        return self._is_thing(hit) and not self._bodies[hit.model].is_fixed(hit.link)

    def _pull_to(self, x, y):
        """The target moves in the plane through itself across the view."""
        pull, pose = self.pull, self.eye.pose()
        if pull is None:
            return
        place = picking.on_plane(*picking.ray(self.pinhole, pose, x, y), pull.target, pose[:3, 2])
        if place is not None:
            self.pull = pull._replace(target=place)
            self.version += 1

    def _centre(self, model, link):
        """(centre (3,), radius) of a link, or of the model's links; None if there is nothing to see."""
        body = self._bodies[model]
        boxes = []
        for name, parts, matrix in zip(body.link_names, body.parts, body.matrices, strict=True):
            found = bounds_of(parts) if link in ("", name) else None
            if found is not None:
                middle, half = (found[0] + found[1]) / 2.0, np.linalg.norm(found[1] - found[0]) / 2.0
                middle = matrix[:3, :3] @ middle + matrix[:3, 3]
                boxes += [middle - half, middle + half]
        if not boxes:
            return None
        low, high = np.min(boxes, axis=0), np.max(boxes, axis=0)
        return (low + high) / 2.0, float(np.max(high - low)) / 2.0

    @staticmethod
    def _draw_frames(overlay, body):
        for name, matrix in zip(body.link_names, body.matrices, strict=True):
            overlay.frame(matrix, name)

    @staticmethod
    def _draw_names(overlay, model, body, with_links):
        boxes = []
        for name, parts, matrix in zip(body.link_names, body.parts, body.matrices, strict=True):
            found = bounds_of(parts)
            if found is not None:
                boxes.append((name, *found, matrix))
        if with_links:
            for name, low, high, matrix in boxes:
                overlay.text(matrix[:3, :3] @ ((low + high) / 2.0) + matrix[:3, 3], name)
        elif boxes:
            tops = [matrix[:3, :3] @ ((low + high) / 2.0) + matrix[:3, 3]
                    + (0.0, 0.0, float(np.abs(matrix[2, :3]) @ (high - low)) / 2.0) for _, low, high, matrix in boxes]
            overlay.text(max(tops, key=lambda top: top[2]), model)

    def _draw_selection(self, overlay, model, link):
        body = self._bodies.get(model)
        if body is None:
            return
        for name, parts, matrix in zip(body.link_names, body.parts, body.matrices, strict=True):
            found = bounds_of(parts) if link in ("", name) else None
            if found is not None:
                overlay.box(*found, matrix)

