# SPDX-License-Identifier: BSD-3-Clause
"""The content of mesh files, split by what it looks like. ROS-free."""
from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from bullet_sim.mesh_loading import WHOLE, load_scene

if TYPE_CHECKING:
    from PIL.Image import Image

# Brightness of Collada meshes that name no material: the one of assimp, by which rviz shows them.
_PLAIN_COLOUR = (0.6, 0.6, 0.6, 1.0)
# An emission this close to the diffuse colour repeats it.
_SAME = 0.01
# A diffuse colour below this would make a picture black; some exporters write it beside each picture.
_BLACK = 0.05


_DARK = (0.0, 0.0, 0.0)


class PieceError(Exception):
    """A mesh without triangles."""


class Piece(NamedTuple):
    """Triangles that look alike: ``vertices`` (n, 3), ``faces`` (m, 3); ``colour`` (red, green, blue, alpha from 0 to
    1) or None, with a texture the factor of its colours; ``emission`` (red, green, blue); ``texture``: the name of a
    picture as the file has it, or ""; ``uv`` (n, 2): the vertices' places in a picture, from its upper left corner to
    the right and down, in widths and heights of it; None if the file has none. ``picture``: the picture itself (of
    Pillow), if it is inside of the file; then ``texture`` is a number in it."""

    vertices: np.ndarray
    faces: np.ndarray
    colour: tuple[float, ...] | None
    emission: tuple[float, ...] = _DARK
    texture: str = ""
    uv: np.ndarray | None = None
    picture: Image | None = None


def read_pieces(path: str, part: tuple[str, bool] = WHOLE, textured: bool = False) -> list[Piece]:
    """The list of :class:`Piece` of the mesh file at ``path``, one for each look; ``part``: as for ``load_scene``.
    ``textured``: whether all pieces have ``uv``, if the file has, or only those with a picture. Raises
    :class:`PieceError`, and what ``load_scene`` raises."""
    import trimesh

    plain = _PLAIN_COLOUR if str(path).lower().endswith(".dae") else None
    scene = load_scene(path, part, textures=True)
    alike: dict[tuple[Any, Any, str, bool], list[tuple[np.ndarray, np.ndarray, np.ndarray | None]]] = {}
    inside: dict[str, Any] = {}
    for node in scene.graph.nodes_geometry:
        transform, name = scene.graph[node]
        mesh = scene.geometry[name]
        if len(getattr(mesh, "faces", ())) == 0:
            continue
        uv = _uv(mesh)
        texture = "" if uv is None else _texture(mesh, inside)
        if not texture and not textured:
            uv = None  # meshes of one colour are one piece
        colour = _factor(mesh) if texture else _colour(mesh) or plain
        look = colour, _emission(mesh, colour, texture), texture, uv is not None
        vertices, faces = trimesh.transform_points(mesh.vertices, transform), np.asarray(mesh.faces)
        if np.linalg.det(transform[:3, :3]) < 0.0:
            faces = faces[:, ::-1]  # a mirrored surface is seen from outside, too
        alike.setdefault(look, []).append((vertices, faces, uv))
    if not alike:
        raise PieceError("it holds no triangles")
    return [_joined(*look, meshes, inside.get(look[2])) for look, meshes in alike.items()]


def _joined(colour, emission, texture, has_uv, meshes, picture):
    starts = np.cumsum([0] + [len(vertices) for vertices, _, _ in meshes[:-1]])
    faces = [faces + start for (_, faces, _), start in zip(meshes, starts, strict=True)]
    return Piece(np.concatenate([vertices for vertices, _, _ in meshes]), np.concatenate(faces), colour, emission,
                 texture, np.concatenate([uv for _, _, uv in meshes]) if has_uv else None, picture)


def _uv(mesh):
    """The vertices' places in a picture, or None. Files count upwards from the lower left corner."""
    uv = getattr(mesh.visual, "uv", None)
    if uv is None or len(uv) != len(mesh.vertices) or not np.isfinite(uv).all():
        return None
    return np.asarray(uv, dtype=float)[:, :2] * (1.0, -1.0) + (0.0, 1.0)


def _texture(mesh, inside):
    """The name of the mesh's picture, or "". Pictures inside of the file are added to ``inside``, by their names."""
    material = getattr(mesh.visual, "material", None)
    picture = getattr(material, "baseColorTexture", None) or getattr(material, "image", None)
    if picture is None:
        return ""
    name = getattr(picture, "info", {}).get("name", "")
    if name:
        return name
    name = next((name for name, other in inside.items() if other is picture), "%d" % len(inside))
    inside[name] = picture
    return name


def _factor(mesh):
    """The factor of a picture's colours: that of glTF, Wavefront's diffuse colour; in Collada a picture is in the place
    of it."""
    material = mesh.visual.material
    factor = getattr(material, "baseColorFactor", None)
    if factor is not None:
        return (*(round(int(value) / 255.0, 3) for value in factor[:3]), 1.0)
    diffuse = getattr(material, "kwargs", {}).get("kd")
    if diffuse is None or np.shape(diffuse) != (3,) or max(diffuse) < _BLACK:
        return 1.0, 1.0, 1.0, 1.0
    return (*(round(min(max(0.0, float(value)), 1.0), 3) for value in diffuse), 1.0)


def _colour(mesh):
    """The diffuse colour that the file names, as rviz and Gazebo show it in full light, or None."""
    material = getattr(mesh.visual, "material", None)
    colour = getattr(material, "main_color", None)
    if colour is None and getattr(mesh.visual, "kind", None) in ("face", "vertex"):
        colour = mesh.visual.main_color
    if colour is None:
        return None
    # The fourth number is ignored: for some exporters it means opacity, for others transparency.
    return (*(round(int(value) / 255.0, 3) for value in colour[:3]), 1.0)


def _emission(mesh, colour, texture):
    """The light that the file's material gives off, as Gazebo and rviz show it.

    But not where it repeats the diffuse colour, which exporters write that know one colour only: it would shine in the
    dark and hide all shading. Beside a picture there is no colour to repeat; calibration targets shine on purpose.
    """
    material = getattr(mesh.visual, "material", None)
    emission = getattr(material, "emissiveFactor", None)
    if emission is None:
        emission = getattr(material, "kwargs", {}).get("ke", ())  # of Wavefront files, as words
    try:
        emission = tuple(round(min(max(0.0, float(value)), 1.0), 3) for value in emission)
    except ValueError:
        emission = ()
    if len(emission) != 3 or not texture and colour is not None and np.allclose(emission, colour[:3], atol=_SAME):
        return _DARK
    return emission
