# SPDX-License-Identifier: BSD-3-Clause
"""What there is two of."""
SIDES = ("left", "right")
