# SPDX-License-Identifier: BSD-3-Clause
"""Changes of an SRDF's text that leave the rest of it unchanged."""
from __future__ import annotations

import re
from collections.abc import Iterable
from typing import TYPE_CHECKING
from xml.sax.saxutils import quoteattr

from motion_planning.srdf.reader import SrdfError
from urdf_model import XmlRefused, parse_xml

if TYPE_CHECKING:
    from motion_planning.srdf import DisabledPair

# The element, with its line if nothing else is in it; comments are matched so that they stay unchanged.
_ELEMENT = re.compile(r"<!--.*?-->|^[ \t]*<disable_collisions\b[^>]*?(?:/>|>\s*</disable_collisions\s*>)[ \t]*\n?"
                      r"|<disable_collisions\b[^>]*?(?:/>|>\s*</disable_collisions\s*>)", re.DOTALL | re.MULTILINE)
# The end of the root element, and what may stand behind it: comments and processing instructions.
_END = re.compile(r"(?:[ \t]*</robot\s*>|\s*(?P<empty>/>))(?P<rest>\s*(?:<!--.*?-->\s*|<\?.*?\?>\s*)*)\Z", re.DOTALL)


def with_disabled_pairs(text: str, pairs: Iterable[DisabledPair]) -> str:
    """Return an SRDF's ``text`` (str) with ``pairs`` (DisabledPair) in place of all its disable_collisions elements.

    Comments and everything else stay as they are. Raises SrdfError if the text is not SRDF.
    """
    try:
        root = parse_xml(text)
    except XmlRefused as error:
        raise SrdfError("the SRDF %s" % error) from None
    if root is None or root.tag != "robot":
        raise SrdfError("the text is not SRDF: it has no root element <robot>")
    kept = _ELEMENT.sub(lambda found: found[0] if found[0].startswith("<!--") else "", text)
    end = _END.search(kept)
    if end is None:
        raise SrdfError("the SRDF does not end with </robot>")
    before = kept[:end.start()].rstrip()
    if end["empty"]:  # a robot element without content
        before += ">"
    return "%s\n%s</robot>%s\n" % (before, "".join("  %s\n" % element_of(pair) for pair in pairs), end["rest"].rstrip())


def element_of(pair: DisabledPair) -> str:
    """Return the element of a DisabledPair as text."""
    return "<disable_collisions link1=%s link2=%s reason=%s/>" % tuple(
        map(quoteattr, (pair.link1, pair.link2, pair.reason)))
