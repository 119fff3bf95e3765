# SPDX-License-Identifier: BSD-3-Clause
"""Files of octomap (.bt) to occupied cubes, and back.

Format: a head of lines, its last one "data", then the stream of binary octomap messages (octomap.py).
"""
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from octomap_msgs.msg import Octomap

from motion_planning.exact.octree import occupied_tree
from moveit_ros_move_group.convert.geometry import MessageError
from moveit_ros_move_group.convert.octomap import octree_of

if TYPE_CHECKING:
    from motion_planning.scene import Octree

_FIRST = b"# Octomap OcTree binary file"
_DATA = b"\ndata\n"
# Occupied children in all values of a byte of the stream: the pairs of bits that are 2.
_OCCUPIED = np.array([sum((value >> shift & 3) == 2 for shift in (0, 2, 4, 6)) for value in range(256)])


def file_of(octree: Octree | None, resolution: float) -> bytes:
    """Return the content (bytes) of a file with an Octree, or with an empty one of ``resolution`` [m] for None."""
    data = b"" if octree is None else occupied_tree(octree).tobytes()
    # Two bytes for each inner node; leaves are told by their parents.
    size = len(data) // 2 + int(_OCCUPIED[np.frombuffer(data, np.uint8)].sum())
    head = b"%s\nid OcTree\nsize %d\nres %s" % (_FIRST, size, repr(float(resolution)).encode())
    return head + _DATA + data


def octree_of_file(content: bytes) -> Octree | None:
    """Return the Octree in the content (bytes) of a file, None for an empty one. Raises MessageError."""
    if not content.startswith(_FIRST):
        raise MessageError("it does not begin with '%s'" % _FIRST.decode())
    head, found, data = content.partition(_DATA)
    words = dict(line.split(None, 1) for line in head.decode("ascii", "replace").splitlines()
                 if not line.startswith("#") and " " in line.strip())
    if not found:
        raise MessageError("its head has no line 'data'")
    try:
        resolution = float(words.get("res", ""))
    except ValueError:
        raise MessageError("its head gives no resolution: 'res %s'" % words.get("res", "")) from None
    return octree_of(Octomap(binary=True, id=words.get("id", "").strip(), resolution=resolution,
                             data=np.frombuffer(data, np.int8)))
