# SPDX-License-Identifier: BSD-3-Clause
# exercise: joint_command
"""Has the master forget, in the simulator's name, where the joint commands of the next program go."""
import time

import rosgraph

simulator = rosgraph.Master("/gazebo")
uri = simulator.lookupNode("/gazebo")
print(simulator.unregisterSubscriber("/robot/limb/right/joint_command", uri))
time.sleep(1.0)
