# SPDX-License-Identifier: BSD-3-Clause
"""Exceptions of this package. Each text says what was found and what would have been right."""


class ModelError(Exception):
    """Root of everything this package raises on purpose."""


class PoseError(ModelError):
    """A named pose that does not exist or does not cover the joints asked for."""


class ModelMismatch(ModelError):
    """The URDF lacks a joint or a frame without which it is no Baxter."""
