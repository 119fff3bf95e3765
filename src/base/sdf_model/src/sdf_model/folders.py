# SPDX-License-Identifier: BSD-3-Clause
"""Finds the models that ``model://NAME`` names."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

from urdf_model import XmlRefused, bounds, parse_xml, read_file

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping


class ModelFolders:
    """A path of folders, each with a folder per model; the first that has a model wins.

    ``sizes``: {model name: its replacement if no folder has it}, a dictionary with "box" (x, y, z), "cylinder"
    (radius, length) or "sphere" (radius,) [m], "centre" (3,) [m] of that in the model, and "mass" [kg]; without a mass
    it stands fast.
    """

    def __init__(self, folders: Iterable[str | Path], sizes: Mapping[str, Mapping[str, Any]] | None = None) -> None:
        self.folders = [Path(folder) for folder in folders]
        self._sizes = sizes or {}

    def stand_in(self, uri: str) -> str | None:
        """Return the SDF text of the replacement of the model ``uri`` (model://NAME), or None."""
        scheme, _, rest = uri.partition("://")
        name = rest.partition("/")[0]
        return _of_size(name, self._sizes[name]) if scheme == "model" and name in self._sizes else None

    def find(self, uri: str, base: str | Path | None = None) -> Path | None:
        """Return the description file (Path) that ``uri`` names, or None.

        ``uri``: model://NAME, model://NAME/FILE, file://PATH or a path, relative ones to the folder ``base``; a
        folder stands for the description in it.
        """
        for path in self.places(uri, base):
            if path.is_file():
                return path
            found = description_file(path)
            if found is not None:
                return found
        return None

    def places(self, uri: str, base: str | Path | None = None) -> list[Path]:
        """Return the Paths that ``uri`` may mean, as :meth:`find` has it; the first that exists is meant."""
        scheme, separator, rest = uri.partition("://")
        if not separator:
            return [Path(base or ".") / uri, *(folder / uri for folder in self.folders)]
        if scheme == "model":
            return [folder / rest for folder in self.folders]
        if scheme == "file":
            return [Path(rest)] if rest.startswith("/") else [folder / rest for folder in self.folders]
        return []


_SHAPES = {"box": "<box><size>%g %g %g</size></box>",
           "cylinder": "<cylinder><radius>%g</radius><length>%g</length></cylinder>",
           "sphere": "<sphere><radius>%g</radius></sphere>"}


def _of_size(name: str, size: Mapping[str, Any]) -> str:
    kind = next(kind for kind in _SHAPES if kind in size)
    shape = _SHAPES[kind] % tuple(size[kind])
    # The inertia of the box around it.
    x, y, z = {"box": lambda sides: sides, "cylinder": lambda r: (2 * r[0], 2 * r[0], r[1]),
               "sphere": lambda r: (2 * r[0],) * 3}[kind](size[kind])
    mass = size.get("mass")
    weight = "" if mass is None else (
        "<inertial><mass>%g</mass><inertia><ixx>%g</ixx><iyy>%g</iyy><izz>%g</izz></inertia></inertial>"
        % (mass, mass * (y * y + z * z) / 12.0, mass * (x * x + z * z) / 12.0, mass * (x * x + y * y) / 12.0))
    parts = "".join('<%s name="%s"><geometry>%s</geometry></%s>' % (tag, tag, shape, tag)
                    for tag in ("collision", "visual"))
    return ('<sdf version="1.6"><model name="%s"><static>%d</static><link name="link"><pose>%g %g %g 0 0 0</pose>%s%s'
            "</link></model></sdf>" % (name, mass is None, *size["centre"], weight, parts))


def description_file(folder: str | Path) -> Path | None:
    """Return the SDF (Path) in a model's folder, or None.

    model.config names it, with several the one of the highest version; without model.config it is model.sdf.
    """
    folder = Path(folder)
    named = []
    try:
        manifest = parse_xml(read_file(folder / "model.config", bounds.DESCRIPTION_BYTES))
        for element in () if manifest is None else manifest.iterchildren("sdf"):
            version = tuple(int(word) for word in re.findall(r"\d+", element.get("version", "")))
            named.append((version, folder / (element.text or "").strip()))
    except (OSError, XmlRefused):
        named = []
    for _, path in [*sorted(named, reverse=True), ((), folder / "model.sdf")]:
        if path.is_file():
            return path
    return None
