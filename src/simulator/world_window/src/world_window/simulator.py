# SPDX-License-Identifier: BSD-3-Clause
"""The simulator's services and topics that the window uses. Nothing here waits: calls run in a thread, one after the
other."""
from __future__ import annotations

import queue
import threading
from collections.abc import Callable
from typing import TYPE_CHECKING

import rospy
from bullet_sim_msgs.msg import Drag
from bullet_sim_msgs.srv import AdvanceTicks
from gazebo_msgs.msg import ContactsState
from gazebo_msgs.srv import DeleteModel
from geometry_msgs.msg import Point
from std_srvs.srv import Empty

from world_window.overlay import ShownContact

if TYPE_CHECKING:
    from world_window.stage import Pull

# How long a service may take to appear, and an advance to begin [s, wall].
_WAIT_S = 2.0
#: Steps that one press of the button makes at most.
MAX_STEPS = 100000


class Simulator:
    """Clients of ``/gazebo``'s services."""

    def __init__(self, tell: Callable[[str], object], take_contacts: Callable[[list[ShownContact]], object]) -> None:
        """``tell(text)``: a line for the user, called in a thread of this class; ``take_contacts(contacts)``: a list of
        :class:`ShownContact`, called in a thread of rospy."""
        self._tell, self._take_contacts = tell, take_contacts
        self._drag = rospy.Publisher("/gazebo/drag", Drag, queue_size=1)
        self._pulled = None
        self._contacts = None
        self._calls = queue.SimpleQueue()
        threading.Thread(target=self._run, name="calls", daemon=True).start()

    def pause(self) -> None:
        """Stop simulation time."""
        self._call("/gazebo/pause_physics", Empty)

    def go_on(self) -> None:
        """Let simulation time run."""
        self._call("/gazebo/unpause_physics", Empty)

    def step(self, ticks: int) -> None:
        """Pause, then make ``ticks`` steps."""
        self._call("/gazebo/pause_physics", Empty)
        self._call("/gazebo/advance", AdvanceTicks, min(int(ticks), MAX_STEPS), [], _WAIT_S)

    def reset_world(self) -> None:
        """Put all models back to their start; time goes on."""
        self._call("/gazebo/reset_world", Empty)

    def reset_simulation(self) -> None:
        """Put all models back to their start, and time to zero."""
        self._call("/gazebo/reset_simulation", Empty)

    def delete(self, model: str) -> None:
        """Take a model out of the world."""
        self._call("/gazebo/delete_model", DeleteModel, model)

    def pull(self, pull: Pull | None) -> None:
        """Pull by a :class:`world_window.stage.Pull`, or, for None, let go of what is pulled."""
        if pull is None:
            if self._pulled:
                self._drag.publish(Drag(link=self._pulled, hold=False))
            self._pulled = None
            return
        self._pulled = "%s::%s" % (pull.model, pull.link)
        self._drag.publish(Drag(self._pulled, True, Point(*pull.grip), Point(*pull.target)))

    def show_contacts(self, wanted: bool) -> None:
        """Subscribe to the world's contacts, or do not any more."""
        if wanted and self._contacts is None:
            self._contacts = rospy.Subscriber("/gazebo/contacts", ContactsState, self._take, queue_size=1)
        elif not wanted and self._contacts is not None:
            self._contacts.unregister()
            self._contacts = None
            self._take_contacts([])

    def _take(self, message):
        found = []
        for state in message.states:
            for position, normal, wrench in zip(state.contact_positions, state.contact_normals, state.wrenches,
                                                strict=True):
                direction = (normal.x, normal.y, normal.z)
                force = wrench.force
                along = force.x * normal.x + force.y * normal.y + force.z * normal.z
                found.append(ShownContact((position.x, position.y, position.z), direction, along))
        self._take_contacts(found)

    def _call(self, *call):
        self._calls.put(call)

    def _run(self):
        while True:
            name, kind, *arguments = self._calls.get()
            try:
                rospy.wait_for_service(name, _WAIT_S)
                answer = rospy.ServiceProxy(name, kind)(*arguments)
            except (rospy.ROSException, rospy.ServiceException) as error:
                self._tell("%s: %s" % (name, error))
                continue
            if not getattr(answer, "success", True):
                self._tell(answer.status_message)
