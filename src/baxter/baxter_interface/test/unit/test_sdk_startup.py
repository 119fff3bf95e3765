# SPDX-License-Identifier: BSD-3-Clause
"""Wait until a publisher has its expected subscribers."""
import itertools
import math

import pytest

from baxter_interface import startup
from baxter_interface.io_channel import present_name
from baxter_interface.waiting import others_than


class Publisher:
    """Has one connection more each time it is looked at."""

    resolved_name = "/robot/set_super_stop"

    def __init__(self):
        self.looks = 0
        self._connections = itertools.count()

    def get_num_connections(self):
        self.looks += 1
        return next(self._connections)


@pytest.mark.parametrize("listed, enough, looks", [
    ([], None, 1), ([], 1, 1), (["/robot"], 1, 2), (["/robot", "/recorder"], None, 3), (["/robot", "/recorder"], 1, 2)])
def test_subscribers_are_waited_for_until_there_are_enough(monkeypatch, listed, enough, looks):
    monkeypatch.setattr(startup, "_nodes_of", lambda topic, subscribers: listed)
    publisher = Publisher()
    startup.wait_for_subscribers(publisher, timeout=math.inf, enough=enough)
    assert publisher.looks == looks


PUBLISHED = ("/robot/digital_io/left_lower_cuff/state", "/robot/digital_io/left_button_ok/state", "/robot/state",
             "/clock", "/robot/joint_states")


@pytest.mark.parametrize("name, told", [
    ("/robot/digital_io/left_lower_cough/state", ["left_lower_cuff meant", "left_button_ok, left_lower_cuff"]),
    ("/robot/digital_io/zzz/state", ["in place of zzz there are left_button_ok"]),
    ("/robot/joint_state", ["joint_states"]), ("/a/b/c/d/e/f", [])])
def test_who_asks_for_what_is_not_there_is_told_what_is(name, told):
    text = others_than(name, PUBLISHED)
    assert all(words in text for words in told) and bool(text) == bool(told)


@pytest.mark.parametrize("old, new", [
    ("left_itb_button0", "left_button_ok"), ("torso_right_itb_button2", "torso_right_button_show"),
    ("right_itb_light_outer", "right_outer_light"), ("torso_left_itb_wheel", "torso_left_wheel"),
    ("left_lower_cuff", "left_lower_cuff"), ("left_itb_button3", "left_itb_button3")])
def test_channels_of_sdk_1_0_have_another_name_now(old, new):
    assert present_name(old) == new
