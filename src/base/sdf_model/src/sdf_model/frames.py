# SPDX-License-Identifier: BSD-3-Clause
"""Frames of one SDF scope (a model or the world), given relative to each other."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from lxml import etree

    from .document import Document

#: Names that mean the scope's own frame.
OWN = ("", "__model__", "world", "__root__")


class Frames:
    """Collects named frames, then computes their poses in the frame of the scope."""

    def __init__(self, document: Document, scope: str = "") -> None:
        """``scope``: the model's name, which may stand in front of the names in it, as ``scope::link``."""
        self._document = document
        self._scope = scope + "::" if scope else ""
        self._given = {}  # name -> (name of the frame it is given in, 4x4, element)
        self._found = {}

    def add(self, name: str, element: etree._Element, default: str = "", pose: np.ndarray | None = None) -> None:
        """Add a frame: the <pose> of ``element``, or ``pose``, in the frame its relative_to names or in ``default``."""
        if pose is None:
            pose = self._document.pose(element)
            default = self._document.relative_to(element) or default
        self._given[name] = (default, pose, element)

    def add_joint(self, name: str, element: etree._Element, child: str) -> str:
        """Add the frame of a joint, by default in that of its ``child``; return the name of the frame.

        A joint may have the name of a link, as in SDF before 1.7: then the name alone means the link.
        """
        if name in self._given:
            name = "joint %s" % name
        self.add(name, element, child)
        return name

    def plain(self, name: str) -> str:
        """Return ``name`` without the scope's name in front of it, and those of the scopes around that, if only that is
        the name of a frame."""
        if not self._scope or name in self:
            return name
        rest = "::" + name
        while "::" + self._scope in rest:
            rest = rest.partition("::" + self._scope)[2]
            if rest in self:
                return rest
            rest = "::" + rest
        return name

    def __contains__(self, name: str) -> bool:
        return name in OWN or name in self._given

    def where(self, name: str, element: etree._Element) -> np.ndarray:
        """Return the 4x4 matrix of frame ``name`` in the scope; ``element`` refers to it, for the message."""
        # Without recursion: a chain may be as long as the file.
        chain, asked, name = [], {}, self.plain(name)
        while name not in OWN and name not in self._found:
            if name in asked:
                circle = " -> ".join((*asked, name))
                raise self._document.error(element, "frame '%s' is given relative to itself: %s" % (name, circle))
            if name not in self._given:
                raise self._document.error(
                    element, "frame '%s' does not exist; frames: %s" % (name, ", ".join(self._given) or "none")
                )
            asked[name] = None
            chain.append((name, self._given[name][1]))
            name, _, element = self._given[name]
            name = self.plain(name)
        matrix = np.eye(4) if name in OWN else self._found[name]
        for name, pose in reversed(chain):
            matrix = self._found[name] = matrix @ pose
        return matrix
