# SPDX-License-Identifier: BSD-3-Clause
"""The root of this package's errors."""


class PlanningError(ValueError):
    """A request to motion planning failed. The text is one sentence: what happened, with which value."""
