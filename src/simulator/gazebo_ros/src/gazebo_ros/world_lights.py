# SPDX-License-Identifier: BSD-3-Clause
"""The lights of the world: read from the world file, changed by services, listed for viewers. ROS-free."""
from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np
from lxml import etree

from gazebo_ros.entities import UnknownEntity
from sdf_model import SceneLook, SdfError, parse_light

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from typing import Any

    import numpy.typing as npt

    from sdf_model import Light
    from urdf_model import MergedRobot, Robot

# Of the numbers of a light, which viewers have in 32 bits.
_MOST = 1e9


class WorldLights:
    """Lights by name."""

    def __init__(self, lights: Sequence[Light], scene: SceneLook | None = None) -> None:
        """``lights``: list of ``sdf_model.Light``; ``scene``: ``sdf_model.Scene``."""
        self._lights = {light.name: light for light in lights}
        self._scene = scene or SceneLook()
        # A world file without lights is not dark: viewers choose the light. A world whose lights were deleted is dark.
        self._unlit = not lights
        #: Called when the list for viewers has changed.
        self.on_change = lambda: None

    def get(self, name: str) -> Light:
        """The ``sdf_model.Light``; raises :class:`UnknownEntity`."""
        try:
            return self._lights[name]
        except KeyError:
            raise UnknownEntity("light '%s' does not exist; lights: %s"
                                % (name, ", ".join(self._lights) or "none")) from None

    def change(self, name: str, **values: npt.ArrayLike) -> None:
        """Change some fields of a light; raises :class:`UnknownEntity`, and ``ValueError`` for values that are not
        finite or that 32 bits do not hold."""
        light = self.get(name)
        for key, value in values.items():
            if not (np.abs(np.asarray(value, dtype=float)) <= _MOST).all():
                raise ValueError("%s of light '%s' is %s, expected finite numbers up to %g" % (key, name, value, _MOST))
        self._lights[name] = dataclasses.replace(light, **values)
        self.on_change()

    def delete(self, name: str) -> None:
        """Take a light out of the world; raises :class:`UnknownEntity`."""
        self.get(name)
        del self._lights[name]
        self.on_change()

    def listed(self) -> dict[str, Any]:
        """The scene's entry of light: plain data.

        ``ambient``, ``background``: red, green, blue, or None to let the viewer choose; ``shadows``, ``sky``;
        ``lights``: a list of dictionaries, or None to let the viewer choose. Places and directions are the world's.
        """
        return {"ambient": self._scene.ambient, "background": self._scene.background, "shadows": self._scene.shadows,
                "sky": self._scene.sky,
                "lights": None if self._unlit else [_listed(light) for light in self._lights.values()]}


def _listed(light: Light) -> dict[str, Any]:
    return {"type": light.type, "place": light.pose[:3, 3].tolist(),
            "direction": (light.pose[:3, :3] @ light.direction).tolist(), "diffuse": list(light.diffuse[:3]),
            "specular": list(light.specular[:3]),
            "attenuation": list(light.attenuation), "range": light.range_m, "spot": light.spot,
            "cast_shadows": light.cast_shadows}


def lights_of_links(robot: Robot, merged: MergedRobot, warn: Callable[[str], object]) -> list[dict[str, Any]]:
    """The lights in links of a model, for its entry of the scene: as :meth:`WorldLights.listed` has them, with
    ``link``, the body's link in whose frame they are.

    ``robot``: ``urdf_model.Robot``; ``merged``: its MergedRobot. A light that cannot be read is left out, and
    ``warn(text)`` says why.
    """
    found = []
    for gazebo in robot.gazebo:
        for element in gazebo.findall("light"):
            link = gazebo.get("reference")
            try:
                light = parse_light(etree.tostring(element, with_tail=False), "a light of '%s'" % robot.name)
            except SdfError as error:
                warn(str(error))
                continue
            if link not in merged.frames:
                warn("light '%s' of '%s' is on '%s' and is left out; links: %s"
                     % (light.name, robot.name, link, ", ".join(robot.links)))
                continue
            frame = merged.frames[link]
            listed = _listed(dataclasses.replace(light, pose=frame.offset @ light.pose))
            found.append({**listed, "link": frame.link})
    return found
