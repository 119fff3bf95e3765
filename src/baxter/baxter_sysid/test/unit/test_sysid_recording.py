# SPDX-License-Identifier: BSD-3-Clause
"""Files of recordings: what is read although it is uneven, and what an error says of a file that is no recording."""
import numpy as np
import pytest
import rospkg

import xacro
from baxter_model import JOINTS, joint_names, poses
from baxter_sysid.arm_body import TICK_S
from baxter_sysid.errors import SysidError
from baxter_sysid.recording import ArmRecording, start_of
from urdf_model import parse_urdf

COLUMNS = ["time_s", *("left_%s_%s_rad" % (joint, kind) for kind in ("commanded", "sensed") for joint in JOINTS)]
NEUTRAL = np.array(list(poses().angles("neutral", "left").values()))


@pytest.fixture(scope="module")
def robot():
    path = rospkg.RosPack().get_path("baxter_description") + "/urdf/baxter.urdf.xacro"
    return parse_urdf(xacro.process_file(path).toxml(), source=path)


def swinging(time_s):
    """A recording of an arm that swings around its pose, exactly as it is commanded."""
    rows = NEUTRAL + 0.2 * np.sin(time_s)[:, None]
    return ArmRecording(time_s, {"left": rows}, {"left": rows.copy()})


def text_of(recording, mark=","):
    rows = np.column_stack([recording.time_s, recording.commanded["left"], recording.sensed["left"]])
    return "\n".join([mark.join(COLUMNS), *(mark.join("%.6f" % cell for cell in row) for row in rows)]) + "\n"


GOOD = text_of(swinging(0.01 * np.arange(200)))
LINES = GOOD.splitlines()


def changed(line, cell, value):
    lines = LINES.copy()
    cells = lines[line].split(",")
    cells[cell] = value
    lines[line] = ",".join(cells)
    return "\n".join(lines)


@pytest.mark.parametrize("text, said", [
    ("", "empty"), ("\0\1\xff", "text"), (LINES[0], "0 rows"), ("\n".join(LINES[:2]), "1 rows"),
    (text_of(swinging(0.01 * np.arange(200)), ";"), "';'"),
    (GOOD.replace("left_w1_sensed_rad", "left_w1_sensed"), "no column left_w1_sensed_rad"),
    (GOOD.replace("_rad", "_deg"), "left_s0_commanded_deg"), (GOOD.replace("time_s", "stamp"), "no column time_s"),
    (GOOD.replace("left_w1_sensed_rad", "left_w2_sensed_rad", 1).replace("left_w0_sensed_rad", "left_w1_sensed_rad", 1),
     "no column left_w0_sensed_rad"),
    (changed(0, 0, "time_s,time_s"), "more than one column time_s"),
    (changed(7, 9, "nan"), "left_s1_sensed_rad is nan at 0.06 s"),
    (changed(7, 2, "inf"), "left_s1_commanded_rad is inf"),
    (changed(7, 9, "abc"), "line 8: left_s1_sensed_rad is 'abc'"),
    (changed(7, 9, ""), "line 8: left_s1_sensed_rad is ''"),
    ("\n".join([*LINES, "2.00,0.1"]), "line 202 has 2 columns, and the first line has 15"),
    (changed(7, 0, "0.03"), "after row 6 time_s goes from 0.05 to 0.03"), (changed(7, 0, "0.05"), "from 0.05 to 0.05"),
    (changed(7, 0, "nan"), "from 0.05 to nan"),
    (text_of(swinging(np.arange(200.0))), "from 0 to 1; times must rise by 0.05 s or less"),
    (text_of(swinging(0.05 * np.arange(12100))), "605 s long; it must be 600 s or less")])
def test_an_error_says_what_was_found(tmp_path, text, said):
    path = tmp_path / "arm.csv"
    path.write_bytes(text.encode("latin-1"))
    with pytest.raises(SysidError, match="arm.csv") as caught:
        ArmRecording.read(path)
    assert said in str(caught.value) and "\n" not in str(caught.value)


def test_what_is_no_file_is_refused_at_once(tmp_path):
    for path, said in ((tmp_path, "folder"), ("/dev/zero", "device"), (tmp_path / "none.csv", "none.csv cannot")):
        with pytest.raises(SysidError, match=said):
            ArmRecording.read(path)


def test_a_file_that_is_too_large_is_refused_before_it_is_read(tmp_path):
    path = tmp_path / "huge.csv"
    with path.open("wb") as file:
        file.truncate(10**12)
    with pytest.raises(SysidError, match="1000000000000 bytes, expected at most"):
        ArmRecording.read(path)


def test_a_table_of_other_programs_is_read(tmp_path):
    """With a byte order mark, quotes, spaces, lines without text, and a column of words."""
    lines = ['\ufeff"time_s", ' + ", ".join('"%s"' % column for column in COLUMNS[1:]) + ', "note"', "",
             *(line + ",words" for line in LINES[1:]), ""]
    (tmp_path / "arm.csv").write_text("\r\n".join(lines), encoding="utf-8")
    (tmp_path / "plain.csv").write_text(GOOD)
    read, plain = (ArmRecording.read(tmp_path / name) for name in ("arm.csv", "plain.csv"))
    np.testing.assert_array_equal(read.sensed["left"], plain.sensed["left"])


@pytest.mark.parametrize("period_s, step_s", [(0.001, TICK_S), (0.0101, 0.01), (0.0034, 0.004), (0.05, 0.05)])
def test_rows_of_any_rate_are_put_into_whole_ticks(tmp_path, period_s, step_s):
    time_s = period_s * np.arange(int(4.0 / period_s))
    time_s[1:-1] += 0.3 * period_s * np.random.default_rng(0).uniform(-1.0, 1.0, len(time_s) - 2) * (period_s < 0.05)
    path = tmp_path / "arm.csv"
    path.write_text(text_of(swinging(time_s)))
    read = ArmRecording.read(path)
    np.testing.assert_allclose(np.diff(read.time_s), step_s, atol=1e-9)
    assert read.time_s[-1] == pytest.approx(time_s[-1], abs=step_s + 1e-6)
    np.testing.assert_allclose(read.sensed["left"], swinging(read.time_s).sensed["left"], atol=1e-4)


def test_an_arm_that_cannot_have_been_there_is_refused(robot):
    good = swinging(0.01 * np.arange(200))
    good.require_motion("it", robot, ("left",))
    degrees = ArmRecording(good.time_s, *({"left": np.degrees(good.commanded["left"])} for _ in range(2)))
    still = ArmRecording(good.time_s, *({"left": np.tile(NEUTRAL, (200, 1))} for _ in range(2)))
    swapped = good.commanded["left"].copy()
    swapped[:, [1, 3]] = swapped[:, [3, 1]]
    for recording, said in ((degrees, "in degrees"), (still, "is commanded to go farther than 0 rad"),
                            (good._replace(sensed=degrees.sensed), "left_s0_sensed_rad is"),
                            (good._replace(commanded={"left": swapped}), "left_s1 is 1.30 rad from")):
        with pytest.raises(SysidError, match=said):
            recording.require_motion("it", robot, ("left",))


def test_noise_at_rest_is_no_motion_and_moves_no_start():
    random = np.random.default_rng(3)
    commanded = np.tile(NEUTRAL, (400, 1))
    commanded[150:] += 0.3 * np.sin(0.02 * np.arange(250))[:, None]
    off, starts = [], []
    for _ in range(20):
        position, velocity = start_of(commanded + 1e-3 * random.standard_normal(commanded.shape), 0.01, commanded)
        off.append(position - NEUTRAL)
        starts.append(velocity)
    assert np.abs(starts).max() == 0.0 and np.std(off) < 3e-4


def test_an_arm_that_moves_before_it_is_commanded_to_begins_in_motion():
    time_s = 0.01 * np.arange(400)
    sensed = NEUTRAL + 0.1 * np.exp(-time_s / 0.2)[:, None]
    position, velocity = start_of(sensed, 0.01, np.tile(NEUTRAL, (400, 1)))
    np.testing.assert_allclose(position, NEUTRAL + 0.1, atol=1e-3)
    np.testing.assert_allclose(velocity, -0.5, atol=0.05)


def test_names_of_columns_are_those_that_are_written(tmp_path):
    swinging(0.01 * np.arange(20)).write(tmp_path / "arm.csv")
    assert set((tmp_path / "arm.csv").read_text().splitlines()[0].split(",")) == set(COLUMNS)
    assert all(name in "".join(COLUMNS) for name in joint_names("left"))
