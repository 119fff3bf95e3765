# SPDX-License-Identifier: BSD-3-Clause
"""What goes out: when it is due, and that prepared messages are the ones that genpy would have written."""
from io import BytesIO

import numpy as np
import pytest
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from baxter_sim_hardware.convert import JointStates, stamp
from baxter_sim_hardware.schedule import Schedule


def written(message):
    buffer = BytesIO()
    message.serialize(buffer)
    return buffer.getvalue()


@pytest.mark.parametrize("names", [["left_s0", "head_pan", "right_w2"], ["gelenk_ä"], []])
def test_prepared_joint_states_are_the_same_bytes(names):
    values = np.random.default_rng(3).normal(size=(3, 2 * len(names)))[:, ::2]
    prepared = JointStates(names).message(12.345678901, *values)
    prepared.header.seq = 7
    plain = JointState(Header(7, stamp(12.345678901), ""), names, *(row.tolist() for row in values))
    assert written(prepared) == written(plain)
    assert prepared._type == plain._type and prepared._md5sum == plain._md5sum


@pytest.mark.parametrize("tick_s", [0.001, 0.002, 0.01 / 3])
@pytest.mark.parametrize("rate_hz", [1, 5, 50, 60, 99.9, 100, 500, 1000])
def test_nothing_is_due_before_the_time_that_a_schedule_tells(rate_hz, tick_s):
    asked, told = Schedule(rate_hz), Schedule(rate_hz)
    assert told.next_s < 0.0
    for tick in range(3000):
        now = tick * tick_s
        due = asked.due(now)
        assert not due or now >= told.next_s
        if now >= told.next_s:
            assert told.due(now) == due


def test_a_new_rate_is_due_at_once():
    schedule = Schedule(10)
    schedule.due(0.02)
    assert schedule.next_s == pytest.approx(0.1, abs=1e-6)
    schedule.set_rate(20)
    assert schedule.next_s < 0.0
