# SPDX-License-Identifier: BSD-3-Clause
"""Errors of this library. Those of its parts (NoSolution, CommandRefused, NoPath, BulletSimError) come through."""


class LabError(Exception):
    """Base class of this package's errors; the text says what was found and what would be right."""


class MeshesMissing(LabError):
    """Baxter's meshes are not on this machine and could not be fetched."""


class NotReached(LabError):
    """Something did not happen within its time of simulation."""
