# SPDX-License-Identifier: BSD-3-Clause
"""Counts of what this process's ports have met: the amendments of all kinds of ports count here."""
import rospy

from rospy_fixes.ports.event_log import EventLog
from rospy_fixes.ports.threads import ThreadFaults

EVENTS = EventLog(rospy.logwarn)
FAULTS = ThreadFaults(EVENTS)
