# SPDX-License-Identifier: BSD-3-Clause
"""Playfiles: reading, checking, timing, joining, writing."""
import pathlib
import sys

import numpy as np
import pytest

from baxter_traj_streamer.judging import KNOWN_JOINTS, StreamedJointLimit
from baxter_traj_streamer.playfile import Playfile, PlayfileError, check, merged
from baxter_traj_streamer.settings import SIDES, arm_joint_names

sys.path.insert(0, str(pathlib.Path(__file__).parents[1]))
from streamer_settings import make_settings  # noqa: E402

SETTINGS = make_settings()
LIMITS = {name: StreamedJointLimit(-2.0, 2.0, 1.5) for name in KNOWN_JOINTS}
THREE_ROWS = """# wave
0.1, 0, 0, 0, 0, 0, 0, 0.2

0.3, 0, 0, 0, 0, 0, 0.3, 0.6,
0.1, 0, 0, 0, 0, 0, 0, 1.4
"""


def row(first, time_s):
    return "%s, 0, 0, 0, 0, 0, 0, %s\n" % (first, time_s)


def test_rows_comments_and_blank_lines():
    file = Playfile.parse(THREE_ROWS)
    assert file.times == pytest.approx([0.2, 0.6, 1.4])
    assert file.positions.shape == (3, 7)
    assert file.positions[:, 0] == pytest.approx([0.1, 0.3, 0.1])
    assert file.lines == (2, 4, 5)


def test_what_is_written_is_read_again(tmp_path):
    file = Playfile.parse(THREE_ROWS)
    path = tmp_path / "wave.jsp"
    path.write_text(file.text(), encoding="utf-8")
    again = Playfile.read(path)
    assert np.array_equal(again.positions, file.positions) and np.array_equal(again.times, file.times)
    assert again.source == str(path)


@pytest.mark.parametrize("text, words", [
    ("", ("no rows", "s0", "arrival time")),
    (row(0.1, 0.2) + "0.1, 0.2\n", ("line 2", "2 numbers", "expected 8")),
    (row(0.1, 0.2) + row("x", 0.4), ("line 2", "s0", "'x'")),
    (row("nan", 0.2), ("line 1", "s0", "finite")),
    (row(0.1, "inf"), ("line 1", "arrival time", "finite")),
    (row(0.1, 0.4) + row(0.1, 0.4), ("line 2", "0.4 s", "line 1")),
    (row(0.1, -0.4), ("line 1", "-0.4 s")),
])
def test_bad_files_are_refused_by_line(text, words):
    with pytest.raises(PlayfileError) as caught:
        Playfile.parse(text, "bad.jsp")
    for word in ("bad.jsp", *words):
        assert word in str(caught.value)


def test_file_that_is_no_text_is_refused(tmp_path):
    path = tmp_path / "picture.jsp"
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(PlayfileError, match="picture.jsp is not a text"):
        Playfile.read(path)


@pytest.mark.parametrize("side", SIDES)
def test_check_names_file_line_joint_value_and_limit(side):
    check({side: Playfile.parse(THREE_ROWS)}, LIMITS, SETTINGS)
    check({side: Playfile.parse(row(0.1, 0.2))}, LIMITS, SETTINGS)
    with pytest.raises(PlayfileError) as caught:
        check({side: Playfile.parse(THREE_ROWS.replace("0.3, 0.6", "2.5, 0.6"), "far.jsp")}, LIMITS, SETTINGS)
    for word in ("far.jsp, line 4", "%s_w2" % side, "2.5", "2.001"):
        assert word in str(caught.value)
    with pytest.raises(PlayfileError, match=r"fast.jsp, line 3.*s0.*rad/s"):
        check({side: Playfile.parse(row(0, 0.2) + row(0.1, 0.6) + row(1.9, 0.8), "fast.jsp")}, LIMITS, SETTINGS)


def test_check_of_two_files_names_the_right_one():
    good, bad = Playfile.parse(THREE_ROWS, "good.jsp"), Playfile.parse(row(0, 0) + row(2.5, 9.0), "bad.jsp")
    with pytest.raises(PlayfileError, match="bad.jsp, line 2.*left_s0"):
        check({"right": good, "left": bad}, LIMITS, SETTINGS)


def test_retimed_by_the_notes_rule():
    file = Playfile.parse(THREE_ROWS).retimed(SETTINGS.planning_velocity(), 0.02)
    # s0 goes 0.2 rad at 0.25 rad/s.
    assert file.times == pytest.approx([0.0, 0.8, 1.6])


def test_two_arms_begin_together_and_each_rests_after_its_end():
    right, left = Playfile.parse(row(0, 5.0) + row(1, 6.0)), Playfile.parse(row(0, 0) + row(0.5, 0.5) + row(2, 2.0))
    names, times, positions = merged({"right": right, "left": left})
    assert names == arm_joint_names("right") + arm_joint_names("left")
    assert times == pytest.approx([0.0, 0.5, 1.0, 2.0])
    assert positions[:, 0] == pytest.approx([0.0, 0.5, 1.0, 1.0])
    assert positions[:, 7] == pytest.approx([0.0, 0.5, 1.0, 2.0])
