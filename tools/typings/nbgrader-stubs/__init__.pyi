# SPDX-License-Identifier: BSD-3-Clause
"""nbgrader, for pyright: it is a course's own, and not installed here."""
