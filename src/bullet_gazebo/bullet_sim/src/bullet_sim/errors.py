# SPDX-License-Identifier: BSD-3-Clause
"""The one error of this package."""


class BulletSimError(Exception):
    """A request that the world cannot serve. Its text says what was found and what would have been right."""
