# SPDX-License-Identifier: BSD-3-Clause
"""The <actor> element: a figure that the plugin ``libactor_trajectory.so`` moves along its way."""

from __future__ import annotations

import copy
from typing import TYPE_CHECKING

import numpy as np
from lxml import etree

from urdf_model import Inertial, Link, Mesh, Robot, Shape

from .links import file_of

if TYPE_CHECKING:
    from .document import Document

#: The plugin that moves an actor; inside of it is the content of the actor's <script>.
PLUGIN = "libactor_trajectory.so"
# Of a standing person [kg, kg m^2]: the figure, where its skin cannot be found, is a box with this inertia.
_PERSON = 70.0, (20.0, 20.0, 3.0)


def actor_robot(document: Document, element: etree._Element, name: str) -> Robot:
    """Return the Robot of an <actor>: to be seen only, and static but for its plugin.

    Raises SdfError for numbers of its trajectory that are none.
    """
    mass, moments = _PERSON
    link = Link("link", Inertial(mass, np.zeros(3), np.diag(moments)), line=element.sourceline)
    skin = element.find("skin")
    if skin is not None:
        scale = document.number(skin, "scale", 1.0)
        figure = Mesh(file_of(document, document.text(skin, "filename")), (scale, scale, scale))
        link.visuals.append(Shape(figure, np.eye(4), "skin", None, "link"))
    said = etree.Element("gazebo")
    etree.SubElement(said, "static").text = "true"
    motion = etree.SubElement(said, "plugin", name="actor", filename=PLUGIN)
    script = element.find("script")
    if script is not None:
        for waypoint in script.iterfind("trajectory/waypoint"):
            document.number(waypoint, "time", 0.0)
            document.pose(waypoint)
        motion.extend([copy.deepcopy(child) for child in document.children(script)])
    said.extend([copy.deepcopy(plugin) for plugin in element.findall("plugin")])
    return Robot(name, {"link": link}, {}, "link", gazebo=[said])
