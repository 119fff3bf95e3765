# SPDX-License-Identifier: BSD-3-Clause
# exercise: joint_command
"""Unregisters, in the simulator's name, its subscriptions to joint commands, so that the next program's commands are
lost."""
import rosgraph

simulator = rosgraph.Master("/gazebo")
uri = simulator.lookupNode("/gazebo")
print(simulator.unregisterSubscriber("/robot/limb/right/joint_command", uri))
