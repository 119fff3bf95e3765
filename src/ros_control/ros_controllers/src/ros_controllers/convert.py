# SPDX-License-Identifier: BSD-3-Clause
"""Where messages meet control time."""
import genpy


def stamp(time_s):
    """``genpy.Time`` of a control time [s]."""
    return genpy.Time(*divmod(round(time_s * 1e9), 10**9))
