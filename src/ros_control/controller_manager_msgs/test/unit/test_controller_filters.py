# SPDX-License-Identifier: BSD-3-Clause
"""Controllers by their properties."""
import pytest
from controller_manager_msgs.msg import ControllerState, HardwareInterfaceResources

from controller_manager_msgs import utils

POSITION, EFFORT = ("hardware_interface::%sJointInterface" % kind for kind in ("Position", "Effort"))
ARM = ControllerState("arm", "running", "position_controllers/A", [HardwareInterfaceResources(POSITION, ["a", "b"])])
HAND = ControllerState("hand", "stopped", "effort_controllers/A", [HardwareInterfaceResources(EFFORT, ["c"])])
BOTH = [ARM, HAND]


@pytest.mark.parametrize(("found", "expected"), [
    (utils.filter_by_name(BOTH, "arm"), [ARM]),
    (utils.filter_by_name(BOTH, "a"), []),
    (utils.filter_by_name(BOTH, "a", match_substring=True), BOTH),
    (utils.filter_by_type(BOTH, "effort_controllers/A"), [HAND]),
    (utils.filter_by_state(BOTH, "running"), [ARM]),
    (utils.filter_by_hardware_interface(BOTH, EFFORT), [HAND]),
    (utils.filter_by_hardware_interface(BOTH, "Position", match_substring=True), [ARM]),
    (utils.filter_by_resources(BOTH, ["a", "b"]), [ARM]),
    (utils.filter_by_resources(BOTH, ["a", "c"]), []),
    (utils.filter_by_resources(BOTH, ["a", "c"], match_any=True), BOTH),
    (utils.filter_by_resources(BOTH, ["c"], hardware_interface=POSITION), []),
])
def test_filters(found, expected):
    assert found == expected
