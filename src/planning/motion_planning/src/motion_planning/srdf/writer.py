# SPDX-License-Identifier: BSD-3-Clause
"""Changes of an SRDF's text that leave the rest of it unchanged."""
import re
from xml.sax.saxutils import quoteattr

from motion_planning.srdf.reader import SrdfError
from urdf_model import XmlRefused, parse_xml

# The element, with its line if nothing else is in it; comments are matched so that they stay unchanged.
_ELEMENT = re.compile(r"<!--.*?-->|^[ \t]*<disable_collisions\b[^>]*?(?:/>|>\s*</disable_collisions\s*>)[ \t]*\n?"
                      r"|<disable_collisions\b[^>]*?(?:/>|>\s*</disable_collisions\s*>)", re.DOTALL | re.MULTILINE)
_END = re.compile(r"[ \t]*</robot\s*>\s*\Z|\s*/>\s*\Z")


def with_disabled_pairs(text, pairs):
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
    before = kept[:end.start()].rstrip()
    if end[0].lstrip().startswith("/"):  # a robot element without content
        before += ">"
    return "%s\n%s</robot>\n" % (before, "".join("  %s\n" % element_of(pair) for pair in pairs))


def element_of(pair):
    """Return the element of a DisabledPair as text."""
    return "<disable_collisions link1=%s link2=%s reason=%s/>" % tuple(
        map(quoteattr, (pair.link1, pair.link2, pair.reason)))
