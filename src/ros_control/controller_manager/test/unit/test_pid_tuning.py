# SPDX-License-Identifier: BSD-3-Clause
"""Gains that are set while a PID runs, and its published state."""
import numpy as np
import pytest
import rospy
from dynamic_reconfigure.encoding import decode_config, encode_config
from dynamic_reconfigure.srv import ReconfigureRequest

from controller_manager import Gains, Pid
from controller_manager.pid_tuning import TunablePids
from controller_manager.testing import fake_context

NAMES = ["gains/a", "gains/b"]


@pytest.fixture
def tuned():
    """A controller of joints a and b, of which b publishes its state."""
    context, ros = fake_context("arm", {"gains": {"a": {"p": 1.0}, "b": {"p": 2.0, "i": 3.0, "i_clamp": 4.0,
                                                                         "publish_state": True}}})
    pid = Pid(Gains.from_params(context.entry, NAMES))
    pid.tuning = TunablePids.of_controller(context, pid, NAMES)
    pid.ros = ros

    def change(joint, **values):
        request = ReconfigureRequest(encode_config(values))
        return decode_config(ros.services["/robot/arm/gains/%s/set_parameters" % joint](request).config)

    pid.set = change
    return pid


def test_a_change_reaches_its_joint_only(tuned):
    answer = tuned.set("b", p=7.5, antiwindup=True)
    assert (answer["p"], answer["i"], answer["i_clamp_min"], answer["i_clamp_max"]) == (7.5, 3.0, -4.0, 4.0)
    assert tuned.gains.p.tolist() == [1.0, 7.5] and tuned.gains.antiwindup.tolist() == [False, True]
    assert decode_config(tuned.ros.publishers["/robot/arm/gains/b/parameter_updates"].messages[-1])["p"] == 7.5


def test_a_clamp_that_cannot_be_is_refused(tuned):
    with pytest.raises(rospy.ServiceException, match="gains/b: the lower end of the integral term, 5, is above"):
        tuned.set("b", i_clamp_min=5.0)
    assert tuned.gains.i_min.tolist() == [0.0, -4.0]


def test_the_state_is_published_where_it_is_asked_for(tuned):
    output = tuned.update(np.array([0.5, 0.5]), 0.1)
    tuned.tuning.publish(3.25, 0.1, output)
    assert "/robot/arm/gains/a/state" not in tuned.ros.publishers
    state, = tuned.ros.publishers["/robot/arm/gains/b/state"].messages
    assert (state.header.stamp.to_sec(), state.timestep.to_sec()) == (3.25, 0.1)
    assert (state.error, state.p_error, state.p_term, state.i_max, state.i_min) == (0.5, 0.5, 1.0, 4.0, -4.0)
    assert (state.error_dot, state.d_error, state.d_term) == (5.0, 5.0, 0.0)
    assert state.i_error == pytest.approx(0.05) and state.i_term == pytest.approx(0.15)
    assert state.output == pytest.approx(1.15) == pytest.approx(float(output[1]))


def test_nothing_is_published_to_nobody(tuned):
    publisher = tuned.ros.publishers["/robot/arm/gains/b/state"]
    publisher.has_listeners = False
    tuned.tuning.publish(0.0, 0.1, tuned.update(np.array([0.5, 0.5]), 0.1))
    assert publisher.messages == []
