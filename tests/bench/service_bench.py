# SPDX-License-Identifier: BSD-3-Clause
"""Round trips of Baxter's IK service compared with those of an empty rospy service, both by non-persistent calls."""
import os
import time

import numpy as np
from labs import Lab

CALLS = 200


def measure(report, quick, number):
    with Lab(("baxter_sim_kinematics", "baxter_sim_kinematics.launch"),
             "/ExternalTools/left/PositionKinematicsNode/IKService", load_robot_description="true") as lab:
        lab.part("empty")
        lab.part("posture")
        # rospy reads the master's address when it is first used, so import it only now.
        os.environ.update(ROS_MASTER_URI=lab.environment["ROS_MASTER_URI"], ROS_HOSTNAME="localhost")
        times = calls(CALLS // 10 if quick else CALLS)
    for name, found in times.items():
        if name != "empty":
            report.add("IK round trip, %s: mean" % name, found.mean(), "ms", ("empty service", times["empty"].mean()),
                       samples=len(found), **({"ratio_most": 1.5} if name == "one pose" else {}))
            report.add("IK round trip, %s: p99" % name, np.percentile(found, 99), "ms",
                       ("empty service", np.percentile(times["empty"], 99)), samples=len(found))
    report.sample("round trip", "ms", **times)


def calls(count):
    """Return {name: times [ms]}; the calls take turns."""
    import rospy
    from baxter_core_msgs.srv import SolvePositionIK, SolvePositionIKRequest
    from geometry_msgs.msg import Point, PoseStamped, Quaternion
    from std_srvs.srv import Empty

    rospy.init_node("bench_services", anonymous=True, disable_rostime=True, disable_signals=True)
    pose = PoseStamped()
    pose.header.frame_id = "base"
    pose.pose.position, pose.pose.orientation = Point(0.644, 0.0, 0.066), Quaternion(-0.381, 0.923, -0.015, 0.052)
    name = "/ExternalTools/left/PositionKinematicsNode/IKService"
    asked = {
        "empty": lambda: rospy.ServiceProxy("/bench_empty", Empty)(),
        "one pose": lambda: rospy.ServiceProxy(name, SolvePositionIK)(SolvePositionIKRequest(pose_stamp=[pose])),
        "ten poses": lambda: rospy.ServiceProxy(name, SolvePositionIK)(SolvePositionIKRequest(pose_stamp=[pose] * 10)),
    }
    times = {what: [] for what in asked}
    for turn in range(count + 5):
        for what, ask in asked.items():
            begin = time.perf_counter()
            ask()
            if turn >= 5:  # the first ones open files and fill caches
                times[what].append(1e3 * (time.perf_counter() - begin))
    rospy.signal_shutdown("done")
    return {what: np.array(found) for what, found in times.items()}
