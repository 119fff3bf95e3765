#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""A controller manager on joints without physics, at 500 Hz of wall time, with optional faults.

Below the namespace /robot: the services of the controller manager, and one std_srvs/SetBool for each fault: ``lag``
(every tick covers only 2 % of the distance), ``clip`` (nothing beyond 0.5 rad), ``freeze`` (no motion at all). The
joints have a position interface, those in the parameter ``effort_joints`` an effort interface.
"""
import math
import os
import time

import rospkg
import rospy
import yaml
from std_srvs.srv import SetBool, SetBoolResponse

from controller_manager import EFFORT, POSITION, ControllerTable
from controller_manager.manager import ControllerManager
from controller_manager.services import ControllerManagerServices
from controller_manager.testing import FakeHardware
from gazebo_ros.model_plugin import PluginContext, PluginSource
from gazebo_ros.pacing import Pacer
from loop_ros.faults import Faults
from loop_ros.log import LoopLog
from loop_ros.publisher import PublisherHub
from loop_ros.request_queue import RequestQueue
from loop_ros.ros_objects import RosObjects
from loop_ros.subscriber import SubscriberHub
from urdf_model import parse_urdf

DT = 0.002
LAG, CLIP = 0.98, 0.5


def controller_table():
    share = rospkg.RosPack().get_path("ros_controllers")
    with open(os.path.join(share, "config", "controllers.yaml"), encoding="utf-8") as file:
        return ControllerTable(yaml.safe_load(file))


def offer_faults(context, hardware):
    def fault(name, values):
        def answer(request):
            setattr(hardware, name, values[request.data])
            return SetBoolResponse(True, "")

        return answer

    context.service("lag", SetBool, fault("lag", (0.0, LAG)))
    context.service("clip", SetBool, fault("clip", (math.inf, CLIP)))
    context.service("freeze", SetBool, fault("frozen", (False, True)))


def main():
    rospy.init_node("fake_joints")
    text = rospy.get_param("/robot/robot_description")
    robot = parse_urdf(text, source="robot_description")
    log = LoopLog({"info": rospy.loginfo, "warn": rospy.logwarn, "error": rospy.logerr})
    publisher_hub, subscriber_hub, requests = PublisherHub(), SubscriberHub(), RequestQueue()
    ros = RosObjects(publisher_hub, subscriber_hub, requests, log, Faults(log))
    context = PluginContext(None, None, PluginSource(robot, None, "/robot", text), log, ros, {})
    pushed = rospy.get_param("/robot/effort_joints", [])
    hardware = FakeHardware({joint.name: (EFFORT if joint.name in pushed else POSITION,)
                             for joint in robot.movable_joints()})
    manager = ControllerManager(hardware, log)
    offer_faults(context, hardware)
    table = controller_table()
    services = ControllerManagerServices(manager, lambda: table, context, robot)
    pacer = Pacer(DT)
    pacer.restart()
    start, tick = time.time(), 0
    while not rospy.is_shutdown():
        requests.run_pending()
        publisher_hub.service()
        subscriber_hub.service()
        manager.update(start + tick * DT, DT)
        hardware.step(DT)
        tick += 1
        pacer.wait()
    services.close()
    subscriber_hub.close()
    requests.close()


if __name__ == "__main__":
    main()
