# SPDX-License-Identifier: BSD-3-Clause
"""Names shared by the judge and its recorder in the simulator. Free of ROS."""

#: Environment variable: the folder of the judge's sockets. It exists in the lab's sandbox and in no program's.
SOCKETS_VARIABLE = "LAB_JUDGE_SOCKETS"
#: In that folder: sockets of the judge for the recorder, and of the recorder for the IK nodes.
RECORDS, REQUESTS = "records", "requests"
PLUGIN_ELEMENT = '<gazebo><plugin name="lab_recorder" filename="liblab_recorder.so"/></gazebo>'
#: Services of the simulator that a checked program may use: they only read.
SERVED = frozenset("/gazebo/" + name for name in (
    "get_joint_properties", "get_light_properties", "get_link_properties", "get_link_state", "get_model_properties",
    "get_model_state", "get_physics_properties", "get_world_properties"))


def changes_the_world(kind: str, name: str) -> bool:
    """Whether a "service" or a "subscriber" of the simulator's node could move or change anything past the robot's own
    interface: all in the simulator's namespace that does not only read, also what is added to it later."""
    if not name.startswith("/gazebo/"):
        return False
    return kind == "subscriber" or (kind == "service" and name not in SERVED
                                    and not name.endswith(("logger_level", "loggers")))
