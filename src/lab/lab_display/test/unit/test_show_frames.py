# SPDX-License-Identifier: BSD-3-Clause
"""Frames that notebooks ask for by name."""
import contextlib

import pytest
import rospy
import tf2_ros

from lab_display import show


@pytest.mark.parametrize("target, source", [("no\0where", "base"), ("base", "no\0where")])
def test_a_name_with_a_zero_is_refused_at_once(monkeypatch, target, source):
    """tf2's library raises an error of its own for it, that does not name the frame."""
    monkeypatch.setattr(show, "_transforms", lambda: contextlib.nullcontext(tf2_ros.BufferCore(rospy.Duration(10))))
    with pytest.raises(show.ShowError, match=r"'no\\x00where' is not a frame"):
        show.matrix(target, source)
