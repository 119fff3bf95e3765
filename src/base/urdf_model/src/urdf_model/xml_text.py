# SPDX-License-Identifier: BSD-3-Clause
"""Parse untrusted XML: no entities, no network, a limited size."""
from __future__ import annotations

import re
from collections.abc import Callable

from lxml import etree

from . import bounds

_TAG = re.compile(rb"<[A-Za-z_][^<>]*>")
# In a tag: a value in quotation marks, or one without.
_VALUE = re.compile(rb"""("[^"]*"|'[^']*')|(=\s*)([^\s"'<>=]+?)(?=\s|/?>)""")


class XmlRefused(ValueError):
    """The text cannot be used; the message continues after the text's name: "… is not well-formed XML: …"."""


def parse_xml(text: str | bytes, most_bytes: int = bounds.DESCRIPTION_BYTES,
              repaired: Callable[[str], object] | None = None) -> etree._Element | None:
    """Return the root element of ``text`` (str or bytes), without comments; None where it holds none.

    ``repaired``: function called with a description of what was mended, as Gazebo's reader takes it: an element whose
    end tag is missing, which then ends where its parent does; comments before the declaration, or with two hyphens in
    them; attributes without quotation marks. Without it such a text is refused. A text that breaks off is always
    refused.

    Raises XmlRefused for a text that is not well-formed, declares entities, or is too large.
    """
    data = text.encode() if isinstance(text, str) else text
    if len(data) > most_bytes:
        raise XmlRefused("has %d bytes; expected at most %d (are meshes written into it?)" % (len(data), most_bytes))
    parser = _parser(recover=False)
    try:
        root = etree.fromstring(data.strip(), parser)
    except etree.XMLSyntaxError as error:
        root = _without_name_spaces(data.strip(), parser)
        if root is None:
            root, what = (None, "") if repaired is None else _repaired(data.strip(), parser)
            if root is None or repaired is None:
                raise XmlRefused("is not well-formed XML: %s" % error) from None
            repaired("%s (%s)" % (what, error))
    if root is not None:
        refuse_entities(root)
        count, most = sum(1 for _ in root.iter()), most_bytes // bounds.BYTES_PER_ELEMENT
        if count > most:
            raise XmlRefused("has %d elements; expected at most %d" % (count, most))
    return root


def _parser(recover):
    return etree.XMLParser(resolve_entities=False, no_network=True, remove_comments=True, huge_tree=False,
                           recover=recover)


def _without_name_spaces(data, parser):
    """Return the root element of ``data`` (bytes), on which ``parser`` failed, if all that it lacks is the declaration
    of a prefix: the readers of Gazebo and ROS know no name spaces, so to them ``a:b`` is a name. Else None."""
    undeclared = etree.ErrorTypes.NS_ERR_UNDEFINED_NAMESPACE
    if {entry.type for entry in parser.error_log} != {undeclared}:
        return None
    return etree.fromstring(data, _parser(recover=True))


def _repaired(data, parser):
    """Return (the root element of ``data`` (bytes), on which ``parser`` failed, what was mended); (None, "") if it has
    other errors."""
    root = _with_end_tags(data, parser)
    if root is not None:
        return root, "missing end tag"
    tidied = _TAG.sub(_quoted, _without_comments(data)).strip()
    parser = _parser(recover=False)
    try:
        return etree.fromstring(tidied, parser), "a comment or an attribute that XML does not allow"
    except etree.XMLSyntaxError:
        root = _with_end_tags(tidied, parser)
    return root, "" if root is None else "missing end tag"


def _without_comments(data):
    """``data`` with the line breaks of its comments alone, so that numbers of lines stay."""
    parts, start = [], 0
    while True:
        begin = data.find(b"<!--", start)
        end = data.find(b"-->", begin + 4)
        if begin < 0 or end < 0:
            return b"".join([*parts, data[start:]])
        parts += [data[start:begin], b"\n" * data.count(b"\n", begin, end)]
        start = end + 3


def _quoted(tag):
    return _VALUE.sub(lambda value: value[1] or b'%s"%s"' % (value[2], value[3]), tag[0])


def _with_end_tags(data, parser):
    """Return the root element of ``data`` (bytes), on which ``parser`` failed, with the missing end tags added; None if
    it has other errors."""
    # A mismatch is found again as an element without an end.
    ends = {etree.ErrorTypes.ERR_TAG_NAME_MISMATCH, etree.ErrorTypes.ERR_TAG_NOT_FINISHED}
    if {entry.type for entry in parser.error_log} - ends:
        return None
    root = etree.fromstring(data, _parser(recover=True))
    return root if root is not None and data.endswith(("</%s>" % root.tag).encode()) else None


def refuse_entities(root: etree._Element) -> None:
    """Raise XmlRefused if the document of ``root`` declares entities: their expansion may be endless."""
    declared = root.getroottree().docinfo.internalDTD
    names = [] if declared is None else [entity.name for entity in declared.iterentities()]
    if names:
        raise XmlRefused("declares the entit%s %s; write what they stand for instead"
                         % ("ies" if len(names) > 1 else "y", ", ".join(names[:5])))
