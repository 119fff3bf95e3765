# SPDX-License-Identifier: BSD-3-Clause
"""The one error of this package."""

from urdf_model import OutOfBounds


class BulletSimError(Exception):
    """A request that the world cannot serve. Its text says what was found and what would have been right."""


def within(bound, values, what):
    """Return ``values`` as ``urdf_model.bounds.Bound.check`` does; raises BulletSimError where they are out of it."""
    try:
        return bound.check(values, what)
    except OutOfBounds as error:
        raise BulletSimError(str(error)) from None
