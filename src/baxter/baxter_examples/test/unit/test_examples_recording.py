# SPDX-License-Identifier: BSD-3-Clause
"""Recordings: written and read back, interpolated, and refused with the line that is wrong."""
import io

import pytest

from baxter_examples import recording
from baxter_examples.recording import COLUMNS, BadRecording


def write(tmp_path, text):
    path = tmp_path / "motion.csv"
    path.write_text(text)
    return str(path)


def test_columns_are_those_of_the_sdk():
    assert ",".join(COLUMNS) == (
        "time,left_s0,left_s1,left_e0,left_e1,left_w0,left_w1,left_w2,left_gripper,"
        "right_s0,right_s1,right_e0,right_e1,right_w0,right_w1,right_w2,right_gripper")


def test_what_is_written_is_read(tmp_path):
    stream = io.StringIO()
    recording.write_row(stream, COLUMNS)
    for time_s in (0.0, 0.5):
        recording.write_row(stream, [time_s, *(0.25 * number for number in range(16))])
    record = recording.read(write(tmp_path, stream.getvalue()))
    assert record.times_s == [0.0, 0.5]
    assert record.rows[1]["right_gripper"] == 3.75
    assert record.side("left") == (COLUMNS[1:8], True)


def test_values_between_and_beyond_the_rows(tmp_path):
    record = recording.read(write(tmp_path, "time,left_w2\n1.0,0.0\n2.0,1.0\n4.0,-1.0\n"))
    assert [record.at(time_s)["left_w2"] for time_s in (0.0, 1.0, 1.25, 2.0, 3.0, 9.0)] == [0, 0, 0.25, 1, 0, -1]
    assert record.duration_s == 4.0
    assert record.side("left") == (["left_w2"], False)
    assert record.side("right") == ([], False)


@pytest.mark.parametrize(("text", "says"), [
    ("left_s0\n1\n", "first line must name the columns"),
    ("time,left_s9\n", "found left_s9"),
    ("time\n1\n", "found none"),
    ("time,left_s0\n", "no rows"),
    ("time,left_s0\n0,1\n0.1,x\n", "line 3: expected 2 numbers, got '0.1,x'"),
    ("time,left_s0\n0,1,2\n", "line 2: expected 2 numbers"),
    ("time,left_s0\n0,nan\n", "line 2: every number must be finite"),
    ("time,left_s0\n0,1\n0,1\n", "line 3: time 0 does not come after 0"),
])
def test_bad_file_is_refused_with_its_line(tmp_path, text, says):
    with pytest.raises(BadRecording, match=says):
        recording.read(write(tmp_path, text))


@pytest.mark.parametrize(("make", "says"), [
    (lambda path: path.symlink_to("/dev/zero"), "a device"), (lambda path: path.touch(), "empty"),
    (lambda path: path.mkdir(), "a folder")])
def test_what_is_no_file_is_not_waited_for(tmp_path, make, says):
    make(tmp_path / "motion.csv")
    with pytest.raises(OSError, match=says):
        recording.read(tmp_path / "motion.csv")
