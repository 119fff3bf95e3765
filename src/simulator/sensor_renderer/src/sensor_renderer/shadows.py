# SPDX-License-Identifier: BSD-3-Clause
"""Shadow maps: the sun's, fitted to what a camera sees, and those of the strongest lamps. ROS-free."""
from __future__ import annotations

import math
import weakref
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from sensor_renderer.light import LAMP_NEAR_M, MAX_SHADOWS
from sensor_renderer.programs import draw, matrix_bytes, uniform

if TYPE_CHECKING:
    import moderngl

    from sensor_renderer.drawn_links import DrawnLink
    from sensor_renderer.light import SceneLight
    from sensor_renderer.mirror import Mirror
    from sensor_renderer.pinhole import Pinhole

# Half of the map's side in the world [m] grows in steps of this factor, so that it seldom changes while a camera moves.
_STEP = 2.0 ** 0.25
_MIN_HALF_M, _MAX_HALF_M = 1.0, 8.0
# How far behind the furthest thing that casts shadows a camera sees any on the floor [m].
_BEYOND_M = 1.5
# A picture whose pixels see more than a texel of a map of everything, at this distance [m], is shaded by such a map:
# all small pictures of a state share it, and it is exactly of that state.
_SMALL_AT_M = 0.5
# Texels along the map's border to which nothing is drawn: outside of the map is no shadow.
_BORDER = 3
# Surfaces are compared this many texels of the map outside of themselves: else lit ones are specked.
_MARGIN_TEXELS = 1.0
# From texture coordinates of -1 to 1 to those of 0 to 1.
_SIGNS = np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
_HALVED = np.diag([0.5, 0.5, 0.5, 1.0])
_HALVED[:3, 3] = 0.5


class Shadows:
    """The maps of one context. ``to_map`` (4, 4): from the world to texture coordinates 0 to 1 of the sun's map;
    ``corners``: those of the sun's map (4, 3) in the world, and the direction (3) along which their column extends;
    ``margin_m``: how far outside of a surface to compare; ``lamp_matrices``: {number of a spot light: (4, 4) from the
    world to texture coordinates of its map}."""

    def __init__(self, context: moderngl.Context, program: moderngl.Program, pixels: int, taps: int,
                 one_sided: bool = False) -> None:
        """``program``: the one that draws depth alone; ``pixels``: the side of the sun's map; ``taps``: comparisons
        along one side of a filter's square; ``one_sided``: whether casters throw shadows by their fronts alone."""
        self._one_sided = one_sided
        self._context = context
        self._program = program
        self._pixels, self._taps = pixels, taps
        self._map, self._buffer = self._depth_map(pixels, pixels)
        self._lamp_map: moderngl.Texture | None = None
        self._lamp_buffer: moderngl.Framebuffer | None = None
        self._drawn = self._lamps_drawn = None
        self._poses = _Poses([])
        # Axes of the sun's map, by light_by().
        self._right: np.ndarray
        self._up: np.ndarray
        self._away: np.ndarray
        self.to_map, self.margin_m, self.lamp_matrices = np.eye(4), 0.0, {}
        self.corners = np.zeros((4, 3)), np.array((0.0, 0.0, 1.0))

    def light_by(self, light: SceneLight) -> None:
        """Point the maps along the light of ``light``."""
        self._drawn = self._lamps_drawn = None
        self._away = away = np.array(light.to_sun)
        right = np.cross((0.0, 1.0, 0.0) if abs(away[1]) < 0.9 else (1.0, 0.0, 0.0), away)
        self._right = right / np.linalg.norm(right)
        self._up = np.cross(away, self._right)
        if self._lamp_map is None and any(lamp.shadow is not None for lamp in light.lamps):
            side = self._pixels // 2
            self._lamp_map, self._lamp_buffer = self._depth_map(6 * side, MAX_SHADOWS * side)

    def draw(self, mirror: Mirror, casters: Sequence[tuple[DrawnLink, np.ndarray, np.ndarray]], pinhole: Pinhole,
             pose: np.ndarray) -> bool:
        """Draw the maps for the view of a camera at ``pose`` (4, 4). ``casters``: (link, matrix, packed matrix) of all
        that casts shadows. Returns whether the matrices have changed."""
        light = mirror.light
        # Not by id(): a new object often gets the address of a deleted one.
        now = weakref.ref(mirror), mirror.version
        changed = False
        spheres = _spheres(casters)
        if light.shadows and any(light.sun):
            changed = self._draw_sun(casters, spheres, pinhole, pose)
        if self._lamps_drawn != now and self._lamp_buffer is not None:
            self._lamps_drawn = now
            self._draw_lamps(self._lamp_buffer, light, casters, spheres)
            changed = True
        return changed

    def use(self) -> None:
        """Bind the maps to their texture units."""
        self._map.use(0)
        if self._lamp_map is not None:
            self._lamp_map.use(2)

    def _draw_sun(self, casters, spheres, pinhole, pose):
        turn = np.array([self._right, self._up, self._away])
        places, radii = spheres[0] @ turn.T, spheres[1]
        low, high = self._extent(places, radii)
        half, texel = self._sides(low, high)
        shared = texel * max(pinhole.fx, pinhole.fy) <= _SMALL_AT_M
        if not shared:
            low, high = self._region(spheres, low, high, pinhole, pose)
            half, texel = self._sides(low, high)
        centre = np.round((low + high) / 2.0 / texel) * texel
        if self._drawn == (half, *centre) and not self._poses.moved(casters, 0.0 if shared else texel / 2.0):
            return False
        self._drawn = (half, *centre)
        self._poses = _Poses(casters)
        inside = (np.abs(places[:, :2] - centre) < half + radii[:, None]).all(axis=1)
        bottom = float((places[:, 2] - radii)[inside].min(initial=0.0))
        top = float((places[:, 2] + radii)[inside].max(initial=0.1))
        self.corners = ((centre + half * _SIGNS) @ turn[:2], self._away)
        to_clip = np.eye(4)
        to_clip[:3, :3] = turn * np.array([[1.0 / half], [1.0 / half], [-2.0 / (top - bottom)]])
        to_clip[:3, 3] = -centre[0] / half, -centre[1] / half, (top + bottom) / (top - bottom)
        inside_border = np.diag([*[1.0 - 2.0 * _BORDER / self._pixels] * 2, 1.0, 1.0])
        self.to_map = _HALVED @ inside_border @ to_clip
        self.margin_m = (_MARGIN_TEXELS + 0.5 * self._taps) * texel
        self._buffer.use()
        self._buffer.viewport = 0, 0, self._pixels, self._pixels
        self._buffer.clear(depth=1.0)
        inner = self._pixels - 2 * _BORDER
        self._buffer.viewport = _BORDER, _BORDER, inner, inner
        if self._one_sided:
            # This map is not upside down, as pictures are.
            self._context.front_face = "ccw"
            self._context.enable(self._context.CULL_FACE)
        self._draw_from(to_clip, [casters[k] for k in np.flatnonzero(inside)])
        if self._one_sided:
            self._context.disable(self._context.CULL_FACE)
            self._context.front_face = "cw"
        return True

    def _extent(self, places, radii):
        """Corners (2), (2) along the map's axes of all that casts shadows."""
        if not len(radii):
            return np.zeros(2), np.zeros(2)
        return (places[:, :2] - radii[:, None]).min(axis=0), (places[:, :2] + radii[:, None]).max(axis=0)

    def _sides(self, low, high):
        """Half of the side of a map with these corners in it, and its texels' side [m]."""
        half = float(np.clip(np.max(high - low) / 2.0, _MIN_HALF_M, _MAX_HALF_M))
        half = _STEP ** math.ceil(math.log(half, _STEP) - 1e-9)
        return half, 2.0 * half / (self._pixels - 2 * _BORDER)

    def _region(self, spheres, low, high, pinhole, pose):
        """Of these corners, those of what a camera may see shaded: in its view and in some shadow."""
        centres, radii = spheres
        if not len(radii):
            return low, high
        reach = float(((centres - pose[:3, 3]) @ pose[:3, 2] + radii).max()) + _BEYOND_M
        reach = min(max(reach, 0.1), pinhole.far)
        sides = np.array([(u, v) for u in (-0.5, pinhole.width - 0.5) for v in (-0.5, pinhole.height - 0.5)])
        rays = np.column_stack(((sides - (pinhole.cx, pinhole.cy)) / (pinhole.fx, pinhole.fy), np.ones(4)))
        ends = rays @ pose[:3, :3].T
        # A ray ends on the floor.
        to_floor = -pose[2, 3] / np.minimum(ends[:, 2], -1e-9)
        ends *= np.minimum(reach, np.where(to_floor > 0.0, to_floor, reach))[:, None]
        corners = np.vstack((pose[:3, 3], pose[:3, 3] + ends)) @ np.array([self._right, self._up]).T
        low, high = np.maximum(low, corners.min(axis=0)), np.minimum(high, corners.max(axis=0))
        return (low, high) if (low < high).all() else (low, low)

    def _draw_lamps(self, buffer, light, casters, spheres):
        buffer.use()
        buffer.clear(depth=1.0)
        self.lamp_matrices = {}
        side = self._pixels // 2
        for number, lamp in enumerate(light.lamps):
            if lamp.shadow is None:
                continue
            away = spheres[0] - lamp.place
            near = [casters[k] for k in np.flatnonzero(np.linalg.norm(away, axis=1) - spheres[1] < lamp.far_m)]
            clips = [_spot_clip(lamp)] if lamp.type == "spot" else _point_clips(lamp)
            for column, clip in enumerate(clips):
                buffer.viewport = column * side, lamp.shadow * side, side, side
                self._draw_from(clip, near)
            if lamp.type == "spot":
                tile = np.diag([1.0 / 6.0, 1.0 / MAX_SHADOWS, 1.0, 1.0])
                tile[1, 3] = lamp.shadow / MAX_SHADOWS
                self.lamp_matrices[number] = tile @ _HALVED @ clips[0]
        buffer.viewport = 0, 0, 6 * side, MAX_SHADOWS * side

    def _draw_from(self, to_clip, casters):
        uniform(self._program, "to_clip").write(matrix_bytes(to_clip))
        draw(self._program, [(link.caster, packed) for link, _, packed in casters])

    def _depth_map(self, width, height):
        depth = self._context.depth_texture((width, height))
        depth.compare_func = "<="
        # Between four comparisons: edges are soft.
        depth.filter = (self._context.LINEAR, self._context.LINEAR)
        depth.repeat_x = depth.repeat_y = False
        return depth, self._context.framebuffer(depth_attachment=depth)


class _Poses:
    """The poses that a map was drawn of."""

    def __init__(self, casters: Sequence[tuple[DrawnLink, np.ndarray, np.ndarray]]) -> None:
        self._links = [link for link, _, _ in casters]
        self._matrices = np.array([matrix for _, matrix, _ in casters])

    def moved(self, casters: Sequence[tuple[DrawnLink, np.ndarray, np.ndarray]], tolerance_m: float) -> bool:
        """Whether ``casters`` are others, or some point of them is more than ``tolerance_m`` away from where it was."""
        if len(casters) != len(self._links):
            return True
        if any(link is not then for (link, _, _), then in zip(casters, self._links, strict=True)):
            return True
        if not casters:
            return False
        turned = np.array([matrix for _, matrix, _ in casters]) - self._matrices
        reach = np.array([np.linalg.norm(link.centre) + link.radius for link in self._links])
        turned[:, :3, :3] *= reach[:, None, None]
        return bool(np.linalg.norm(turned[:, :3], axis=(1, 2)).max() > tolerance_m)


def _spheres(casters):
    """Centres (n, 3) in the world and radii (n) of what casts shadows [m]."""
    if not casters:
        return np.zeros((0, 3)), np.zeros(0)
    matrices = np.array([matrix for _, matrix, _ in casters])
    centres = np.array([link.centre for link, _, _ in casters])
    centres = np.einsum("nij,nj->ni", matrices[:, :3, :3], centres) + matrices[:, :3, 3]
    return centres, np.array([link.radius for link, _, _ in casters])


def _point_clips(lamp):
    """From the world to clip space, for the sides x, -x, y, -y, z, -z of the cube around a point light."""
    clips = []
    for axis, others in ((0, (1, 2)), (1, (0, 2)), (2, (0, 1))):
        for sign in (1.0, -1.0):
            # A little wider than the side, so that its edge is filtered within its map.
            clips.append(_perspective(lamp, np.eye(3)[others[0]] * 0.98, np.eye(3)[others[1]] * 0.98,
                                      sign * np.eye(3)[axis]))
    return clips


def _spot_clip(lamp):
    ahead = np.array(lamp.beam)
    right = np.cross(ahead, (0.0, 0.0, 1.0) if abs(ahead[2]) < 0.9 else (1.0, 0.0, 0.0))
    right /= np.linalg.norm(right)
    cosine = max(lamp.cone[1], 0.1)
    wide = 0.95 * cosine / math.sqrt(1.0 - min(cosine, 0.999) ** 2)
    return _perspective(lamp, wide * right, wide * np.cross(ahead, right), ahead)


def _perspective(lamp, right, up, ahead):
    near, far = LAMP_NEAR_M, lamp.far_m
    turned = np.array([right, up, (far + near) / (far - near) * ahead, ahead])
    clip = np.column_stack((turned, -turned @ lamp.place))
    clip[2, 3] -= 2.0 * far * near / (far - near)
    return clip
