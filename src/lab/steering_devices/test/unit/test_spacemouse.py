# SPDX-License-Identifier: BSD-3-Clause
"""Reports of a SpaceMouse, made by the published format: a few as devices send them, byte for byte."""
import os
import struct

import pytest

from steering_devices.spacemouse import Cap, SpaceMouseDevice, SpaceMouseLost


def report(kind, *values):
    return bytes([kind]) + struct.pack("<%dh" % len(values), *values)


@pytest.mark.parametrize(("sent", "axes"), [
    (report(1, 0, -350, 0), [1.0, 0, 0, 0, 0, 0]),  # pushed away from the user: forward
    (report(1, -175, 0, 0), [0, 0.5, 0, 0, 0, 0]),  # to the left
    (report(1, 0, 0, -350), [0, 0, 1.0, 0, 0, 0]),  # lifted
    (report(1, 0, 420, 0), [-1.0, 0, 0, 0, 0, 0]),  # beyond the end
    (report(2, 0, -350, 0), [0, 0, 0, 1.0, 0, 0]),  # about the axis that points forward
    (report(2, 0, 0, -70), [0, 0, 0, 0, 0, 0.2]),  # turned to the left
    (report(1, 0, 0, -350, 0, 0, -350), [0, 0, 1.0, 0, 0, 1.0]),  # a newer device: all six in one
    (bytes.fromhex("01a2fe00000000"), [0, 1.0, 0, 0, 0, 0])])
def test_axes(sent, axes):
    cap = Cap()
    assert cap.take(sent) and cap.axes == pytest.approx(axes)


def test_translations_and_rotations_come_in_turns():
    cap = Cap()
    cap.take(report(1, 0, -350, 0))
    cap.take(report(2, 0, 0, 350))
    assert cap.axes == pytest.approx([1.0, 0, 0, 0, 0, -1.0])
    cap.take(report(1, 0, 0, 0))
    assert cap.axes == pytest.approx([0, 0, 0, 0, 0, -1.0])


def test_buttons_and_what_means_nothing():
    cap = Cap()
    assert cap.take(bytes.fromhex("030200")) and cap.buttons[:3] == [0, 1, 0]
    assert cap.take(bytes.fromhex("03000001")) and cap.buttons[16] == 1
    assert cap.take(bytes.fromhex("0300")) and not any(cap.buttons)
    for other in (b"", b"\x01\x00", bytes.fromhex("175a00")):  # 0x17: a battery
        before = list(cap.axes)
        assert not cap.take(other) and cap.axes == before


def test_a_device_sends_a_report_a_read():
    start, end = os.pipe2(os.O_DIRECT)  # each write is a report, as of a hidraw device
    device = SpaceMouseDevice("/proc/self/fd/%d" % start)
    os.close(start)
    for sent in (report(1, 1, 2, 3), bytes.fromhex("030100")):
        os.write(end, sent)
    assert device.read(1.0) == [report(1, 1, 2, 3), bytes.fromhex("030100")]
    assert device.read(0.0) == []
    os.close(end)
    with pytest.raises(SpaceMouseLost, match="closed"):
        device.read(1.0)
    device.close()


def test_the_first_spacemouse_is_found_among_others(tmp_path):
    for name, line in (("hidraw0", "HID_ID=0003:0000046D:0000C077"), ("hidraw1", "HID_NAME=no id"),
                       ("hidraw2", "HID_ID=0003:0000256F:0000C635")):
        (tmp_path / name / "device").mkdir(parents=True)
        (tmp_path / name / "device/uevent").write_text("DRIVER=hid-generic\n%s\n" % line)
    with pytest.raises(SpaceMouseLost, match="/dev/hidraw2"):
        SpaceMouseDevice(classes=tmp_path)
    with pytest.raises(SpaceMouseLost, match="connected"):
        SpaceMouseDevice(classes=tmp_path / "nothing")
