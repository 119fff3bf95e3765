# SPDX-License-Identifier: BSD-3-Clause
"""Parse untrusted XML: no entities, no network, a limited size."""

from lxml import etree

from . import bounds


class XmlRefused(ValueError):
    """The text cannot be used; the message continues after the text's name: "… is not well-formed XML: …"."""


def parse_xml(text, most_bytes=bounds.DESCRIPTION_BYTES, repaired=None):
    """Return the root element of ``text`` (str or bytes), without comments; None where it holds none.

    ``repaired``: function called for an element whose end tag is missing, which then ends where its parent does;
    without it such a text is refused. A text that breaks off is always refused.

    Raises XmlRefused for a text that is not well-formed, declares entities, or is too large.
    """
    data = text.encode() if isinstance(text, str) else text
    if len(data) > most_bytes:
        raise XmlRefused("has %d bytes; expected at most %d (are meshes written into it?)" % (len(data), most_bytes))
    parser = _parser(recover=False)
    try:
        root = etree.fromstring(data.strip(), parser)
    except etree.XMLSyntaxError as error:
        root = None if repaired is None else _with_end_tags(data.strip(), parser)
        if root is None:
            raise XmlRefused("is not well-formed XML: %s" % error) from None
        repaired(str(error))
    if root is not None:
        refuse_entities(root)
        count, most = sum(1 for _ in root.iter()), most_bytes // bounds.BYTES_PER_ELEMENT
        if count > most:
            raise XmlRefused("has %d elements; expected at most %d" % (count, most))
    return root


def _parser(recover):
    return etree.XMLParser(resolve_entities=False, no_network=True, remove_comments=True, huge_tree=False,
                           recover=recover)


def _with_end_tags(data, parser):
    """Return the root element of ``data`` (bytes), on which ``parser`` failed, with the missing end tags added; None if
    it has other errors."""
    # A mismatch is found again as an element without an end.
    ends = {etree.ErrorTypes.ERR_TAG_NAME_MISMATCH, etree.ErrorTypes.ERR_TAG_NOT_FINISHED}
    if {entry.type for entry in parser.error_log} - ends:
        return None
    root = etree.fromstring(data, _parser(recover=True))
    return root if root is not None and data.endswith(("</%s>" % root.tag).encode()) else None


def refuse_entities(root):
    """Raise XmlRefused if the document of ``root`` declares entities: their expansion may be endless."""
    declared = root.getroottree().docinfo.internalDTD
    names = [] if declared is None else [entity.name for entity in declared.iterentities()]
    if names:
        raise XmlRefused("declares the entit%s %s; write what they stand for instead"
                         % ("ies" if len(names) > 1 else "y", ", ".join(names[:5])))
