# SPDX-License-Identifier: BSD-3-Clause
"""Limits of the freed memory that malloc keeps. No ROS."""
import ctypes

#: Blocks of this size and more go back to the system as soon as they are freed [bytes].
LARGE_BYTES = 1 << 20
# Of glibc's malloc.h.
_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD = -1, -3


def return_large_blocks():
    """Let malloc give large blocks back when they are freed; once, at the start of a server.

    glibc raises its threshold to the largest block that was freed so far, up to 32 MB. Messages of several MB then lie
    among small objects in the heaps of all threads, which keep them: 130 MB after eight messages of 10 MB. Another C
    library than glibc has no such function, and nothing is changed.
    """
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        mallopt(_M_MMAP_THRESHOLD, LARGE_BYTES)
        mallopt(_M_TRIM_THRESHOLD, LARGE_BYTES)
