# SPDX-License-Identifier: BSD-3-Clause
"""Clouds as a page gets them."""
from types import SimpleNamespace

import numpy as np
import pytest

from lab_web.clouds import MARK, CloudError, packed, points_of


def cloud(points, colours=None, high=1, order="<", pad=0):
    """A message; ``points`` (n, 3), ``colours`` (n, 3) red first."""
    rows = np.zeros(len(points), [("x", order + "f4"), ("y", order + "f4"), ("z", order + "f4"), ("rgb", order + "u4")])
    for number, name in enumerate("xyz"):
        rows[name] = np.asarray(points)[:, number]
    names = ["x", "y", "z"]
    if colours is not None:
        red, green, blue = np.asarray(colours, np.uint32).T
        rows["rgb"] = red << 16 | green << 8 | blue
        names.append("rgb")
    lines = np.frombuffer(rows.tobytes(), np.uint8).reshape(high, -1)
    data = np.pad(lines, ((0, 0), (0, pad))).tobytes()
    fields = [SimpleNamespace(name=name, offset=4 * number, datatype=7, count=1) for number, name in enumerate(names)]
    return SimpleNamespace(width=len(points) // high, height=high, fields=fields, point_step=16,
                           row_step=16 * len(points) // high + pad, is_bigendian=order == ">", data=data)


@pytest.mark.parametrize("order", ["<", ">"])
def test_points_and_colours_without_those_that_were_not_measured(order):
    message = cloud([[1, 2, 3], [np.nan, 0, 0], [4, 5, 6]], [[255, 128, 1], [9, 9, 9], [2, 3, 4]], order=order)
    points, colours = points_of(message)
    assert points.tolist() == [[1, 2, 3], [4, 5, 6]] and colours.tolist() == [[255, 128, 1], [2, 3, 4]]


@pytest.mark.parametrize("high", [1, 20])
def test_a_large_cloud_is_thinned_evenly(high):
    grid = np.array([[column, row, 1] for row in range(20) for column in range(30)])
    points, colours = points_of(cloud(grid, high=high, pad=8), most=200)
    assert 120 <= len(points) <= 200 and len(colours) == len(points)
    assert np.ptp(points[:, 0]) >= 26 and np.ptp(points[:, 1]) >= 17
    assert {tuple(point) for point in points.tolist()} <= {tuple(map(float, point)) for point in grid.tolist()}


def test_an_empty_cloud_is_one():
    assert [len(part) for part in points_of(cloud(np.empty((0, 3))))] == [0, 0]


@pytest.mark.parametrize(("change", "text"), [
    ({"data": b"x"}, "1 bytes are no 2 x 1 points"), ({"fields": []}, "no x, y, z as floats; its fields are none"),
    ({"row_step": 8}, "are no"), ({"point_step": 8, "row_step": 0}, "are no")])
def test_what_is_no_cloud_is_refused_with_the_reason(change, text):
    message = cloud([[1, 2, 3], [4, 5, 6]])
    vars(message).update(change)
    with pytest.raises(CloudError, match=text):
        points_of(message)


def test_the_bytes_for_a_page():
    pose = np.eye(4)
    pose[:3, 3] = 1.0, 2.0, 3.0
    data = packed(np.ones((2, 3), np.float32), np.full((2, 3), 7, np.uint8), pose)
    assert np.frombuffer(data[:8], "<u4").tolist() == [MARK, 2]
    assert np.frombuffer(data[8:56], "<f4").reshape(3, 4).tolist() == pose[:3].tolist()
    assert np.frombuffer(data[56:80], "<f4").tolist() == [1.0] * 6 and data[80:] == b"\7" * 6
