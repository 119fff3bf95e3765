# SPDX-License-Identifier: BSD-3-Clause
"""The light of the scene, from the world file's description. ROS-free."""
from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np

#: Largest number of lamps beside the sun; more are ignored. Of those that cast shadows, the strongest few do.
MAX_LAMPS, MAX_SHADOWS = 8, 2
#: Nearest distance to a lamp at which something casts a shadow [m].
LAMP_NEAR_M = 0.04
# The sun of a world without lights: direction, colour and specular colour of Gazebo's model "sun".
_SUN_DIRECTION, _SUN_DIFFUSE, _SUN_SPECULAR = (-0.5, 0.1, -0.9), (0.8, 0.8, 0.8), (0.2, 0.2, 0.2)
# Gazebo's grey ambient light, and a sky: its colours at the horizon and overhead.
_AMBIENT, _HORIZON, _ZENITH = (0.4, 0.4, 0.4), (0.78, 0.83, 0.88), (0.42, 0.58, 0.80)
# Gazebo's sun and ambient light together are brighter than white; this factor on a lamp's colour prevents it.
_EXPOSURE = 0.675
# Gazebo's sun has a specular colour of 0.2 only; with this factor, glossy things look it.
_SHINE = 3.0
_BLACK = (0.0, 0.0, 0.0)
# SDF's default of a light's specular colour.
_SPECULAR = (0.1, 0.1, 0.1)


class Lamp(NamedTuple):
    """A light beside the sun. ``type``: directional, point or spot; ``place`` (3): its position [m], or the direction
    that its parallel light comes from; ``colour``, ``shine`` (3): diffuse and specular; ``fade`` (4): constant, linear,
    quadratic, furthest [m]; ``beam`` (3): direction of a spot light; ``cone`` (3): cosines of half its inner and outer
    angle, falloff; ``shadow``: the row of its shadow maps, None for none."""

    type: str
    place: tuple[float, ...]
    colour: tuple[float, ...]
    shine: tuple[float, ...]
    fade: tuple[float, ...]
    beam: tuple[float, ...]
    cone: tuple[float, ...]
    shadow: int | None = None

    @property
    def kind(self) -> tuple[str, bool]:
        """The kind of shader that it needs."""
        return self.type, self.shadow is not None

    @property
    def far_m(self) -> float:
        """How far its shadow map reaches [m]."""
        return min(max(self.fade[3], 2.0 * LAMP_NEAR_M), 50.0)

    def uniforms(self) -> dict[str, Any]:
        """{name of the uniform: value}."""
        near, far = LAMP_NEAR_M, self.far_m
        # Depth in the map of the distance m along the axis: the first minus the second through m.
        depth = 0.5 + 0.5 * (far + near) / (far - near), far * near / (far - near)
        return {"lamp_place": (*self.place, 1.0), "lamp_colour": self.colour, "lamp_shine": self.shine,
                "lamp_fade": (*self.fade[:3], min(self.fade[3], 1e9)), "lamp_beam": self.beam, "lamp_cone": self.cone,
                "lamp_depth": (*depth, float(self.shadow or 0), float(MAX_SHADOWS))}


class SceneLight(NamedTuple):
    """``ambient``, ``background`` (3); ``sky``: whether there is one instead of the background; ``to_sun`` (3): the
    unit vector to the sun, which is the first directional light that casts shadows; ``sun``, ``sun_shine`` (3): its
    diffuse and specular colour, black for none; ``shadows``: whether it casts any; ``lamps``: all others,
    :class:`Lamp`."""

    ambient: tuple[float, ...]
    background: tuple[float, ...]
    sky: bool
    to_sun: tuple[float, ...]
    sun: tuple[float, ...]
    sun_shine: tuple[float, ...]
    shadows: bool
    lamps: tuple[Lamp, ...]

    horizon = property(lambda self: _HORIZON if self.sky else self.background, doc="The sky's colour at the horizon.")
    zenith = property(lambda self: _ZENITH if self.sky else self.background, doc="The sky's colour overhead.")

    @classmethod
    def of_scene(cls, listed: Mapping[str, Any], more: Iterable[Mapping[str, Any]] = ()) -> SceneLight:
        """``listed`` as from :meth:`gazebo_ros.world_lights.WorldLights.listed`; missing values get the defaults.
        ``more``: lights beside those, in the same form."""
        lights = listed.get("lights")
        if lights is None:
            lights = [{"type": "directional", "direction": _SUN_DIRECTION, "diffuse": _SUN_DIFFUSE,
                       "specular": _SUN_SPECULAR, "cast_shadows": True}]
        lights = [light for light in [*lights, *more] if light["type"] != "directional" or any(light["direction"])]
        suns = sorted((light for light in lights if light["type"] == "directional"),
                      key=lambda light: not light["cast_shadows"])
        sun = suns[0] if suns else {"direction": _SUN_DIRECTION, "diffuse": _BLACK, "specular": _BLACK,
                                    "cast_shadows": False}
        shadows = listed.get("shadows", True)
        background = listed.get("background")
        return cls(tuple(listed.get("ambient") or _AMBIENT), tuple(background or _HORIZON),
                   bool(listed.get("sky") or not background), _to(sun["direction"]), _colour(sun), _shine(sun),
                   bool(sun["cast_shadows"] and shadows),
                   _lamps([light for light in lights if light is not sun][:MAX_LAMPS], shadows))


def _lamps(lights, shadows):
    """The list of :class:`Lamp`; the strongest of those that cast shadows get the maps."""
    casting = [number for number, light in enumerate(lights)
               if shadows and light["cast_shadows"] and light["type"] != "directional"]
    casting = sorted(casting, key=lambda number: -sum(lights[number]["diffuse"]))[:MAX_SHADOWS]
    return tuple(_lamp(light, casting.index(number) if number in casting else None)
                 for number, light in enumerate(lights))


def _lamp(light, shadow):
    colour, shine = _colour(light), _shine(light)
    if light["type"] == "directional":
        return Lamp("directional", _to(light["direction"]), colour, shine, (1.0, 0.0, 0.0, math.inf), (0.0, 0.0, 1.0),
                    (-1.0, -2.0, 1.0))
    beam, cone = (0.0, 0.0, -1.0), (-1.0, -2.0, 1.0)
    if light["type"] == "spot":
        inner, outer, falloff = light["spot"] or (0.0, 0.0, 0.0)
        beam = tuple(-value for value in _to(light["direction"]))
        outer_cosine = math.cos(outer / 2.0)
        cone = (max(math.cos(inner / 2.0), outer_cosine + 1e-4), outer_cosine, falloff or 1.0)
    return Lamp("spot" if light["type"] == "spot" else "point", tuple(light["place"]), colour, shine,
                (*light["attenuation"], light["range"]), beam, cone, shadow)


def _to(direction):
    """The unit vector against ``direction``; straight up for one without length."""
    vector = -np.asarray(direction, dtype=float)
    length = np.linalg.norm(vector)
    return tuple((vector / length).tolist()) if length > 1e-9 else (0.0, 0.0, 1.0)


def _colour(light):
    return tuple(_EXPOSURE * value for value in light["diffuse"])


def _shine(light):
    return tuple(_SHINE * _EXPOSURE * value for value in light.get("specular", _SPECULAR))
