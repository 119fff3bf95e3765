# SPDX-License-Identifier: BSD-3-Clause
"""The light of the scene, from the world file's description. ROS-free."""
import math
from typing import NamedTuple

import numpy as np

#: Largest number of lamps beside the sun; more are ignored.
MOST_LAMPS = 8
# The sun of a world without lights: direction of its light, its colour (from Gazebo's model "sun").
_SUN_DIRECTION, _SUN_DIFFUSE = (-0.5, 0.1, -0.9), (0.8, 0.8, 0.8)
# Defaults of a world: Gazebo's grey ambient light, and a sky.
_AMBIENT, _SKY = (0.4, 0.4, 0.4), (0.62, 0.70, 0.80)
# Gazebo's sun and ambient light together are brighter than white; this factor on a lamp's colour prevents it.
_EXPOSURE = 0.675


class Lamp(NamedTuple):
    """A light without a shadow. ``place`` (4): its position [m] and 1, or the direction that its parallel light comes
    from and 0; ``colour`` (3); ``fade`` (4): constant, linear, quadratic, furthest [m]; ``beam`` (3): direction of a
    spot light; ``cone`` (3): cosines of half its inner and outer angle, falloff. A light to all sides has a cone of -1,
    -2."""

    place: tuple
    colour: tuple
    fade: tuple
    beam: tuple
    cone: tuple


class Light(NamedTuple):
    """``ambient``, ``background`` (3); ``to_sun`` (3): the unit vector to the sun, which is the first directional light
    that casts shadows; ``sun`` (3): its colour, black for none; ``shadows``: whether it casts any; ``lamps``: all
    others, :class:`Lamp`."""

    ambient: tuple
    background: tuple
    to_sun: tuple
    sun: tuple
    shadows: bool
    lamps: tuple

    @classmethod
    def of_scene(cls, listed):
        """``listed`` as from :meth:`gazebo_ros.world_lights.WorldLights.listed`; missing values get the defaults."""
        lights = listed.get("lights")
        if lights is None:
            lights = [{"type": "directional", "direction": _SUN_DIRECTION, "diffuse": _SUN_DIFFUSE,
                       "cast_shadows": True}]
        lights = [light for light in lights if light["type"] != "directional" or any(light["direction"])]
        suns = sorted((light for light in lights if light["type"] == "directional"),
                      key=lambda light: not light["cast_shadows"])
        sun = suns[0] if suns else {"direction": _SUN_DIRECTION, "diffuse": (0.0, 0.0, 0.0), "cast_shadows": False}
        lamps = [_lamp(light) for light in lights if light is not sun][:MOST_LAMPS]
        return cls(tuple(listed.get("ambient") or _AMBIENT), tuple(listed.get("background") or _SKY),
                   _to(sun["direction"]), _colour(sun), bool(sun["cast_shadows"] and listed.get("shadows", True)),
                   tuple(lamps))


def _lamp(light):
    if light["type"] == "directional":
        return Lamp((*_to(light["direction"]), 0.0), _colour(light), (1.0, 0.0, 0.0, math.inf), (0.0, 0.0, 1.0),
                    (-1.0, -2.0, 1.0))
    beam, cone = (0.0, 0.0, -1.0), (-1.0, -2.0, 1.0)
    if light["type"] == "spot":
        inner, outer, falloff = light["spot"] or (0.0, 0.0, 0.0)
        beam = tuple(-value for value in _to(light["direction"]))
        outer_cosine = math.cos(outer / 2.0)
        cone = (max(math.cos(inner / 2.0), outer_cosine + 1e-4), outer_cosine, falloff or 1.0)
    return Lamp((*light["place"], 1.0), _colour(light), (*light["attenuation"], light["range"]), beam, cone)


def _to(direction):
    """The unit vector against ``direction``; straight up for one without length."""
    vector = -np.asarray(direction, dtype=float)
    length = np.linalg.norm(vector)
    return tuple((vector / length).tolist()) if length > 1e-9 else (0.0, 0.0, 1.0)


def _colour(light):
    return tuple(_EXPOSURE * value for value in light["diffuse"])
