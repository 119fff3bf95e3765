# SPDX-License-Identifier: BSD-3-Clause
"""Pictures on surfaces: where their files are, and what is kept of them. ROS-free."""
from __future__ import annotations

import json
import os
from pathlib import Path, PureWindowsPath
from typing import TYPE_CHECKING, NamedTuple
from urllib.parse import unquote, urlparse

import numpy as np

if TYPE_CHECKING:
    from PIL.Image import Image

#: Pixels of the longer side of a picture, at most; larger ones are reduced.
MAX_PIXELS = 1024
# Larger pictures are not read: they would take more memory than the process has.
_MAX_READ = 100_000_000
_FORMATS = ("PNG", "JPEG", "TGA", "BMP", "GIF", "TIFF")


class TextureError(Exception):
    """A picture that cannot be used."""


class Texture(NamedTuple):
    """``path``: a PNG file of at most :data:`MAX_PIXELS` a side; ``colour``: its mean (red, green, blue from 0 to
    1)."""

    path: str
    colour: tuple[float, ...]


def find_texture(name: str, folder: str | os.PathLike[str]) -> str | None:
    """The path of the picture that a mesh in ``folder`` names, or None.

    As in Gazebo it is beside the mesh, or in ``../materials/textures``. Exporters often write the path that it had on
    another machine: of that, the file's name counts.
    """
    folder = Path(folder)
    url = urlparse(name)
    text = unquote(url.path) if url.scheme == "file" else unquote(name)
    if text.startswith("-"):  # options of a Wavefront material
        text = text.split()[-1]
    for candidate in dict.fromkeys((text, text.replace("\\", "/"), PureWindowsPath(text).name)):
        for place in (folder, folder.parent / "materials" / "textures"):
            try:
                if candidate and (place / candidate).is_file():
                    return str(place / candidate)
            except (OSError, ValueError):  # a name that is too long, or holds a zero byte
                continue
    return None


def write_texture(path: str | os.PathLike[str], folder: str | os.PathLike[str]) -> None:
    """Write the picture at ``path`` into ``folder``: ``picture.png``, reduced, and ``picture.json`` with its mean
    colour. Raises :class:`TextureError`."""
    from PIL import Image

    try:
        with Image.open(path, formats=_FORMATS) as picture:
            if picture.width * picture.height > _MAX_READ:
                raise TextureError("it has %d x %d pixels; expected at most %d million"
                                   % (*picture.size, _MAX_READ // 1_000_000))
            reduced = save_reduced(picture, Path(folder) / "picture.png")
    except Image.DecompressionBombError:
        raise TextureError("it has more pixels than expected, at most %d million" % (_MAX_READ // 1_000_000)) from None
    except (OSError, SyntaxError, ValueError) as error:
        raise TextureError("it is no picture in one of the formats %s: %s" % (", ".join(_FORMATS), error)) from None
    pixels = np.asarray(reduced, dtype=float)[..., :3]
    colour = (pixels.mean(axis=(0, 1)) / 255.0).round(3).tolist()
    (Path(folder) / "picture.json").write_text(json.dumps(colour), encoding="utf-8")


def save_reduced(picture: Image, path: str | os.PathLike[str]) -> Image:
    """Write ``picture``, of Pillow, to the PNG file at ``path`` with at most :data:`MAX_PIXELS` a side; return it."""
    has_holes = picture.mode in ("RGBA", "LA", "PA") or "transparency" in picture.info
    reduced = picture.convert("RGBA" if has_holes else "RGB")
    reduced.thumbnail((MAX_PIXELS, MAX_PIXELS))
    reduced.save(path, compress_level=1)
    return reduced
