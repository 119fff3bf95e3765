# SPDX-License-Identifier: BSD-3-Clause
"""Exceptions of this package. Each text says what was found and what would have been right."""


class BaxterModelError(Exception):
    """Base class of this package's errors."""


class PoseError(BaxterModelError):
    """A named pose does not exist or does not cover the requested joints."""


class ModelMismatch(BaxterModelError):
    """The URDF lacks a joint or a frame that every Baxter has."""
