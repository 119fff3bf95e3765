# SPDX-License-Identifier: BSD-3-Clause
"""Names and places of objects that pages add and move."""
import pytest

from lab_web.lab import RobotError
from lab_web.objects import FARTHEST_M, free_name, pose_of


@pytest.mark.parametrize(("taken", "name"), [((), "can"), (("can",), "can_2"), (("can", "can_2", "can_3"), "can_4")])
def test_a_second_object_of_a_kind_has_a_number(taken, name):
    assert free_name("can", taken) == name


def test_an_orientation_is_normalised():
    assert pose_of({"position": [1, 2.0, 3], "orientation": [0, 0, 0, 2]}) == ([1, 2.0, 3], [0, 0, 0, 1])


@pytest.mark.parametrize("operation", [
    {}, {"position": [1, 2, 3]}, {"position": [1, 2], "orientation": [0, 0, 0, 1]},
    {"position": [1, 2, float("nan")], "orientation": [0, 0, 0, 1]}, {"position": "here", "orientation": [0, 0, 0, 1]},
    {"position": [1, 2, 10 ** 400], "orientation": [0, 0, 0, 1]},
    {"position": [1, 2, 3], "orientation": [0, 0, -10 ** 400, 1]},
    {"position": [1, 2, 3], "orientation": [0, 0, 0, 0]},
    {"position": [1, 2, 2.0 * FARTHEST_M], "orientation": [0, 0, 0, 1]}])
def test_what_is_no_place_is_refused(operation):
    with pytest.raises(RobotError):
        pose_of(operation)
