# SPDX-License-Identifier: BSD-3-Clause
"""One SDF file or text: its XML, its numbers, and its errors and unknown elements, by file and line."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, Literal, overload

import numpy as np

from urdf_model import XmlRefused, bounds, parse_xml
from urdf_model.element_table import IdleElements, add_place, placed
from urdf_model.transforms import pose_matrix

from .elements import TABLE
from .lenient import attributes_to_elements

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from lxml import etree

Triple = tuple[float, float, float]
ROOT_TAGS = ("sdf", "gazebo")
#: The size of a shape whose size is 0 [m].
NO_SIZE_M = 1e-4
_TRUE, _FALSE = ("true", "1"), ("false", "0")
_NUMBER = re.compile(r"[-+]?(?:(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|inf(?:inity)?|nan)", re.IGNORECASE)


class SdfError(ValueError):
    """A description that cannot be used: its text names file and line, what was found and what is right."""


class Notes:
    """Elements that are not understood or have no effect, from one or several files."""

    def __init__(self) -> None:
        # what -> file -> lines
        self._left_out: dict[str, dict[str, list[int | str | None]]] = {}
        self._mended: dict[str, dict[str, list[int | str | None]]] = {}
        self.idle = IdleElements()

    def add(self, what: str, source: str, line: int | None) -> None:
        """Note that ``what`` in ``line`` of ``source`` is ignored."""
        add_place(self._left_out, what, source, line)

    def mend(self, what: str, source: str, line: int | str | None) -> None:
        """Note that ``what`` in ``line`` of ``source`` is not valid SDF, but is understood."""
        add_place(self._mended, what, source, line)

    def warning(self) -> str:
        """Return one line that names all notes, or "" without notes."""
        said = (("not understood and left out", self._left_out), ("not as SDF has it, but read", self._mended))
        parts = ["%s: %s" % (text, placed(noted)) for text, noted in said if noted]
        return "; ".join(filter(None, (*parts, self.idle.text())))


class Document:
    """The XML of one file, with accessors that complain in one line.

    :param xml: str or bytes
    :param source: names the text in messages; a path where there is one
    :param folder: what relative file names refer to, or None
    :param notes: Notes
    :param most_bytes: how long the text may be
    """

    def __init__(self, xml: str | bytes, source: str | Path, folder: str | Path | None, notes: Notes,
                 most_bytes: int = bounds.DESCRIPTION_BYTES) -> None:
        self.source = str(source)
        self.folder = folder
        self.notes = notes
        try:
            root = parse_xml(xml, most_bytes, self._repaired)
        except XmlRefused as error:
            raise SdfError("%s %s" % (self.source, error)) from None
        if root is None or root.tag not in ROOT_TAGS:
            found = "nothing" if root is None else "<%s>" % root.tag
            raise SdfError("%s is not an SDF: its root element is %s, expected <sdf>" % (self.source, found))
        self.root = root
        for what, line in attributes_to_elements(self.root):
            self.notes.mend(what, self.source, line)
        for idle in TABLE.find(self.root, "sdf"):
            self.notes.idle.add(idle, self.source)
        self.version = self._version()

    def _repaired(self, what: str) -> None:
        self.notes.mend(what, self.source, "of the error")

    def _version(self) -> tuple[int, ...]:
        text = self.root.get("version", "1.6")
        try:
            return tuple(int(word) for word in text.split("."))
        except ValueError:
            raise self.error(self.root, "version='%s' is not a version; expected one such as 1.6" % text) from None

    def error(self, element: etree._Element, text: str) -> SdfError:
        """Return an SdfError with file and line."""
        return SdfError("%s, line %s: %s" % (self.source, element.sourceline, text))

    def note(self, element: etree._Element, what: str | None = None) -> None:
        """Note that an element is not understood."""
        self.notes.add(what or element.tag, self.source, element.sourceline)

    def mend(self, element: etree._Element, what: str) -> None:
        """Note that an element is not valid SDF, but is understood; ``what`` describes it."""
        self.notes.mend(what, self.source, element.sourceline)

    def children(self, element: etree._Element) -> list[etree._Element]:
        """Return the child elements, without processing instructions."""
        return [child for child in element if isinstance(child.tag, str)]

    def name(self, element: etree._Element) -> str:
        """Return the attribute ``name``."""
        name = (element.get("name") or "").strip()
        if not name:
            raise self.error(element, "<%s> has no name" % element.tag)
        return name

    def text(self, element: etree._Element, tag: str, default: str | None = None) -> str:
        """Return the stripped text of a child; without ``default`` it must be there."""
        child = element.find(tag)
        text = "" if child is None else (child.text or "").strip()
        if text:
            return text
        if default is None:
            raise self.error(element, "<%s> has no <%s>" % (element.tag, tag))
        return default

    def flag(self, element: etree._Element, tag: str, default: bool = False) -> bool:
        """Return the truth of a child."""
        text = self.text(element, tag, "").lower()
        if not text:
            return default
        if text not in _TRUE + _FALSE:
            raise self.error(element.find(tag), "<%s> is '%s', expected true or false" % (tag, text))
        return text in _TRUE

    @overload
    def number(self, element: etree._Element, tag: str, default: float, may_be_infinite: bool = False) -> float: ...

    @overload
    def number(self, element: etree._Element, tag: str, default: None = None,
               may_be_infinite: bool = False) -> float | None: ...

    def number(self, element: etree._Element, tag: str, default: float | None = None,
               may_be_infinite: bool = False) -> float | None:
        """Return the number in a child, or ``default``, also where the child is empty."""
        child = self._filled(element, tag, default)
        return default if child is None else self.numbers(child, 1, may_be_infinite)[0]

    @overload
    def vector(self, element: etree._Element, tag: str, default: Triple) -> Triple: ...

    @overload
    def vector(self, element: etree._Element, tag: str, default: Sequence[float]) -> tuple[float, ...]: ...

    def vector(self, element: etree._Element, tag: str, default: Sequence[float]) -> tuple[float, ...]:
        """Return the numbers (tuple) in a child, as many as ``default`` has, which an empty one means, too."""
        child = self._filled(element, tag, default)
        return tuple(default) if child is None else self.numbers(child, len(default))

    def _filled(self, element: etree._Element, tag: str,
                default: float | Sequence[float] | None) -> etree._Element | None:
        """The child ``tag``, None if there is none or nothing in it."""
        child = element.find(tag)
        if child is None or (child.text or "").strip():
            return child
        self.mend(child, "<%s> without a number, for which %s is used" % (tag, "the default" if default is None else
                                                                         default))
        return None

    @overload
    def positive(self, element: etree._Element, tag: str, count: Literal[1]) -> tuple[float]: ...

    @overload
    def positive(self, element: etree._Element, tag: str, count: Literal[2]) -> tuple[float, float]: ...

    @overload
    def positive(self, element: etree._Element, tag: str, count: Literal[3]) -> Triple: ...

    def positive(self, element: etree._Element, tag: str, count: int) -> tuple[float, ...]:
        """Return ``count`` positive numbers in a child: SDF's 1 where there is none, NO_SIZE_M for 0, as in Gazebo, and
        no more than a length may be."""
        child = element.find(tag)
        if child is None:
            self.mend(element, "<%s> without <%s>, which is 1" % (element.tag, tag))
            return (1.0,) * count
        values = self.vector(element, tag, (1.0,) * count)
        if min(values) < 0.0:
            raise self.error(child, "<%s> is '%s', expected positive numbers" % (tag, child.text.strip()))
        if min(values) == 0.0:
            self.mend(child, "<%s> of %s, of which %g is used for 0" % (tag, child.text.strip(), NO_SIZE_M))
        if max(values) > bounds.LENGTH.high:
            self.mend(child, "<%s> of %s, of which %g is used at most" % (tag, child.text.strip(), bounds.LENGTH.high))
        return tuple(min(value or NO_SIZE_M, bounds.LENGTH.high) for value in values)

    @overload
    def numbers(self, element: etree._Element, count: Literal[2]) -> tuple[float, float]: ...

    @overload
    def numbers(self, element: etree._Element, count: Literal[3]) -> Triple: ...

    @overload
    def numbers(self, element: etree._Element, count: Literal[4]) -> tuple[float, float, float, float]: ...

    @overload
    def numbers(self, element: etree._Element, count: int, may_be_infinite: bool = False) -> tuple[float, ...]: ...

    def numbers(self, element: etree._Element, count: int, may_be_infinite: bool = False) -> tuple[float, ...]:
        """Return the ``count`` finite numbers in the element itself; infinite ones where they mean something.

        As sdformat does, it reads numbers as long as there are some, and true and false for 1 and 0; what is left is
        noted."""
        text = (element.text or "").strip()
        words = [{"true": "1", "false": "0"}.get(word.lower(), word) for word in text.split()]
        values, left = [], len(words) != count
        for word in words[:count]:
            found = _NUMBER.match(word)
            if found is None:
                break
            values.append(float(found.group()))
            if found.end() < len(word):
                left = True
                break
        if len(values) != count or not all(math.isfinite(value) or may_be_infinite and math.isinf(value)
                                           for value in values):
            raise self.error(
                element, "<%s> is '%s', expected %d number%s" % (element.tag, text, count, "s" * (count > 1))
            )
        if left or words != text.split():
            self.mend(element, "<%s> of %s, of which %s is used"
                      % (element.tag, text, " ".join("%g" % value for value in values)))
        return tuple(values)

    @staticmethod
    def relative_to(element: etree._Element) -> str:
        """Return the name of the frame that the child <pose> is given in, "" if it names none."""
        child = element.find("pose")
        # Up to SDF 1.6 the attribute was called frame.
        return "" if child is None else child.get("relative_to") or child.get("frame") or ""

    def pose(self, element: etree._Element) -> np.ndarray:
        """Return the 4x4 matrix of the child <pose> (x y z [m], roll pitch yaw), identity where there is none."""
        child = element.find("pose")
        if child is None or not (child.text or "").strip():
            return np.eye(4)
        rotation_format = child.get("rotation_format", "euler_rpy")
        if rotation_format != "euler_rpy":
            raise self.error(child, "rotation_format='%s' is not supported; use euler_rpy" % rotation_format)
        words = child.text.split()
        if len(words) == 3:
            self.mend(child, "<pose> of three numbers")
            child.text = "%s 0 0 0" % child.text
        values = np.array(self.numbers(child, 6))
        if (child.get("degrees") or "").lower() in _TRUE:
            values[3:] = np.radians(values[3:])
        return pose_matrix(values[:3], values[3:])
