# SPDX-License-Identifier: BSD-3-Clause
"""What the judge and its recorder in the simulator agree on. Free of ROS."""

#: Environment variable: the folder of the judge's sockets. It exists in the lab's sandbox and in no program's.
SOCKETS_VARIABLE = "LAB_JUDGE_SOCKETS"
#: In it: where the recorder reaches the judge, and where the IK nodes reach the recorder.
RECORDS, REQUESTS = "records", "requests"
PLUGIN_ELEMENT = '<gazebo><plugin name="lab_recorder" filename="liblab_recorder.so"/></gazebo>'
#: Of the simulator's services, those that a program under check may use: they only read.
SERVED = frozenset("/gazebo/" + name for name in (
    "get_joint_properties", "get_light_properties", "get_link_properties", "get_link_state", "get_model_properties",
    "get_model_state", "get_physics_properties", "get_world_properties"))
#: Topics by which the simulator is told to move what no robot moves.
SILENCED = ("/gazebo/set_link_state", "/gazebo/set_model_state")
