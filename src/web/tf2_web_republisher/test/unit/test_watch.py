# SPDX-License-Identifier: BSD-3-Clause
import math
import threading

import pytest

from tf2_web_republisher.watch import Audience, FrameWatch, WallSchedule, angle_between, period_of

STRAIGHT = (0.0, 0.0, 0.0, 1.0)


def turned(angle):
    return 0.0, 0.0, math.sin(angle / 2), math.cos(angle / 2)


def test_a_transform_is_sent_first_and_when_it_has_moved():
    poses = {"hand": ((0.0, 0.0, 0.0), STRAIGHT, "a")}
    watch = FrameWatch("/base", ["/hand", "hand", "missing"], 0.1, 0.01)

    def lookup(target, source):
        assert target == "base"
        return poses.get(source)
    assert watch.changed(lookup) == [poses["hand"]] and watch.changed(lookup) == []
    poses["hand"] = ((0.009, 0.0, 0.0), STRAIGHT, "b")
    assert watch.changed(lookup) == []
    # Small steps add up.
    poses["hand"] = ((0.011, 0.0, 0.0), STRAIGHT, "c")
    assert watch.changed(lookup)[0][2] == "c"
    poses["hand"] = ((0.011, 0.0, 0.0), turned(0.09), "d")
    assert watch.changed(lookup) == []
    poses["hand"] = ((0.011, 0.0, 0.0), turned(0.11), "e")
    assert watch.changed(lookup)[0][2] == "e"


def test_an_audience_is_gone_after_a_while_without_listeners():
    now = [100.0]
    audience = Audience(10.0, lambda: now[0])
    for now_s, listeners, is_gone in ((105.0, 0, False), (110.0, 2, False), (119.0, 0, False), (120.5, 0, True)):
        now[0] = now_s
        assert audience.is_gone(listeners) is is_gone


def test_the_angle_is_the_same_for_both_signs_of_a_quaternion():
    assert angle_between(STRAIGHT, turned(0.5)) == pytest.approx(0.5)
    assert angle_between(STRAIGHT, tuple(-x for x in turned(0.5))) == pytest.approx(0.5)
    assert angle_between(STRAIGHT, STRAIGHT) == 0.0


@pytest.mark.parametrize(("rate", "period"), [
    (20.0, 0.05), (0.0, 0.1), (-1.0, 0.1), (math.nan, 0.1), (1e9, 0.01), (1e-9, 10.0), (math.inf, 0.01)])
def test_a_rate_is_kept_within_bounds(rate, period):
    assert period_of(rate) == pytest.approx(period)


def test_jobs_run_until_they_end_or_are_removed():
    schedule, often, thrice, failed = WallSchedule(), [], [], []
    done, enough = threading.Event(), threading.Event()

    def until_three():
        thrice.append(1)
        if len(thrice) == 3:
            done.set()
        return len(thrice) < 3

    def always():
        often.append(1)
        if len(often) > 5:
            enough.set()

    def failing():
        failed.append(1)
        raise ValueError("a fault")
    schedule.add(failing, 0.001)
    schedule.add(until_three, 0.001)
    schedule.add(always, 0.001)
    assert done.wait(90) and enough.wait(90)
    schedule.remove(always)
    schedule.end()
    assert len(thrice) == 3 and len(failed) == 1
