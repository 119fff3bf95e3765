#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Minimal cameras, inverse kinematics, procedures and updates, for tests of their clients, with knobs.

Knobs are private parameters, read at every request; see KNOBS.
"""
import errno
import threading
import time

import rospy
from baxter_core_msgs.msg import RobustControllerStatus
from baxter_core_msgs.srv import (
    CloseCamera,
    ListCameras,
    OpenCamera,
    SolvePositionIK,
    SolvePositionIKResponse,
)
from baxter_maintenance_msgs.msg import CalibrateArmEnable, TareEnable, UpdateSource, UpdateSources, UpdateStatus
from sensor_msgs.msg import Image, JointState
from std_msgs.msg import Empty, String
from std_srvs.srv import Empty as EmptyService
from std_srvs.srv import EmptyResponse

from baxter_sim_hardware.sensing.cameras import CameraRefused, CaptureSettings, Rack
from lab_testing.waiting import beats

RATE_HZ = 20.0
SIDES = ("left", "right")
JOINTS = ("s0", "s1", "e0", "e1", "w0", "w1", "w2")
REACH_M = 1.0
KNOBS = {
    "cameras": ["left_hand_camera", "head_camera"],  # with power
    "refuse_cameras": False,       # opening one fails
    "slow_ik": 0.0,                # [s] before the answer
    "procedure_runs_s": 0.3,       # time from a procedure's begin to its end; negative: it never begins
    "procedure_fails": False,
    "update_steps": 5,             # reports of progress until the update is done
}


def knob(name):
    return rospy.get_param("~" + name, KNOBS[name])


class FakeProcedure:
    """Tare or CalibrateArm of one arm."""

    def __init__(self, side, name, kind):
        prefix = "/robustcontroller/%s/%s/" % (side, name)
        self._lock = threading.Lock()
        self._status = RobustControllerStatus()
        self._began_s = None
        self._publisher = rospy.Publisher(prefix + "status", RobustControllerStatus, queue_size=1)
        self._subscriber = rospy.Subscriber(prefix + "enable", kind, self._on_enable)

    def step(self):
        with self._lock:
            if self._began_s is not None and time.monotonic() - self._began_s > knob("procedure_runs_s"):
                fails = knob("procedure_fails")
                self._status.complete = self._status.COMPLETE_W_FAILURE if fails else self._status.COMPLETE_W_SUCCESS
                self._status.errorCodes = ["ARM_MOVED"] if fails else []
            self._publisher.publish(self._status)

    def _on_enable(self, message):
        with self._lock:
            if message.isEnabled and message.uid == "sdk" and not self._status.isEnabled:
                if knob("procedure_runs_s") >= 0.0:
                    self._began_s = time.monotonic()
                    self._status = RobustControllerStatus(isEnabled=True, controlUid="sdk")
            elif not message.isEnabled:
                self._began_s = None
                self._status.isEnabled = False


class FakeUpdater:
    """Two updates on a stick."""

    SOURCES = (("sda", "one.zip", "1.0.0", "uuid-one"), ("sda", "two.zip", "0.7.0", "uuid-two"))

    def __init__(self):
        self._steps_left = None
        self._status = UpdateStatus(status=UpdateStatus.STS_IDLE)
        self._sources = rospy.Publisher("/usb/update_sources", UpdateSources, queue_size=1)
        self._statuses = rospy.Publisher("/updater/status", UpdateStatus, queue_size=1)
        self._subscribers = [rospy.Subscriber("/updater/start", String, self._on_start),
                             rospy.Subscriber("/updater/stop", Empty, self._on_stop)]

    def step(self):
        if self._steps_left is not None:
            self._steps_left -= 1
            done = self._steps_left <= 0
            steps = knob("update_steps")
            self._status = UpdateStatus(
                status=UpdateStatus.STS_LOAD_KEXEC if done else UpdateStatus.STS_VERIFY_UPDATE,
                progress=100.0 * (steps - self._steps_left) / steps, long_description="fake update")
            if done:
                self._steps_left = None
        self._sources.publish(UpdateSources(uuid="stick", sources=[UpdateSource(*source) for source in self.SOURCES]))
        self._statuses.publish(self._status)

    def _on_start(self, message):
        if message.data in (source[3] for source in self.SOURCES):
            self._steps_left = knob("update_steps")
        else:
            self._status = UpdateStatus(status=UpdateStatus.STS_INVALID, long_description="no such update")

    def _on_stop(self, _message):
        self._steps_left = None
        self._status = UpdateStatus(status=UpdateStatus.STS_CANCELLED)


class FakeServices:
    def __init__(self):
        self._steppers = [FakeProcedure(side, name, kind) for side in SIDES
                          for name, kind in (("Tare", TareEnable), ("CalibrateArm", CalibrateArmEnable))]
        self._steppers.append(FakeUpdater())
        # The simulated robot's own code checks camera settings.
        self._rack, self._images = Rack(most_open=3), {}
        for name in KNOBS["cameras"]:
            self._rack.add(name, None)
        self._opened = rospy.Publisher("~opened", OpenCamera._request_class, queue_size=10, latch=True)
        self._services = [
            rospy.Service("/cameras/list", ListCameras, lambda request: [knob("cameras")]),
            rospy.Service("/cameras/open", OpenCamera, self._on_open),
            rospy.Service("/cameras/close", CloseCamera, self._on_close),
            rospy.Service("/cameras/reset", EmptyService, self._on_reset),
        ]
        self._services += [
            rospy.Service("/ExternalTools/%s/PositionKinematicsNode/IKService" % side, SolvePositionIK,
                          lambda request, side=side: self._on_ik(side, request)) for side in SIDES]

    def run(self):
        for _ in beats(RATE_HZ, rospy.is_shutdown):
            for stepper in self._steppers:
                stepper.step()

    def _on_open(self, request):
        if request.name not in knob("cameras") or knob("refuse_cameras"):
            return errno.ENODEV
        asked = request.settings
        try:
            self._rack.open_camera(request.name, CaptureSettings(
                asked.width, asked.height, asked.fps, {control.id: control.value for control in asked.controls}))
        except CameraRefused as refusal:
            return refusal.code
        self._opened.publish(request)
        if request.name not in self._images:
            self._images[request.name] = rospy.Publisher("/cameras/%s/image" % request.name, Image, queue_size=1)
        return 0

    def _on_close(self, request):
        try:
            self._rack.close_camera(request.name)
        except CameraRefused as refusal:
            return refusal.code
        self._images.pop(request.name).unregister()
        return 0

    def _on_reset(self, _request):
        return EmptyResponse()

    def _on_ik(self, side, request):
        """Angles that encode the request: the first is the pose's x, the rest are the seed's; far poses have no
        solution."""
        time.sleep(knob("slow_ik"))
        answer = SolvePositionIKResponse()
        for index, stamped in enumerate(request.pose_stamp):
            near = stamped.pose.position.x < REACH_M and stamped.header.frame_id == "base"
            names = ["%s_%s" % (side, joint) for joint in JOINTS]
            seed = dict.fromkeys(names, 0.0)
            if request.seed_angles:
                seed.update(zip(request.seed_angles[index].name, request.seed_angles[index].position, strict=True))
            seed[names[0]] = stamped.pose.position.x
            answer.joints.append(JointState(name=names, position=[seed[name] for name in names])
                                 if near else JointState())
            answer.isValid.append(near)
            answer.result_type += bytes([1 if near else 0])
        return answer


def main():
    rospy.init_node("fake_services", disable_rostime=True)
    FakeServices().run()


if __name__ == "__main__":
    main()
