# SPDX-License-Identifier: BSD-3-Clause
"""Kinds of grippers, without ROS connections."""
import pytest

from baxter_interface.gripper_types import TYPES, judge_firmware
from baxter_interface.settings import SDK_VERSION, VERSIONS_SDK2GRIPPER

DATES = VERSIONS_SDK2GRIPPER[SDK_VERSION]


@pytest.mark.parametrize("date, fits, text", [
    ("2014/7/24 18:30:00", True, ""),
    ("2014/5/20 00:00:00", True, "is old"),
    ("2013/10/15 00:00:00", False, "too old"),
    ("", False, "firmware date is ''"),
])
def test_firmware_is_judged_by_its_date(date, fits, text):
    verdict, said = judge_firmware(date, DATES)
    assert verdict is fits
    assert text in said and bool(text) == bool(said)


def test_kinds_have_the_names_that_programs_compare_with():
    assert {number: kind.name for number, kind in TYPES.items()} == {1: "suction", 2: "electric", 3: "custom"}
