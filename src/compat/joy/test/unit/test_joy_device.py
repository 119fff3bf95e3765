# SPDX-License-Identifier: BSD-3-Clause
"""The kernel's joystick events, when messages are due, and devices that are not there."""
import errno
import math
import os
import struct

import pytest

from joy import JoystickDevice, JoystickLost, Outgoing, Readings

BUTTON, AXIS, INITIAL = 1, 2, 0x80


def event(kind, number, value):
    return struct.pack("=IhBB", 0, value, kind, number)


@pytest.mark.parametrize("raw, expected", [
    (0, 0.0), (-32767, 1.0), (32767, -1.0), (-32768, 1.0), (1638, 0.0), (-1638, 0.0),
    (-17203, 0.5),  # half way from 5 % to the end
    (17203, -0.5),
])
def test_left_and_up_are_positive_and_a_dead_zone_reads_zero(raw, expected):
    readings = Readings(0.05)
    readings.take(event(AXIS, 0, raw))
    assert readings.axes == [pytest.approx(expected, abs=2e-4)]


def test_without_a_dead_zone_the_reading_is_the_share():
    readings = Readings(0.0)
    readings.take(event(AXIS, 1, 3277))
    assert readings.axes == [0.0, pytest.approx(-0.1, abs=1e-4)]


def test_events_may_be_cut_anywhere():
    data = event(AXIS | INITIAL, 1, -32767) + event(BUTTON, 2, 1) + event(BUTTON, 0, 1)
    readings = Readings()
    for byte in data:
        readings.take(bytes([byte]))
    assert (readings.axes, readings.buttons) == ([0.0, 1.0], [1, 0, 1])


@pytest.mark.parametrize("data, expected", [
    (event(BUTTON, 0, 1), (True, True)),
    (event(BUTTON | INITIAL, 0, 1), (True, False)),
    (event(AXIS, 0, 20000), (True, False)),
    (event(AXIS, 0, 100), (False, False)),  # within the dead zone, where it was
    (event(BUTTON, 0, 0), (False, False)),
    (event(0x10, 0, 1), (False, False)),
    (b"", (False, False)),
])
def test_what_has_changed(data, expected):
    readings = Readings()
    readings.restart(1, 1)
    assert readings.take(data) == expected


def test_a_new_device_starts_at_rest_with_its_own_numbers():
    readings = Readings()
    readings.take(event(AXIS, 3, 32767) + event(BUTTON, 9, 1) + b"half")
    readings.restart(2, 1)
    readings.take(event(BUTTON, 0, 1))
    assert (readings.axes, readings.buttons) == ([0.0, 0.0], [1])


@pytest.mark.parametrize("deadzone", [-0.1, 0.91, math.nan])
def test_dead_zones_out_of_range(deadzone):
    with pytest.raises(ValueError, match="deadzone is .*; it must be from 0 to 0.9"):
        Readings(deadzone)


def test_sticks_wait_for_each_other_and_buttons_do_not():
    outgoing = Outgoing(coalesce_s=0.01)
    assert outgoing.wait_s(1.0) == math.inf
    outgoing.changed(1.0, at_once=False)
    outgoing.changed(1.009, at_once=False)
    assert not outgoing.is_due(1.009) and outgoing.is_due(1.01)
    outgoing.sent(1.01)
    assert not outgoing.is_due(100.0)
    outgoing.changed(2.0, at_once=False)
    outgoing.changed(2.001, at_once=True)
    assert outgoing.is_due(2.001)


def test_the_last_message_is_repeated_until_the_device_goes():
    outgoing = Outgoing(repeat_hz=20.0)
    outgoing.sent(1.0)
    assert outgoing.wait_s(1.0) == pytest.approx(0.05) and outgoing.is_due(1.051)
    outgoing.cancel()
    assert not outgoing.is_due(100.0)


@pytest.mark.parametrize("values", [{"coalesce_s": -1.0}, {"coalesce_s": math.nan}, {"repeat_hz": -1.0},
                                    {"repeat_hz": 1e4}, {"repeat_hz": math.inf}])
def test_rates_out_of_range(values):
    with pytest.raises(ValueError, match="it must be from 0 to"):
        Outgoing(**values)


def test_a_device_that_is_not_there_says_what_to_do(tmp_path):
    # In the user's language, as from the system.
    missing = os.strerror(errno.ENOENT)
    with pytest.raises(JoystickLost, match="no joystick at .*js7: %s; plug one in, or set ~dev" % missing):
        JoystickDevice(str(tmp_path / "js7"))


def test_a_device_is_read_and_its_end_is_noticed(tmp_path):
    path = str(tmp_path / "js0")
    os.mkfifo(path)
    device = JoystickDevice(path)
    writer = os.open(path, os.O_WRONLY)
    assert (device.axes, device.buttons) == (0, 0) and device.read(0.01) == b""
    os.write(writer, event(BUTTON, 0, 1))
    assert device.read(10.0) == event(BUTTON, 0, 1)
    os.close(writer)
    with pytest.raises(JoystickLost, match="is lost: it was closed"):
        device.read(10.0)
    device.close()
