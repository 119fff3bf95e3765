# SPDX-License-Identifier: BSD-3-Clause
"""Published messages: when they are due, and that prepared messages equal those of genpy."""
from io import BytesIO

import numpy as np
import pytest
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from baxter_sim_hardware.topics.convert import JointStates
from sim_time.stamps import stamp


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
