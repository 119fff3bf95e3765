# SPDX-License-Identifier: BSD-3-Clause
"""The <material> of a visual, and the material scripts that it names."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from urdf_model import Finish, bounds, read_file
from urdf_model.materials import GLOWS, MATERIALS

from .lights import Rgba, colour
from .ogre_script import parse_materials

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from lxml import etree

    from .document import Document
    from .folders import ModelFolders
    from .ogre_script import Material

# A folder of scripts with more files is not one of a model.
_MAX_SCRIPTS = 100


@dataclass(frozen=True)
class Look:
    """Colour (rgba) and Finish of a material; None where it says nothing."""

    colour: Rgba | None = None
    finish: Finish | None = None


class MaterialScripts:
    """The materials in scripts beside the models. Each script is read once."""

    def __init__(self, folders: ModelFolders) -> None:
        """``folders``: ModelFolders, in which the names of scripts are looked up."""
        self._folders = folders
        self._read: dict[Path, dict[str, Material]] = {}

    def find(self, name: str, uris: Iterable[str], base: str | Path | None) -> Look | None:
        """Return the Look of the material ``name`` in the scripts ``uris``, or None.

        ``uris`` name scripts, or folders with scripts and with textures; relative ones begin in the folder ``base``.
        """
        places = [next(filter(_is_there, self._folders.places(uri, base)), None) for uri in uris]
        places = [place for place in places if place is not None]
        for place in places:
            scripts = sorted(place.glob("*.material"))[:_MAX_SCRIPTS] if place.is_dir() else [place]
            materials = {}
            for script in scripts:
                materials.update(self._materials_of(script))
            if name in materials:
                # Ogre has one list of all textures; the usual folders are these.
                folder = place if place.is_dir() else place.parent
                return _look(materials[name], [*filter(Path.is_dir, places), folder.parent / "textures", folder])
        return None

    def picture(self, uri: str, base: str | Path | None) -> str:
        """Return the path of the picture ``uri``; relative ones begin in the folder ``base``."""
        places = self._folders.places(uri, base)
        return str(next(filter(_is_there, places), places[0]).absolute()) if places else uri

    def _materials_of(self, script: Path) -> dict[str, Material]:
        if script not in self._read:
            try:
                text = read_file(script, bounds.DESCRIPTION_BYTES).decode("utf-8", "replace")
            except OSError:
                text = ""
            self._read[script] = parse_materials(text)
        return self._read[script]


def _look(material: Material, folders: Sequence[Path]) -> Look:
    """The Look of an ``ogre_script.Material`` with textures in ``folders``; a texture that is in none of them is named
    in the first one, so that the renderer can say what is missing."""
    found = [path for path in (folder / material.texture for folder in folders) if _is_there(path)]
    path = found[0] if found else folders[0] / material.texture
    finish = Finish(material.emission, None if material.specular is None else max(material.specular),
                    str(path.absolute()) if material.texture else "", material.repeats, material.cut_out,
                    material.two_sided)
    rgb = material.diffuse or (None if material.texture else material.ambient)
    if rgb is None and material.texture:
        rgb = (1.0, 1.0, 1.0)  # Ogre's default, with which a picture is shown as it is
    return Look(None if rgb is None else (*rgb, 1.0), None if finish == Finish() else finish)


def _is_there(path: Path) -> bool:
    try:
        return path.exists()
    except OSError:  # a name that is too long
        return False


def read_material(document: Document, visual: etree._Element,
                  materials: MaterialScripts) -> tuple[Rgba | None, Finish | None]:
    """Return (rgba or None, Finish or None) of a <visual>. ``materials``: MaterialScripts.

    Colours in the <material> itself come before those of the script that it names, as in Gazebo.
    """
    element, rgba, finish = visual.find("material"), None, None
    if element is not None:
        look = _scripted(element, document, materials)
        rgba, finish = look.colour, look.finish or Finish()
        for tag in ("ambient", "diffuse"):
            rgba = colour(document, element, tag, rgba)
        emission, specular = (colour(document, element, tag, None) for tag in ("emissive", "specular"))
        if emission is not None:
            finish = replace(finish, emission=tuple(min(max(value, 0.0), 1.0) for value in emission[:3]))
        if specular is not None:
            finish = replace(finish, gloss=min(max(0.0, *specular[:3]), 1.0))
        # As newer simulators have it.
        maps = ["", *((found.text or "").strip() for found in element.iterfind("pbr/*/albedo_map"))]
        if maps[-1] and not finish.texture:
            finish = replace(finish, texture=materials.picture(maps[-1], document.folder))
        finish = None if finish == Finish() else finish
    clear = document.number(visual, "transparency", 0.0)
    if clear:
        rgba = rgba or (0.7, 0.7, 0.7, 1.0)
        rgba = (*rgba[:3], rgba[3] * min(max(1.0 - clear, 0.0), 1.0))
    return rgba, finish


def _scripted(element: etree._Element, document: Document, materials: MaterialScripts) -> Look:
    name = (element.findtext("script/name") or "").strip()
    uris = [(uri.text or "").strip() for uri in element.iterfind("script/uri")]
    found = materials.find(name, [uri for uri in uris if uri], document.folder) if name else None
    if found is None:
        found = Look(MATERIALS.get(name), Finish(emission=GLOWS[name]) if name in GLOWS else None)
    return found
