# SPDX-License-Identifier: BSD-3-Clause
"""The servos of Baxter's arms for :class:`lab_web.steering.SteeredMotion`, in rospy."""
import rospy
from std_msgs.msg import String

from baxter_model import SIDES
from lab_web.lab import RobotError
from steering_devices.hands import MARK_TOPIC, Hand
from steering_devices.steering import MARKS


class Servos:
    """Listens to the servos while there is a page. ``hands``: {side: steering_devices.hands.Hand}."""

    def __init__(self) -> None:
        self.hands: dict[str, Hand] = {}
        self._marks: rospy.Publisher | None = None

    def mark(self, _client: int, asked: dict) -> None:
        """The operation "mark" of a page: ``mark``, success, failure or again. Raises RobotError."""
        if asked.get("mark") not in MARKS:
            raise RobotError("a mark is one of %s" % ", ".join(MARKS))
        self.tell(asked["mark"])

    def tell(self, mark: str) -> None:
        """Tell recorders one of MARKS."""
        if self._marks is not None:
            self._marks.publish(String(mark))

    def listen(self) -> None:
        """Advertise and subscribe. Waits for the master."""
        self.rest()
        self.hands = {side: Hand("/%s_servo" % side) for side in SIDES}
        self._marks = rospy.Publisher(MARK_TOPIC, String, queue_size=10)

    def rest(self) -> None:
        """Until the next :meth:`listen`."""
        hands, self.hands = self.hands, {}
        for hand in hands.values():
            hand.close()
        if self._marks is not None:
            self._marks.unregister()
            self._marks = None

    @property
    def there(self) -> list[str]:
        """The sides that can be steered."""
        return [side for side, hand in self.hands.items() if hand.is_there]
