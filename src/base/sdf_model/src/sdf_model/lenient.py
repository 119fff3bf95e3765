# SPDX-License-Identifier: BSD-3-Clause
"""Deviations that Gazebo's reader accepts: attributes in place of elements, as before SDF 1.3."""

from __future__ import annotations

from lxml import etree

# Element -> the attributes that are elements in it today.
_INSIDE: dict[str, tuple[str, ...]] = {
    "box": ("size",),
    "cylinder": ("radius", "length"),
    "sphere": ("radius",),
    "plane": ("normal", "size"),
    "mesh": ("uri", "filename", "scale"),
    "inertial": ("mass",),
    "inertia": ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"),
    "axis": ("xyz",),
    "limit": ("lower", "upper", "effort", "velocity"),
    "dynamics": ("damping", "friction"),
    "ode": ("mu", "mu2", "kp", "kd"),
    "bounce": ("restitution_coefficient",),
    "model": ("static",),
    "link": ("gravity", "kinematic", "self_collide"),
}
# Numbers that are the text of their element today.
_TEXTS = {"gravity": "xyz", "ambient": "rgba", "diffuse": "rgba", "specular": "rgba", "emissive": "rgba",
          "background": "rgba", "direction": "xyz"}
_RENAMED = {"filename": "uri"}


def attributes_to_elements(root: etree._Element) -> list[tuple[str, int]]:
    """Convert attributes of ``root``'s elements to elements, in place; return a list of (what, line)."""
    mended = []
    for element in list(root.iter(*_INSIDE, *_TEXTS, "origin")):
        if any(True for _ in element.iterancestors("plugin", "sensor")):
            continue
        if element.tag in _TEXTS:
            name = _TEXTS[element.tag]
            if element.get(name) and not (element.text or "").strip():
                element.text = element.get(name)
                mended.append(("attribute %s of <%s>" % (name, element.tag), element.sourceline))
        elif element.tag == "origin":
            parent = element.getparent()
            if element.get("pose") and parent is not None and parent.find("pose") is None:
                _add(parent, "pose", element.get("pose"), element)
                mended.append(("<origin pose>", element.sourceline))
                parent.remove(element)
        else:
            found = [name for name in _INSIDE[element.tag] if element.get(name)
                     and element.find(_RENAMED.get(name, name)) is None]
            for name in found:
                _add(element, _RENAMED.get(name, name), element.get(name), element)
            if found:
                mended.append(("attribute %s of <%s>" % (", ".join(found), element.tag), element.sourceline))
    return mended


def _add(parent: etree._Element, tag: str, text: str, where: etree._Element) -> None:
    child = etree.SubElement(parent, tag)
    child.text = text
    child.sourceline = where.sourceline
