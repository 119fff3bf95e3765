# SPDX-License-Identifier: BSD-3-Clause
"""Trees of frames, as text and as pictures. ROS-free."""
from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from .picture import Picture, new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from urdf_model.model import Robot

_COLOURS = {"moves": "#c23b22", "fixed": "#5b7083"}


class TreeError(ValueError):
    """The frames form no tree; the text says why."""


@dataclass
class FrameTree:
    """Frames below their parents. `edges`: child -> (parent, label, whether the child moves in it)."""

    edges: dict = field(default_factory=dict)

    @classmethod
    def of_urdf(cls, robot: Robot) -> FrameTree:
        """Of a `urdf_model.Robot`: links, by their joints."""
        return cls({joint.child: (joint.parent, joint.name, joint.type != "fixed") for joint in robot.joints.values()})

    @property
    def roots(self) -> list[str]:
        """Frames without a parent, in alphabetical order."""
        return sorted({parent for parent, _, _ in self.edges.values()} - set(self.edges))

    def children(self, name: str) -> list[str]:
        """Names of the direct children of a frame, in their given order."""
        return [child for child, (parent, _, _) in self.edges.items() if parent == name]

    def below(self, name: str) -> FrameTree:
        """The tree from one frame down. Raises TreeError for an unknown frame."""
        if name not in self.edges and name not in self.roots:
            names = sorted({*self.edges, *self.roots})
            raise TreeError("there is no frame '%s'; there are: %s" % (name, ", ".join(names)))
        chosen, todo = {}, [name]
        while todo:
            for child in self.children(todo.pop()):
                chosen[child] = self.edges[child]
                todo.append(child)
        return FrameTree({child: edge for child, edge in self.edges.items() if child in chosen})

    def rows(self) -> list[tuple[int, str, str, bool]]:
        """List of (depth, name, label, moves), depth first. Raises TreeError if parents form rings."""
        listed = []

        def add(name: str, depth: int) -> None:
            _, label, moves = self.edges.get(name, (None, "", False))
            listed.append((depth, name, label, moves))
            for child in self.children(name):
                add(child, depth + 1)

        for root in self.roots:
            add(root, 0)
        if len(listed) != len({*self.edges, *self.roots}):
            raise TreeError("these frames are each other's parents: %s"
                            % ", ".join(sorted(set(self.edges) - {name for _, name, _, _ in listed})))
        return listed

    def __str__(self) -> str:
        """One line per frame, indented below its parent; the joint in brackets if it moves."""
        return "\n".join("%s%s%s" % ("  " * depth, "[%s] " % label if moves else "", name)
                         for depth, name, label, moves in self.rows())

    def draw(self, title: str = "") -> Picture:
        """:meth:`figure` as a :class:`Picture`."""
        return Picture.of_figure(self.figure(title))

    def figure(self, title: str = "") -> Figure:
        """Return a matplotlib figure: root on the left, frames that move in red, fixed ones in grey."""
        places, leaves = self._places()
        depth = max((x for x, _ in places.values()), default=0)
        figure = new_figure(2.6 + 1.3 * depth, 1.0 + 0.24 * max(leaves, 2))
        axes = figure.add_subplot()
        for child, (parent, _, moves) in self.edges.items():
            (x0, y0), (x1, y1) = places[parent], places[child]
            colour = _COLOURS["moves" if moves else "fixed"]
            axes.plot([x0, x0 + 0.35, x1], [y0, y1, y1], color=colour, linewidth=1.2 if moves else 0.8, zorder=1)
        for name, (x, y) in places.items():
            moves = name in self.edges and self.edges[name][2]
            colour = _COLOURS["moves" if moves else "fixed"]
            axes.plot(x, y, "o", color=colour, markersize=3.5, zorder=2)
            above = self.edges[name][1] if moves else ""
            axes.annotate(name, (x, y), xytext=(4, -1), textcoords="offset points", fontsize=7.5, va="center",
                          color="black", zorder=3,
                          bbox={"boxstyle": "round,pad=0.12", "facecolor": "white", "edgecolor": "none", "alpha": 0.8})
            if above and above != name:
                axes.annotate(above, (x, y), xytext=(-4, 4), textcoords="offset points", fontsize=6, ha="right",
                              color=colour, zorder=3)
        axes.set_xlim(-0.2, depth + 1.1)
        axes.set_ylim(leaves - 0.2, -0.8)
        axes.axis("off")
        axes.set_title(title or "red: moves; grey: fixed", fontsize=9, loc="left")
        return figure

    def _places(self) -> tuple[dict[str, tuple[int, float]], int]:
        """{name: (depth, height)} and the number of leaves: a frame is centred above its leaves."""
        self.rows()  # a ring would never end below
        places, count = {}, 0

        def place(name: str, depth: int) -> float:
            nonlocal count
            children = self.children(name)
            if not children:
                height, count = float(count), count + 1
            else:
                heights = [place(child, depth + 1) for child in children]
                height = (heights[0] + heights[-1]) / 2.0
            places[name] = depth, height
            return height

        for root in self.roots:
            place(root, 0)
        return places, count
