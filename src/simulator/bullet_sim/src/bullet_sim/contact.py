# SPDX-License-Identifier: BSD-3-Clause
"""Points where bodies touch."""

from typing import NamedTuple


class ContactPoint(NamedTuple):
    """A point where two bodies touch. Links by their merged names, world coordinates, SI units."""

    model_a: str
    link_a: str
    model_b: str
    link_b: str
    position: tuple
    normal: tuple  # unit, on b, towards a
    distance: float  # negative when the shapes overlap
    force: float  # along the normal, in the last step
    friction: tuple  # force (3,) on a, across the normal, in the last step [N]
