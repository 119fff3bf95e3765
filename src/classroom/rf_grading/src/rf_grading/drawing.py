# SPDX-License-Identifier: BSD-3-Clause
"""A run of the robot as a moving picture in SVG, which any browser plays without scripts. Free of ROS."""
from __future__ import annotations

import html
from typing import Any

#: View -> (its title, coordinates of a point that go right and up on the page, with their signs).
VIEWS = {"from above": ((1, -1), (0, 1)), "from the front": ((1, 1), (2, 1))}
COLOURS = {"left": "#0b6e99", "right": "#c2571a"}
#: Shown part of the world [mm], right and up: Baxter's reach.
_RIGHT, _UP = (-1250, 1250), {"from above": (-400, 1250), "from the front": (-700, 1100)}
_PIXELS_PER_MM = 0.16
_SHORTEST_S = 1.0
_MARGIN, _TITLE = 8, 18


def of_run(motion: dict[str, list[Any]]) -> str:
    """The SVG text of motion.of_run()'s data; "" for a run without records."""
    if not motion:
        return ""
    lasts = max(_SHORTEST_S, motion["times"][-1])
    width = round((_RIGHT[1] - _RIGHT[0]) * _PIXELS_PER_MM)
    parts, left, height = [], 0, 0
    for title in VIEWS:
        parts.append('<g transform="translate(%d,0)">%s</g>' % (left, _view(title, motion, lasts)))
        left += width + _MARGIN
        height = max(height, _height(title))
    return ('<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 %d %d" width="%d" role="img" aria-label="%s">%s</svg>'
            % (left - _MARGIN, height + _TITLE, left - _MARGIN,
               html.escape("both arms during the run of %.1f s" % motion["times"][-1]), "".join(parts)))


def _height(title: str) -> int:
    return round((_UP[title][1] - _UP[title][0]) * _PIXELS_PER_MM)


def _view(title: str, motion: dict[str, list[Any]], lasts: float) -> str:
    """Both arms in one view: at the start in grey, moving, and the hands' paths."""
    (right, right_sign), (up, up_sign) = VIEWS[title]

    def place(point: list[int]) -> tuple[int, int]:
        return (round((right_sign * point[right] - _RIGHT[0]) * _PIXELS_PER_MM),
                round((_UP[title][1] - up_sign * point[up]) * _PIXELS_PER_MM) + _TITLE)

    def line(points: list[list[int]]) -> str:
        return " ".join("%d,%d" % place(point) for point in points)

    width = round((_RIGHT[1] - _RIGHT[0]) * _PIXELS_PER_MM)
    parts = ['<rect x="0" y="%d" width="%d" height="%d" fill="#f6f7f8"/>' % (_TITLE, width, _height(title)),
             '<text x="2" y="13" font-size="12" fill="currentColor">%s</text>' % title]
    parts += ['<polyline points="%s" fill="none" stroke="#b9bec3" stroke-width="5" stroke-linecap="round" '
              'stroke-linejoin="round"/>' % line(motion[side][0]) for side in COLOURS]
    for side, colour in COLOURS.items():
        frames = motion[side]
        parts.append('<polyline points="%s" fill="none" stroke="%s" stroke-width="1.5" opacity="0.55"/>'
                     % (line([frame[-1] for frame in frames]), colour))
        times = ";".join("%.4f" % min(1.0, time / lasts) for time in motion["times"])
        values = ";".join(line(frame) for frame in frames)
        # The last of the key times must be 1.
        parts.append('<polyline points="%s" fill="none" stroke="%s" stroke-width="5" stroke-linecap="round" '
                     'stroke-linejoin="round"><animate attributeName="points" dur="%.2fs" repeatCount="indefinite" '
                     'keyTimes="%s;1" values="%s;%s"/></polyline>'
                     % (line(frames[-1]), colour, lasts, times, values, line(frames[-1])))
    return "".join(parts)
