# SPDX-License-Identifier: BSD-3-Clause
"""Octomap messages to occupied cubes, and back.

Format: A. Hornung et al., OctoMap (Autonomous Robots 2013), section 3.4: depth first, eight children of each node in
two bits each (binary), or an occupancy of four bytes and a byte of flags (full).
"""
from __future__ import annotations

import math
import struct
from typing import TYPE_CHECKING

import numpy as np
from octomap_msgs.msg import OctomapWithPose

from motion_planning.exact.octree import occupied_tree
from motion_planning.shapes import Octree
from moveit_ros_move_group.convert.geometry import MessageError, pose_of

if TYPE_CHECKING:
    import rospy
    from octomap_msgs.msg import Octomap

    Triple = tuple[float, float, float]
    #: Centre and side.
    Cube = tuple[float, float, float, float]

_LEVELS = 16
_FREE, _OCCUPIED, _INNER = 1, 2, 3


def octree_of(message: Octomap) -> Octree | None:
    """Return the Octree of an octomap_msgs/Octomap, or None if it is empty.

    Raises MessageError for a tree of another kind than OcTree and for data that end too early.
    """
    if not len(message.data):
        return None
    if message.id not in ("OcTree", "ColorOcTree") or message.id == "ColorOcTree" and not message.binary:
        raise MessageError("expected an OcTree, got '%s'" % message.id)
    if not (math.isfinite(message.resolution) and message.resolution > 0.0):
        raise MessageError("the resolution must be above 0, got %r" % message.resolution)
    data = np.array(message.data, dtype=np.int8).tobytes()
    try:
        boxes = (_binary if message.binary else _full)(data, message.resolution)
    except (IndexError, struct.error):
        raise MessageError("the octomap's data end too early, after %d bytes" % len(data)) from None
    try:
        return Octree(message.resolution, np.array(boxes)) if boxes else None
    except ValueError as error:
        raise MessageError(str(error)) from None


def octomap_message(octree: Octree, pose: np.ndarray, frame: str, stamp: rospy.Time) -> OctomapWithPose:
    """Return the OctomapWithPose, binary, of an Octree at ``pose`` (4, 4) in ``frame``.

    Cells that are not occupied are unknown in it.
    """
    message = OctomapWithPose(origin=pose_of(pose))
    message.header.frame_id, message.header.stamp = frame, stamp
    message.octomap.header = message.header
    message.octomap.binary, message.octomap.id, message.octomap.resolution = True, "OcTree", octree.resolution
    message.octomap.data = occupied_tree(octree).tolist()
    return message


def _children(centre: Triple, size: float) -> list[Triple]:
    """Centres of the eight halves of a cube, x fastest."""
    quarter = 0.25 * size
    return [(centre[0] + (quarter if i & 1 else -quarter), centre[1] + (quarter if i & 2 else -quarter),
             centre[2] + (quarter if i & 4 else -quarter)) for i in range(8)]


def _binary(data: bytes, resolution: float) -> list[Cube]:
    boxes, place = [], 0
    stack = [((0.0, 0.0, 0.0), resolution * 2**_LEVELS)]
    while stack:
        centre, size = stack.pop()
        kinds = data[place] | data[place + 1] << 8
        place += 2
        below = []
        for i, child in enumerate(_children(centre, size)):
            kind = kinds >> 2 * i & 3
            if kind == _OCCUPIED:
                boxes.append((*child, 0.5 * size))
            elif kind == _INNER:
                below.append((child, 0.5 * size))
        stack += below[::-1]
    return boxes


def _full(data: bytes, resolution: float) -> list[Cube]:
    boxes, place = [], 0
    stack = [((0.0, 0.0, 0.0), resolution * 2**_LEVELS)]
    while stack:
        centre, size = stack.pop()
        (odds,) = struct.unpack_from("<f", data, place)
        flags = data[place + 4]
        place += 5
        if not flags:
            if odds > 0.0:
                boxes.append((*centre, size))
            continue
        stack += [(child, 0.5 * size) for i, child in enumerate(_children(centre, size)) if flags >> i & 1][::-1]
    return boxes
