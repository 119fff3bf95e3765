# SPDX-License-Identifier: BSD-3-Clause
"""The one error of this package, and the log of what it repairs."""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING

from urdf_model import OutOfBounds

if TYPE_CHECKING:
    from urdf_model.bounds import Bound, Numbers

#: Gets the warnings of worlds that were given no other way to say them. Python prints them on stderr.
LOG = logging.getLogger("bullet_sim")


class BulletSimError(Exception):
    """The world cannot serve a request. The text says what was found and what would have been right."""


def within(bound: Bound, values: Numbers, what: str) -> Numbers:
    """Return ``values`` as ``urdf_model.bounds.Bound.check`` does; raises BulletSimError if they are out of bounds."""
    try:
        return bound.check(values, what)
    except OutOfBounds as error:
        raise BulletSimError(str(error)) from None
