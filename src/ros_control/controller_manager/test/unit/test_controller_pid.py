# SPDX-License-Identifier: BSD-3-Clause
"""PID, with control_toolbox's meaning of gains and clamps."""
import numpy as np
import pytest

from controller_manager import ControllerError, Gains, Pid
from controller_manager.testing import fake_context


def pid(p=0.0, i=0.0, d=0.0, i_min=0.0, i_max=0.0, antiwindup=False):
    return Pid(Gains(p, i, d, i_min, i_max, antiwindup))


def run(controller, errors, dt=0.1):
    return [float(controller.update(np.array([error]), dt)[0]) for error in errors]


def test_proportional():
    assert run(pid(p=2.0), [1.0, -3.0]) == [2.0, -6.0]


def test_the_error_before_the_first_counts_as_zero():
    assert run(pid(d=1.0), [1.0, 1.0, 0.5]) == pytest.approx([10.0, 0.0, -5.0])


def test_a_given_derivative_is_used():
    assert pid(d=2.0).update(np.array([9.0]), 0.1, np.array([1.5])) == pytest.approx([3.0])


def test_the_integral_term_is_clamped_and_the_integral_grows_on():
    controller = pid(i=1.0, i_min=-0.2, i_max=0.2)
    assert run(controller, [1.0] * 5) == pytest.approx([0.1, 0.2, 0.2, 0.2, 0.2])
    assert run(controller, [-1.0] * 4) == pytest.approx([0.2, 0.2, 0.2, 0.1]), "windup: it has to come back first"


def test_antiwindup_clamps_the_integral_itself():
    controller = pid(i=2.0, i_min=-0.4, i_max=0.4, antiwindup=True)
    assert run(controller, [1.0] * 5) == pytest.approx([0.2, 0.4, 0.4, 0.4, 0.4])
    assert run(controller, [-1.0] * 2) == pytest.approx([0.2, 0.0])


def test_without_a_clamp_the_integral_term_is_zero():
    assert run(pid(i=5.0), [1.0] * 3) == [0.0, 0.0, 0.0]


@pytest.mark.parametrize("dt", [0.0, -0.1, float("nan")])
def test_no_time_no_output(dt):
    controller = pid(p=1.0, d=1.0)
    assert run(controller, [1.0], dt) == [0.0]
    assert controller.last_error[0] == 0.0


def test_a_joint_without_a_finite_error_gets_nothing_and_keeps_its_past():
    controller = Pid(Gains([1.0, 1.0], [1.0, 1.0], [0.0, 0.0], [-1, -1], [1, 1], [False, False]))
    controller.update(np.array([1.0, 1.0]), 0.1)
    assert controller.update(np.array([np.nan, 1.0]), 0.1) == pytest.approx([0.0, 1.2])
    assert controller.update(np.array([1.0, 1.0]), 0.1) == pytest.approx([1.2, 1.3])


def test_reset_forgets():
    controller = pid(p=1.0, i=1.0, d=1.0, i_min=-9, i_max=9)
    first = run(controller, [1.0, 2.0])
    controller.reset()
    assert run(controller, [1.0, 2.0]) == first


def test_gains_change_in_flight_and_the_past_stays():
    controller = Pid(Gains([1.0, 1.0], [1.0, 1.0], [0.0, 0.0], [-9, -9], [9, 9], [False, False]))
    controller.update(np.array([1.0, 1.0]), 0.1)
    before = controller.gains
    controller.change(1, 2.0, 3.0, 4.0, -0.5, 0.5, False)
    assert controller.update(np.array([1.0, 2.0]), 0.1) == pytest.approx([1.2, 4.0 + 0.5 + 40.0])
    assert controller.terms(1) == pytest.approx((4.0, 0.5, 40.0))
    assert before.p.tolist() == [1.0, 1.0], "nobody else's arrays are written"
    with pytest.raises(ControllerError, match="lower end of the integral term, 2, is above its upper end, 1"):
        controller.change(0, 1.0, 0.0, 0.0, 2.0, 1.0, False)
    assert controller.gains.i_max.tolist() == [9.0, 0.5]


def gains(**values):
    context, _ = fake_context("arm", {"pid": values})
    return Gains.from_params(context.entry, ["pid"])


def test_gains_are_read_from_parameters():
    found = gains(p=1, i=2, d=3, i_clamp=-4)
    assert (found.p[0], found.i[0], found.d[0], found.i_min[0], found.i_max[0]) == (1, 2, 3, -4, 4)
    assert not found.antiwindup[0]
    found = gains(p=1, i_clamp=1, i_clamp_min=-5, i_clamp_max=6, antiwindup=True)
    assert (found.i[0], found.d[0], found.i_min[0], found.i_max[0], bool(found.antiwindup[0])) == (0, 0, -5, 6, True)


@pytest.mark.parametrize(("values", "text"), [
    ({"i": 1.0}, "/robot/arm/pid/p is missing; give the proportional gain"),
    ({"p": "much"}, "/robot/arm/pid/p is 'much', expected a number"),
    ({"p": 1.0, "i_clamp_min": 2.0, "i_clamp_max": 1.0}, "above i_clamp_max"),
    ({"p": 1.0, "antiwindup": "yes"}, "antiwindup is 'yes', expected true or false"),
])
def test_wrong_gains_are_named(values, text):
    with pytest.raises(ControllerError, match=text):
        gains(**values)
