# SPDX-License-Identifier: BSD-3-Clause
"""The one error of this package."""

from urdf_model import OutOfBounds


class BulletSimError(Exception):
    """The world cannot serve a request. The text says what was found and what would have been right."""


def within(bound, values, what):
    """Return ``values`` as ``urdf_model.bounds.Bound.check`` does; raises BulletSimError if they are out of bounds."""
    try:
        return bound.check(values, what)
    except OutOfBounds as error:
        raise BulletSimError(str(error)) from None
