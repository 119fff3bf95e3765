# SPDX-License-Identifier: BSD-3-Clause
"""Load untrusted mesh files: common formats, nothing fetched, no entities, a bounded number of triangles.

Call it in a process with limits (``limited``): a hostile file can make a format's library do much work.
"""

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from urdf_model import bounds, read_file, refuse_entities

from .thinning import outermost, thin_out

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    import trimesh
    from lxml import etree

#: Limits of what is read.
MAX_BYTES = 100_000_000
MAX_TRIANGLES = 2_000_000
MAX_BYTES_BESIDE = 10_000_000  # of each file that a mesh names
# The formats of Gazebo and rviz, and some more. No archives: their content may be endless.
_FORMATS = ("dae", "stl", "obj", "ply", "off", "glb", "gltf")
# Pictures whose brightness is a height.
_HEIGHTS = ("png", "jpg", "jpeg")
_MAX_HEIGHTS = 1025 * 1025  # rows of a power of two and one, as Gazebo wants them
# Rows of a terrain to look at: simplifying one of 513 rows takes a minute of processor time, one of 201 some seconds.
_MAX_DRAWN_ROWS = 201
# Materials and buffers that a mesh may name, and pictures, of which only the names are read.
_BESIDE = (".mtl", ".bin")
PICTURES = (".png", ".jpg", ".jpeg", ".tga", ".bmp", ".gif", ".tif", ".tiff")

#: The part of a mesh that is all of it, for :func:`load_scene`.
WHOLE = ("", False)
# So many names of parts are in a message.
_MAX_NAMED = 12

#: Limits of collision shapes: with more triangles, making the shape of a fixed body takes the loop more than 20 ms; so
#: does a convex shape with more points.
MAX_HOLLOW_TRIANGLES = 12_000
MAX_HULL_POINTS = 6_000
# Directions in which a hull with more points keeps its outermost one: neighbours are 0.09 rad apart, so that at most
# 0.1 % of its size is cut off (1 - cos 0.045).
_HULL_DIRECTIONS = 1_500


class MeshError(ValueError):
    """A mesh that cannot be used; the text continues after the mesh's name: "… holds no triangles"."""


class _Beside(Mapping[str, bytes]):
    """Resolver for trimesh: only files in the mesh's own folder, and only materials and buffers. It lists none."""

    def __init__(self, folder: Path, textures: bool) -> None:
        self._folder = folder
        self._textures = textures

    def __getitem__(self, name: str) -> bytes:
        name = str(name)
        if self._textures and name.lower().endswith(PICTURES):
            return _picture_of(name)
        path = (self._folder / name).resolve()
        if path.suffix.lower() not in _BESIDE or self._folder.resolve() not in path.parents:
            raise FileNotFoundError(name)
        return read_file(path, MAX_BYTES_BESIDE)

    def __iter__(self) -> Iterator[str]:
        return iter(())

    def __len__(self) -> int:
        return 0


def load_scene(path: str | Path, part: tuple[str, bool] = WHOLE, textures: bool = False) -> trimesh.Scene:
    """Return the trimesh.Scene in the file at ``path``; a picture is a terrain of 1 x 1 x 1 m, with its brightness as
    height. ``part``: (the name of the node of a Collada file, or of the group or object of a Wavefront file, that is
    wanted alone, or "" for all; whether its middle is at the origin). With ``textures``, for drawing, materials have
    pictures of one pixel, with the name that the file gives as ``picture.info["name"]``, and terrains fewer rows.
    Raises MeshError, OSError, and what libraries raise."""
    import trimesh  # 0.1 s to import, and needed only the first time that a mesh is seen

    path = Path(path)
    kind = path.suffix[1:].lower()
    if kind not in _FORMATS + _HEIGHTS:
        raise MeshError("it is in the format '%s'; expected one of %s" % (kind, ", ".join(_FORMATS)))
    content = read_file(path, MAX_BYTES)
    if kind in _HEIGHTS:
        heights = _with_fewer_rows(_heights(content)) if textures else _heights(content)
        return trimesh.Scene(trimesh.Trimesh(*_terrain(heights), process=False))
    unit_m, (name, is_centred) = 1.0, part
    if kind == "dae":
        content, unit_m = _collada(content, name)
    elif name and kind == "obj":
        content = _group(content, name)
    elif name:
        raise MeshError("it has no part '%s'; only Collada and Wavefront files have parts with names" % name)
    scene = trimesh.load_scene(
        io.BytesIO(content), file_type=kind, resolver=_Beside(path.parent, textures), process=False
    )
    triangles = 0
    for name in scene.graph.geometry_nodes:
        copies, mesh = len(scene.graph.geometry_nodes[name]), scene.geometry[name]
        triangles += copies * len(getattr(mesh, "faces", ()))
        if triangles > MAX_TRIANGLES:
            raise MeshError("it holds more than %d triangles" % MAX_TRIANGLES)
        vertices = np.asarray(mesh.vertices)
        farthest_m = np.abs(vertices).max(initial=0.0) * unit_m
        if not farthest_m <= bounds.POSITION.high:
            raise MeshError("a corner is at %g; expected at most %g" % (farthest_m, bounds.POSITION.high))
    if unit_m != 1.0 and scene.geometry:
        scene.apply_transform(np.diag([unit_m, unit_m, unit_m, 1.0]))
    if is_centred and scene.bounds is not None:
        middle = np.eye(4)
        middle[:3, 3] = -np.mean(scene.bounds, axis=0)
        scene.apply_transform(middle)
    if triangles <= MAX_HOLLOW_TRIANGLES:
        # Merging equal corners takes as long as all the rest; a mesh that is decimated does not need it.
        for mesh in scene.geometry.values():
            if len(getattr(mesh, "faces", ())):
                mesh.process()
    return scene


def _picture_of(name: str) -> bytes:
    """A PNG file of one pixel that holds a name: what is made of a mesh does not depend on the pictures beside it."""
    from PIL import Image
    from PIL.PngImagePlugin import PngInfo

    held, file = PngInfo(), io.BytesIO()
    held.add_itxt("name", name)
    Image.new("L", (1, 1)).save(file, "png", pnginfo=held)
    return file.getvalue()


def _heights(content: bytes) -> np.ndarray:
    """The heights (rows, columns) in a picture, 0 to 1: the brightest point is the highest."""
    from PIL import Image

    with Image.open(io.BytesIO(content)) as picture:
        if not 4 <= picture.width * picture.height <= _MAX_HEIGHTS or min(picture.size) < 2:
            raise MeshError("it has %d x %d heights; expected 2 x 2 to 1025 x 1025" % picture.size)
        values = np.asarray(picture if picture.mode.startswith(("I", "F")) else picture.convert("L"), dtype=float)
    return values / (values.max() or 1.0)


def _with_fewer_rows(heights: np.ndarray) -> np.ndarray:
    """At most :data:`_MAX_DRAWN_ROWS` of the rows and columns, with the first and the last of them."""
    chosen = [np.linspace(0, count - 1, min(count, _MAX_DRAWN_ROWS)).round().astype(int) for count in heights.shape]
    return heights[np.ix_(*chosen)]


def _terrain(heights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Corners (n, 3) and triangles (m, 3) of a square of side 1 about the origin, the first row of ``heights`` at its
    side of greatest y."""
    rows, columns = heights.shape
    y, x = np.meshgrid(np.linspace(0.5, -0.5, rows), np.linspace(-0.5, 0.5, columns), indexing="ij")
    corner = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = (part.ravel() for part in (corner[:-1, :-1], corner[:-1, 1:], corner[1:, :-1], corner[1:, 1:]))
    return (np.stack([x.ravel(), y.ravel(), heights.ravel()], axis=1),
            np.concatenate([np.stack([a, c, b], axis=1), np.stack([b, c, d], axis=1)]))


def _collada(content: bytes, part: str) -> tuple[bytes, float]:
    """(content, unit [m]) of a Collada file, with the geometry of the nodes named ``part`` alone; "" for all. Gazebo
    and rviz scale by the unit, and leave the direction of the axes as it is. Files with entities are refused. Geometry
    stays if its material is broken, as there."""
    from lxml import etree

    parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False, huge_tree=False,
                             remove_comments=True)
    root = etree.fromstring(content, parser)
    refuse_entities(root)
    if part:
        _keep_part(root, part)
    # pycollada leaves out geometry with comments in it.
    if _mend_materials(root) or part or b"<!--" in content:
        content = etree.tostring(root)
    unit = root.find("{*}asset/{*}unit")
    try:
        metres = float(unit.get("meter"))
    except (AttributeError, TypeError, ValueError):  # no such element, no such attribute, or no number
        return content, 1.0
    return content, metres if 0.0 < metres < bounds.POSITION.high else 1.0


def _mend_materials(root: etree._Element) -> bool:
    """Name a file for pictures of a Collada document that have none, and leave out references to materials that do not
    exist; pycollada would leave out the geometry. Returns whether there were any."""
    from lxml import etree

    broken = [image for image in root.iter("{*}image") if not (image.findtext("{*}init_from") or "").strip()]
    for image in broken:
        name = image.find("{*}init_from")
        if name is None:
            name = etree.SubElement(image, etree.QName(etree.QName(image).namespace, "init_from"))
        name.text = image.get("id") or "picture"
    effects = {effect.get("id") for effect in root.iter("{*}effect")}
    materials = {material.get("id") for material in root.iter("{*}material")
                 for made in material.iterfind("{*}instance_effect") if made.get("url", "")[1:] in effects}
    lost = [instance for instance in root.iter("{*}instance_material")
            if instance.get("target", "")[1:] not in materials]
    for instance in lost:
        instance.getparent().remove(instance)
    return bool(broken or lost)


def _keep_part(root: etree._Element, part: str) -> None:
    """Take from a Collada document the geometry of all nodes but those named ``part``. A node without a name has that
    of the one around it."""
    names = set()
    for geometry in list(root.iter("{*}instance_geometry")):
        around = [node.get("name") or node.get("id") for node in geometry.iterancestors("{*}node")]
        name = next(filter(None, around), "")
        names.add(name)
        if name != part:
            geometry.getparent().remove(geometry)
    if part not in names:
        raise _no_part(part, names)


def _group(content: bytes, part: str) -> bytes:
    """Take from a Wavefront file (bytes) the faces of all groups and objects but those named ``part``."""
    names, kept, is_wanted = set(), [], False
    for line in content.splitlines():
        kind, _, rest = line.strip().partition(b" ")
        if kind in (b"g", b"o"):
            name = rest.strip().decode("utf-8", "replace")
            names.add(name)
            is_wanted = name == part
        elif kind != b"f" or is_wanted:
            kept.append(line)
    if part not in names:
        raise _no_part(part, names)
    return b"\n".join(kept)


def _no_part(part: str, names: Iterable[str]) -> MeshError:
    return MeshError("it has no part '%s'; it has %s" % (part, ", ".join(sorted(names)[:_MAX_NAMED]) or "none"))


def to_wavefront(path: str | Path, target: str, planes: Iterable[Sequence], part: tuple[str, bool] = WHOLE) -> str:
    """Write the mesh at ``path`` to the Wavefront file ``target``, as bodies collide with it, in metres, z up.

    ``part``: as for :func:`load_scene`; ``planes``: as for ``convex_parts.cut``; given, there is one object for each
    part of it. If the hull has very many points, ``target`` + ".hull" holds one that is as good. Raises MeshError.
    Returns a remark, "" where there is none.
    """
    import trimesh

    from .convex_parts import cut

    mesh = load_scene(path, part).to_geometry()
    if not isinstance(mesh, trimesh.Trimesh) or len(mesh.faces) == 0:
        raise MeshError("it holds no triangles")
    if planes:
        parts = [hull_points(np.array(points)) for points in cut(mesh.triangles, [tuple(plane) for plane in planes])]
        _write(target, parts_as_wavefront([[tuple(point) for point in points.tolist()] for points in parts]))
        return ""
    remark, faces = "", np.asarray(mesh.faces)
    if len(faces) > MAX_HOLLOW_TRIANGLES:
        _write(target + ".hull", _cloud(hull_points(outermost(np.asarray(mesh.vertices)))))
        vertices, thinned = thin_out(np.asarray(mesh.vertices), faces, MAX_HOLLOW_TRIANGLES)
        remark = "it is thinned out from %d triangles to %d to collide with" % (len(faces), len(thinned))
        faces = thinned
    else:
        mesh.merge_vertices(merge_tex=True, merge_norm=True)
        vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
        if len(vertices) > MAX_HULL_POINTS:
            _write(target + ".hull", _cloud(hull_points(vertices)))
    lines = ["o mesh"]
    lines += ["v %.9g %.9g %.9g" % tuple(vertex) for vertex in vertices]
    lines += ["f %d %d %d" % tuple(face) for face in faces + 1]
    _write(target, lines)
    return remark


def hull_points(points: np.ndarray) -> np.ndarray:
    """Return a subset of ``points`` (n, 3) with nearly the same convex hull; all if there are few."""
    points = np.asarray(points, dtype=float)
    if len(points) <= MAX_HULL_POINTS:
        return points
    directions = even_directions(_HULL_DIRECTIONS)
    best, outermost = np.full(_HULL_DIRECTIONS, -np.inf), np.zeros(_HULL_DIRECTIONS, dtype=int)
    for start in range(0, len(points), 4096):
        reach = directions @ points[start : start + 4096].T
        here = reach.argmax(axis=1)
        reach = reach[np.arange(_HULL_DIRECTIONS), here]
        better = reach > best
        best[better], outermost[better] = reach[better], start + here[better]
    return points[np.unique(outermost)]


def even_directions(count: int) -> np.ndarray:
    """Return ``count`` directions (count, 3) evenly over the sphere: a Fibonacci lattice."""
    k = np.arange(count) + 0.5
    height, turn = 1.0 - 2.0 * k / count, np.pi * (1.0 + 5.0**0.5) * k
    level = np.sqrt(1.0 - height * height)
    return np.stack([level * np.cos(turn), level * np.sin(turn), height], axis=1)


def parts_as_wavefront(parts: Iterable[Sequence[Sequence[float]] | np.ndarray]) -> list[str]:
    """Return the lines of a file with one object for each list of points; Bullet makes a convex hull of each."""
    lines, first = [], 1
    for number, points in enumerate(parts):
        lines.append("o part%d" % number)
        lines += ["v %.9g %.9g %.9g" % tuple(point) for point in points]
        # For a hull, only the grouping of points counts; the faces give it, three points each.
        last = first + len(points) - 1
        lines += ["f %d %d %d" % (i, min(i + 1, last), min(i + 2, last)) for i in range(first, last + 1, 3)]
        first = last + 1
    return lines


def _cloud(points: np.ndarray) -> list[str]:
    return parts_as_wavefront([points])


def _write(target: str, lines: list[str]) -> None:
    Path(target).write_text("\n".join(lines) + "\n", encoding="ascii")
