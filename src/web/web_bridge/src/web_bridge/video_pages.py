# SPDX-License-Identifier: BSD-3-Clause
"""The two small pages of the video server. No ROS."""
from __future__ import annotations

from html import escape
from urllib.parse import urlencode

_PAGE = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>%s</title></head><body><h1>%s</h1>
%s
</body></html>
"""


def topics(published: dict[str, str], image_type: str, token: str = "") -> str:
    """The list of topics of images, {name: type}, each with its links; those of a camera together."""
    images = sorted(name for name, kind in published.items() if kind == image_type)
    cameras = sorted((name.removesuffix("camera_info") for name in published if name.endswith("/camera_info")),
                     key=len, reverse=True)
    groups = {}
    for name in images:
        groups.setdefault(next((camera for camera in cameras if name.startswith(camera)), ""), []).append(name)
    parts = []
    for camera in sorted(groups):
        links = "".join("<li>%s</li>" % _links(name, name.removeprefix(camera), token) for name in groups[camera])
        parts.append("<h2>%s</h2>" % escape(camera) * bool(camera) + "<ul>%s</ul>" % links)
    return _PAGE % (("Topics of images",) * 2 + ("\n".join(parts) or "<p>Nobody publishes images.</p>",))


def _links(name: str, shown_name: str, token: str) -> str:
    query = escape(urlencode({"topic": name, **({"token": token} if token else {})}, safe="/"))
    return '<a href="stream_viewer?%s">%s</a> (<a href="stream?%s">Stream</a>) (<a href="snapshot?%s">Snapshot</a>)' % (
        query, escape(shown_name), query, query)


def viewer(topic: str, query: str) -> str:
    """A page with the stream of a query, as it is in the address."""
    name = escape(topic)
    return _PAGE % (name, name, '<img src="stream?%s" alt="%s">' % (escape(query), name))
