# SPDX-License-Identifier: BSD-3-Clause
"""The content of a <link>: inertia, shapes, surfaces, materials."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from urdf_model import Box, Cylinder, Inertial, Link, Mesh, Plane, Shape, Sphere, Surface, bounds
from urdf_model.model import ALL_BITS, MAY_BE_INFINITE, with_both_frictions
from urdf_model.transforms import pose_matrix

from .document import SdfError
from .materials import read_material
from .polylines import polyline_file

if TYPE_CHECKING:
    from lxml import etree

    from .document import Document
    from .materials import MaterialScripts

# Bodies bounce from this <threshold> on, by default; nothing is as fast as the second one [m/s].
_NO_BOUNCE_M_PER_S, _NEVER_M_PER_S = 100000.0, 1000.0
# Of a surface.
_MOST = {"damping": bounds.DAMPING.high, "restitution": 1.0}
_INERTIA = (("ixx", 0, 0, 1.0), ("ixy", 0, 1, 0.0), ("ixz", 0, 2, 0.0), ("iyy", 1, 1, 1.0), ("iyz", 1, 2, 0.0))
_INERTIA += (("izz", 2, 2, 1.0),)


def read_link(document: Document, element: etree._Element, name: str, materials: MaterialScripts) -> Link:
    """Return the urdf_model.Link of a <link>, named ``name``, in its own frame. ``materials``: MaterialScripts."""
    link = Link(name, _inertial(document, element), line=element.sourceline)
    link.gravity = document.flag(element, "gravity", True)
    decay = element.find("velocity_decay")
    if decay is not None:
        said = document.number(decay, "linear", 0.0), document.number(decay, "angular", 0.0)
        linear, angular = (min(max(part, 0.0), 1.0) for part in said)
        link.decay = (linear, angular)
        if link.decay != said:
            document.mend(decay, "<velocity_decay> of %g and %g, of which parts from 0 to 1 are used" % said)
    for child in element.iterchildren("collision"):
        shape = _shape(document, child, name)
        if shape is not None:
            shape.surface = _surface(document, child)
            link.collisions.append(shape)
    said = [shape.surface for shape in link.collisions if shape.surface is not None]
    if said:
        link.surface = said[0]
        for shape in link.collisions:
            shape.surface = None if shape.surface == said[0] else shape.surface or Surface()
    for child in element.iterchildren("visual"):
        shape = _shape(document, child, name)
        if shape is not None:
            shape.colour, shape.finish = read_material(document, child, materials)
            link.visuals.append(shape)
    return link


def _inertial(document: Document, link: etree._Element) -> Inertial:
    """Return the Inertial; by default SDF's, 1 kg and 1 kg m^2."""
    element = link.find("inertial")
    if element is None:
        return Inertial(1.0, np.zeros(3), np.eye(3))
    mass = document.number(element, "mass", 1.0)
    if mass <= 0.0:
        document.mend(element, "<mass> of %g kg, which no body has" % mass)
        mass = 0.0
    matrix = np.eye(3)
    inertia = element.find("inertia")
    if inertia is not None:
        for tag, i, j, default in _INERTIA:
            matrix[i, j] = matrix[j, i] = document.number(inertia, tag, default)
        if np.linalg.eigvalsh(matrix)[0] < -1e-9 * np.abs(matrix).max():
            document.mend(inertia, "<inertia> with a negative principal moment, which no body has")
    pose = document.pose(element)
    return Inertial(mass, pose[:3, 3].copy(), pose[:3, :3] @ matrix @ pose[:3, :3].T)


def _shape(document: Document, element: etree._Element, link: str) -> Shape | None:
    """Return the Shape of a <visual> or <collision>, or None for a kind that is not understood (which is noted)."""
    geometry = element.find("geometry")
    shapes = [] if geometry is None else document.children(geometry)
    if not shapes:
        document.note(element, "<%s> of link '%s' without a shape" % (element.tag, link))
        return None
    if len(shapes) > 1 and any(shape.tag != "polyline" for shape in shapes):
        document.note(shapes[1], "<%s> beside <%s> in a <geometry>" % (shapes[1].tag, shapes[0].tag))
    kind, origin = shapes[0], document.pose(element)
    if kind.tag == "box":
        found = Box(document.positive(kind, "size", 3))
    elif kind.tag == "cylinder":
        found = Cylinder(document.positive(kind, "radius", 1)[0], document.positive(kind, "length", 1)[0])
    elif kind.tag == "sphere":
        found = Sphere(document.positive(kind, "radius", 1)[0])
    elif kind.tag == "plane":
        size = document.positive(kind, "size", 2) if kind.find("size") is not None else (1.0, 1.0)
        found = Plane(size)
        origin = origin @ _turned_to(document, kind)
    elif kind.tag == "mesh":
        scale = document.vector(kind, "scale", (1.0, 1.0, 1.0))
        submesh = kind.find("submesh")
        part, centred = ("", False) if submesh is None else (document.text(submesh, "name"),
                                                             document.flag(submesh, "center"))
        found = Mesh(file_of(document, document.text(kind, "uri")), scale, part, centred)
    elif kind.tag == "heightmap":
        size = document.vector(kind, "size", (1.0, 1.0, 1.0))
        found = Mesh(file_of(document, document.text(kind, "uri")), size)
        origin = origin @ pose_matrix(document.vector(kind, "pos", (0.0, 0.0, 0.0)))
    elif kind.tag == "polyline":
        found = Mesh(_polylines(document, shapes))
    else:
        return None  # <empty>, or one that the table of elements has noted
    return Shape(found, origin, element.get("name", ""), None, link)


def _polylines(document: Document, lines: list[etree._Element]) -> str:
    """The file of the body over the <polyline> elements ``lines``; the first one has its height."""
    points = [[document.numbers(point, 2) for point in line.iterchildren("point")] for line in lines]
    try:
        return polyline_file(points, document.positive(lines[0], "height", 1)[0])
    except (ValueError, OSError) as error:
        if isinstance(error, SdfError):
            raise
        raise document.error(lines[0], "<polyline>: %s" % error) from None


def _turned_to(document: Document, plane: etree._Element) -> np.ndarray:
    """Return the 4x4 rotation that takes z to the plane's normal."""
    normal = np.array(document.vector(plane, "normal", (0.0, 0.0, 1.0)))
    length = np.linalg.norm(normal)
    if length < 1e-9:
        raise document.error(plane.find("normal"), "<normal> is zero; expected a direction such as 0 0 1")
    x, y, z = normal / length
    return pose_matrix(rpy=(0.0, float(np.arctan2(np.hypot(x, y), z)), float(np.arctan2(y, x))))


def file_of(document: Document, uri: str) -> str:
    """Return a mesh's name in a form that does not depend on the file that names it."""
    if "://" in uri or document.folder is None:
        return uri
    return str(Path(document.folder) / uri)


def _surface(document: Document, collision: etree._Element) -> Surface | None:
    element = collision.find("surface")
    if element is None:
        return None
    found = {}
    for path, field in (
        ("friction/ode", (("mu", "friction"), ("mu2", "friction_across"))),
        ("contact/ode", (("kp", "stiffness"), ("kd", "damping"), ("max_vel", "leaving_speed"))),
        ("bounce", (("restitution_coefficient", "restitution"),)),
    ):
        part = element.find(path)
        for tag, name in field:
            value = None if part is None else document.number(part, tag, may_be_infinite=name in MAY_BE_INFINITE)
            if value is None:
                continue
            if value < 0.0 and name.startswith("friction"):
                value = math.inf  # as Gazebo takes it
            used = min(max(value, 0.0), _MOST.get(name, math.inf))
            if used != value:
                document.mend(part, "<%s> of %g, for which %g is used" % (tag, value, used))
            found[name] = used
    contact = element.find("contact")
    if contact is not None and document.number(contact, "elastic_modulus", 0.0) > 0.0:
        found.pop("stiffness", None)  # kp says nothing then
    bounce = element.find("bounce")
    if bounce is not None and document.number(bounce, "threshold", _NO_BOUNCE_M_PER_S) >= _NEVER_M_PER_S:
        found.pop("restitution", None)
    direction = _direction(document, collision, element.find("friction/ode"))
    if direction is not None:
        found["direction"] = direction
    mask = _bitmask(document, element)
    if mask != ALL_BITS:
        found["bitmask"] = mask
    return with_both_frictions(Surface(**found)) if found else None


def _direction(document: Document, collision: etree._Element,
               friction: etree._Element | None) -> tuple[float, ...] | None:
    """The unit direction (3,) of <fdir1>, which is in the collision's axes, in those of the link; None for none."""
    if friction is None:
        return None
    said = np.array(document.vector(friction, "fdir1", (0.0, 0.0, 0.0)))
    length = np.linalg.norm(said)
    return tuple((document.pose(collision)[:3, :3] @ said / length).tolist()) if length > 0.0 else None


def _bitmask(document: Document, surface: etree._Element) -> int:
    contact = surface.find("contact")
    if contact is None:
        return ALL_BITS
    if document.flag(contact, "collide_without_contact"):
        return 0  # it pushes nothing
    text = document.text(contact, "collide_bitmask", hex(ALL_BITS))
    try:
        return int(text, 0) & ALL_BITS
    except ValueError:
        document.mend(contact, "<collide_bitmask> of '%s', for which %#x is used" % (text, ALL_BITS))
        return ALL_BITS
