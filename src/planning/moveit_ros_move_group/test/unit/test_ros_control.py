# SPDX-License-Identifier: BSD-3-Clause
"""Controllers that controller managers list at the time of a motion."""
import threading

import pytest
import rospy
from controller_manager_msgs.msg import ControllerState, HardwareInterfaceResources

from moveit_ros_move_group.controllers import FOLLOW, GRIPPER, ControllerEntry, NoControllers
from moveit_ros_move_group.ros_control import RosControl


def state(name, kind, joints, now="running"):
    return ControllerState(name, now, kind, [HardwareInterfaceResources("interface", joints)])


ARM = state("arm", "effort_controllers/JointTrajectoryController", ["a", "b"])
HAND = state("hand", "position_controllers/GripperActionController", ["finger"])
OTHERS = [state("other_arm", "position_controllers/JointTrajectoryController", ["a", "b"], "stopped"),
          state("joint_state_controller", "joint_state_controller/JointStateController", []),
          state("single", "position_controllers/JointPositionController", ["b"])]


def actions(controllers):
    return [(controller.kind, controller.action, controller.joints) for controller in controllers]


@pytest.mark.parametrize("namespace, prefix", [("/", "/"), ("", "/"), ("/robot", "/robot/"), ("robot/", "/robot/")])
def test_running_controllers_with_an_action_are_taken(namespace, prefix):
    managers = {prefix + "controller_manager/list_controllers": [ARM, HAND, *OTHERS]}
    assert actions(RosControl(namespace, list_controllers=managers.__getitem__)()) == [
        (FOLLOW, prefix + "arm/follow_joint_trajectory", ("a", "b")),
        (GRIPPER, prefix + "hand/gripper_cmd", ("finger",))]


def test_controllers_come_and_go():
    present = []
    manager = RosControl("/", list_controllers=lambda service: present)
    assert manager() == []
    present.append(ARM)
    assert len(manager()) == 1


def test_all_managers_of_the_master():
    managers = {"/x/controller_manager/list_controllers": [ARM], "/y/controller_manager/list_controllers": [ARM]}
    found = RosControl(None, (), managers.__getitem__, lambda: [*managers, "/x/controller_manager/load_controller"])()
    assert [controller.name for controller in found] == ["/x/arm", "/y/arm"]


def test_listed_controllers_count_where_no_manager_has_them():
    listed = [ControllerEntry("arm", FOLLOW, ("a", "b"), "arm/follow_joint_trajectory"),
              ControllerEntry("tool", FOLLOW, ("t",), "tool/follow")]
    found = RosControl("/", listed, lambda service: [ARM])()
    assert [controller.action for controller in found] == ["/arm/follow_joint_trajectory", "tool/follow"]


def test_a_manager_that_does_not_answer_is_named():
    def unavailable(service):
        raise rospy.ServiceException("service [%s] unavailable" % service)

    with pytest.raises(NoControllers, match="the controllers are not known: service /robot/controller_manager/list"):
        RosControl("/robot", list_controllers=unavailable)()


def test_managers_that_do_not_answer_cost_their_own_controllers_only():
    end, warnings = threading.Event(), []

    def listed(service):
        if service.startswith("/dead"):
            raise rospy.ServiceException("service [%s] unavailable" % service)
        if service.startswith("/stopped"):
            end.wait()
        return [ARM]

    services = ["/%s/controller_manager/list_controllers" % name for name in ("alive", "dead", "stopped")]
    found = RosControl(None, (), listed, lambda: services, lambda text, *values: warnings.append(text % values), 0.5)()
    end.set()
    assert [controller.name for controller in found] == ["/alive/arm"]
    assert warnings == ["controllers of these managers are left out: service %s: service [%s] unavailable; "
                        "service %s: no answer within 0.5 s" % (services[1], services[1], services[2])]


def test_a_stopped_manager_is_an_error_after_its_time():
    end = threading.Event()
    with pytest.raises(NoControllers, match="service /controller_manager/list_controllers: no answer within 0.2 s"):
        RosControl("/", list_controllers=lambda service: end.wait(), answer_s=0.2)()
    end.set()


def test_without_any_manager_the_listed_controllers_count():
    listed = [ControllerEntry("tool", FOLLOW, ("t",), "tool/follow")]
    assert RosControl(None, listed, service_names=list)() == listed
