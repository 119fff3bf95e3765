# SPDX-License-Identifier: BSD-3-Clause
"""Recordings: what is written, what is refused, and how the arms play them."""
import pytest

from baxter_examples.recording import COLUMNS
from lab_web.lab import TICK_S, RobotError
from lab_web.motion import LEAD_RAD, SPEED_SHARE, MotionError, PageJointLimits
from lab_web.playback import LONGEST_S, MotionRecorder, RecordingPlayback, recording_of, text_of

LIMITS = {"left_s0": PageJointLimits(-1.7, 1.7, 1.5), "left_s1": PageJointLimits(-2.0, 1.0, 1.5)}
WAY = b"time,left_s0,left_s1,left_gripper\n0,0.5,0,100\n1,1.0,0.2,100\n2,0.5,0,0\n"


def played(playback, measured, seconds=60.0):
    """Set-points until the end, for a robot that follows at once."""
    seen = []
    while playback.is_moving:
        setpoints = playback.step(TICK_S, measured)
        measured.update({name: value for name, value in setpoints.items() if name in LIMITS})
        seen.append(setpoints)
        assert len(seen) * TICK_S < seconds
    return seen


def test_a_recording_begins_at_zero_and_its_file_is_joint_recorders():
    told = []
    recorder = MotionRecorder(told.append)
    recorder.take(1.0, {"left_s0": 9.0})
    recorder.record(1, {"on": True})
    for number in range(3):
        recorder.take(5.0 + 0.5 * number, {"left_s0": 0.1 * number, "left_gripper": 50.0})
        recorder.take(5.0 + 0.5 * number, {"left_s0": 7.0})
    recorder.record(2, {"on": False})
    assert told == [{"running": True, "seconds": None}, {"running": False, "seconds": 1.0}]
    lines = text_of(recorder.recording).splitlines()
    assert lines[0] == ",".join(COLUMNS) and len(lines) == 4
    again = recording_of(text_of(recorder.recording).encode())
    assert again.times_s == [0.0, 0.5, 1.0] and again.rows == recorder.recording.rows
    assert again.rows[2]["left_s0"] == 0.2 and again.rows[2]["left_gripper"] == 50.0


def test_a_reset_simulation_begins_the_recording_again():
    recorder = MotionRecorder(lambda state: None)
    recorder.record(1, {"on": True})
    for time_s in (5.0, 6.0, 0.5, 1.0):
        recorder.take(time_s, {})
    recorder.record(1, {"on": False})
    assert recorder.recording.times_s == [0.0, 0.5]


def test_a_recording_that_nobody_ends_ends():
    told = []
    recorder = MotionRecorder(told.append)
    recorder.record(1, {"on": True})
    for time_s in (0.0, LONGEST_S / 2.0, LONGEST_S + 1.0, LONGEST_S + 2.0):
        recorder.take(time_s, {})
    assert told[-1] == {"running": False, "seconds": LONGEST_S + 1.0} and len(recorder.recording.rows) == 3


@pytest.mark.parametrize("operation", [{"on": False}, {}])
def test_nothing_to_end_is_told(operation):
    with pytest.raises(RobotError, match="nothing is being recorded"):
        MotionRecorder(lambda state: None).record(1, operation)


@pytest.mark.parametrize("content", [None, "time,left_s0", {"rows": []}])
def test_only_an_upload_loads_a_recording(content):
    with pytest.raises(RobotError, match="upload"):
        MotionRecorder(lambda state: None).load(1, {"content": content})


def test_the_arms_go_to_the_start_slowly_and_then_as_recorded():
    measured = {"left_s0": -1.0, "left_s1": 0.9}
    seen = played(RecordingPlayback(LIMITS, recording_of(WAY), measured), measured)
    start = next(number for number, setpoints in enumerate(seen) if "left_gripper" in setpoints)
    assert start * TICK_S > 1.5 / (SPEED_SHARE * 1.5) * 0.9
    assert (len(seen) - start) * TICK_S == pytest.approx(2.0, abs=0.05)
    middle = seen[start + round(1.0 / TICK_S)]
    assert middle["left_s0"] == pytest.approx(1.0, abs=0.02) and middle["left_s1"] == pytest.approx(0.2, abs=0.01)
    assert seen[-1] == {"left_s0": 0.5, "left_s1": 0.0, "left_gripper": 0.0}


def test_a_recording_that_is_too_fast_is_played_at_the_speed_limit():
    measured = {"left_s0": -1.5}
    seen = played(RecordingPlayback(LIMITS, recording_of(b"time,left_s0\n0,-1.5\n0.1,1.5\n"), measured), measured)
    steps = [abs(after["left_s0"] - before["left_s0"]) for before, after in zip(seen, seen[1:], strict=False)]
    assert max(steps) <= 1.5 * TICK_S * 1.001 and seen[-1]["left_s0"] == 1.5


def test_an_arm_that_is_held_is_waited_for():
    measured = {"left_s0": 0.5, "left_s1": 0.0}
    playback = RecordingPlayback(LIMITS, recording_of(WAY), measured)
    for _ in range(1000):
        setpoints = playback.step(TICK_S, measured)
    assert playback.is_moving and LEAD_RAD < setpoints["left_s0"] - 0.5 < LEAD_RAD + 0.03
    assert playback.step(TICK_S, {}) == setpoints
    with pytest.raises(MotionError, match="something else has moved left_s0"):
        playback.step(TICK_S, {**measured, "left_s0": -0.5})
    assert playback.stop() and not playback.stop() and not playback.is_moving


@pytest.mark.parametrize(("content", "said"), [
    (b"time,left_s0\n0,0\n1,1.9\n", "left_s0 at 1.9000 rad at 1.00 s"),
    (b"time,left_s0\n0,nan\n", "finite"), (b"", "first line"), (b"\xff", "decode")])
def test_what_cannot_be_played_is_refused_with_the_reason(content, said):
    with pytest.raises(MotionError, match=said):
        RecordingPlayback(LIMITS, recording_of(content), {"left_s0": 0.0})


def test_noise_at_a_limit_is_clamped():
    measured = {"left_s0": 1.7}
    seen = played(RecordingPlayback(LIMITS, recording_of(b"time,left_s0\n0,1.705\n1,1.71\n"), measured), measured)
    assert {setpoints["left_s0"] for setpoints in seen} == {1.7}
