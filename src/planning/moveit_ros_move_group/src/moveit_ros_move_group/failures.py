# SPDX-License-Identifier: BSD-3-Clause
"""Says why requests came to nothing: in the log, on ``~failures``, and contacts as markers."""
from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

import rospy
from geometry_msgs.msg import Point, Pose, Quaternion, Vector3
from motion_planning_msgs.msg import Failure
from moveit_msgs.msg import ContactInformation
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from moveit_ros_move_group.texts import one_line

if TYPE_CHECKING:
    from motion_planning.exact import Contact

_KINDS = {"robot": ContactInformation.ROBOT_LINK, "object": ContactInformation.WORLD_OBJECT,
          "attached": ContactInformation.ROBOT_ATTACHED}
_RADIUS_M = 0.02


def contact_message(contact: Contact, frame: str, stamp: rospy.Time | None = None) -> ContactInformation:
    """Return the ContactInformation of an exact.Contact."""
    message = ContactInformation(position=Point(*contact.point.tolist()), normal=Vector3(*contact.normal.tolist()),
                                 depth=contact.depth, contact_body_1=contact.a, contact_body_2=contact.b,
                                 body_type_1=_KINDS[contact.a_kind], body_type_2=_KINDS[contact.b_kind])
    message.header.frame_id, message.header.stamp = frame, stamp or rospy.Time()
    return message


class Failures:
    """Publishers of ``~failures`` (motion_planning_msgs/Failure) and ``~display_contacts``. frame: the contacts'."""

    def __init__(self, frame: str) -> None:
        self._frame = frame
        self._failures = rospy.Publisher("~failures", Failure, queue_size=20, latch=True)
        self._contacts = rospy.Publisher("~display_contacts", MarkerArray, queue_size=10, latch=True)

    def tell(self, request: str, code: int, text: str, group: str = "", contacts: Iterable[Contact] = (),
             joints: Mapping[str, float] | None = None) -> None:
        """Log and publish one failure. contacts: exact.Contacts; joints: {joint: value}."""
        text = one_line(text)
        rospy.logwarn("%s%s: %s", request, " of group '%s'" % group if group else "", text)
        message = Failure(request=request, group_name=group, error_code=int(code), text=text)
        message.header.stamp, message.header.frame_id = rospy.Time.now(), self._frame
        message.contacts = [contact_message(contact, self._frame, message.header.stamp) for contact in contacts]
        for name, value in (joints or {}).items():
            message.joints.append(name)
            message.values.append(value)
        self._failures.publish(message)
        if contacts:
            self.show(contacts)

    def show(self, contacts: Iterable[Contact]) -> None:
        """Draw contacts, and wipe those that were drawn before."""
        markers = [Marker(action=Marker.DELETEALL)]
        for number, contact in enumerate(contacts):
            marker = Marker(ns="%s=%s" % (contact.a, contact.b), id=number, type=Marker.SPHERE, action=Marker.ADD,
                            pose=Pose(Point(*contact.point.tolist()), Quaternion(0.0, 0.0, 0.0, 1.0)),
                            scale=Vector3(*[2.0 * _RADIUS_M] * 3), color=ColorRGBA(1.0, 0.0, 0.0, 0.8))
            marker.header.frame_id, marker.header.stamp = self._frame, rospy.Time.now()
            markers.append(marker)
        self._contacts.publish(MarkerArray(markers))
