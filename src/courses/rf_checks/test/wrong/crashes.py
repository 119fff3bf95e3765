# SPDX-License-Identifier: BSD-3-Clause
# exercise: wave
"""Uses a name that is not there."""
import rospy

rospy.init_node("student")
print(numpy.sin(0.5))  # noqa: F821
