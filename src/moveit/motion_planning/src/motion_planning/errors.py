# SPDX-License-Identifier: BSD-3-Clause
"""The root of this package's errors."""


class PlanningError(ValueError):
    """Something asked of motion planning cannot be done. The text is one sentence: what, with which value."""
