# SPDX-License-Identifier: BSD-3-Clause
"""Joints over time. ROS-free."""
from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from baxter_model import JOINTS, SIDES

from .picture import Picture, new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Distinguishable colours on white, also for most colour-blind readers.
_COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", "#333333", "#8c564b")


class NothingRecorded(ValueError):
    """There are no samples to plot."""


def figure_of(samples: dict[str, np.ndarray], unit: Any | str = "rad", title: str = "") -> Figure:
    """Return a matplotlib figure of {label: (2, n) array of times [s] and values}, time counted from the first sample.

    Left and right arm have a panel each, other joints a third; ``unit``: of all, or {label: unit}, and each unit has
    its own panel. A joint of an arm has the same colour in every figure. Labels without a sample are left out; raises
    NothingRecorded if none has any.
    """
    units = unit if isinstance(unit, dict) else dict.fromkeys(samples, unit)
    filled = {label: np.asarray(part) for label, part in samples.items() if np.asarray(part).size}
    if not filled:
        raise NothingRecorded("nothing was recorded: did the topic publish while the recording ran?")
    begin = min(part[0, 0] for part in filled.values())
    panels = {}
    for label in sorted(filled, key=lambda label: (_side(label), _place(label), list(filled).index(label))):
        panels.setdefault((_side(label), units[label]), []).append(label)
    figure = new_figure(8.0, 1.2 + 2.2 * len(panels))
    all_axes = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    for axes, ((_, panel_unit), labels) in zip(all_axes, panels.items(), strict=True):
        free = (k for k in range(len(JOINTS) + len(labels)) if k not in map(_place, labels))
        for label in labels:
            times, values = filled[label]
            k = _place(label) if _place(label) < len(JOINTS) else next(free)
            axes.plot(times - begin, values, label=label, linewidth=1.3, color=_COLOURS[k % len(_COLOURS)],
                      linestyle="-" if k < len(_COLOURS) else "--")
        axes.set_ylabel(panel_unit)
        axes.grid(True, color="#dddddd", linewidth=0.6)
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=8, frameon=False)
    all_axes[-1].set_xlabel("simulated time [s]")
    if title:
        figure.suptitle(title, fontsize=10)
    return figure


def _side(label: str) -> str:
    """left, right, or ~ for joints of no arm, which sorts last."""
    side = label.partition("_")[0]
    return side if side in SIDES else "~"


def _place(label: str) -> int:
    """The number of a joint in its arm, from the shoulder on; of other joints the number of joints."""
    side, _, joint = label.partition("_")
    return JOINTS.index(joint) if side in SIDES and joint in JOINTS else len(JOINTS)


def draw(samples: dict[str, np.ndarray], unit: str | dict[str, str] = "rad", title: str = "") -> Picture:
    """The same as a :class:`Picture`."""
    return Picture.of_figure(figure_of(samples, unit, title))
