# SPDX-License-Identifier: BSD-3-Clause
"""Arrays from messages with pictures and points."""
import numpy as np

from urdf_model.transforms import matrix_from_quaternion, rigid


def picture_of(image):
    """(height, width, 3) uint8 of an rgb8 message."""
    return np.frombuffer(image.data, np.uint8).reshape(image.height, image.width, 3)


def points_of(cloud):
    """(height, width, 3) float32 x y z, and (height, width, 3) uint8 red green blue, of a PointCloud2."""
    raw = np.frombuffer(cloud.data, np.uint8).reshape(cloud.height, cloud.width, cloud.point_step)
    place = {field.name: field.offset for field in cloud.fields}
    xyz = np.ascontiguousarray(raw[:, :, place["x"]:place["x"] + 12]).view(np.float32)
    return xyz, raw[:, :, place["rgb"]:place["rgb"] + 3][:, :, ::-1]


def is_red(colours):
    """Mask of (..., 3) uint8 colours of a red body, in light or shade."""
    r, g, b = (colours[..., k].astype(int) for k in range(3))
    return (r > 50) & (g < r // 3) & (b < r // 3)


def matrix_of(transform):
    """(4, 4) of a geometry_msgs/TransformStamped."""
    q, t = transform.transform.rotation, transform.transform.translation
    return rigid(matrix_from_quaternion((q.x, q.y, q.z, q.w)), (t.x, t.y, t.z))
