# SPDX-License-Identifier: BSD-3-Clause
"""The servos of Baxter's arms for :class:`lab_web.steering.Steering`, in rospy."""
from baxter_model import SIDES
from steering_devices.hands import Hand


class Servos:
    """Listens to the servos while there is a page. ``hands``: {side: steering_devices.hands.Hand}."""

    def __init__(self) -> None:
        self.hands: dict[str, Hand] = {}

    def listen(self) -> None:
        """Advertise and subscribe. Waits for the master."""
        self.rest()
        self.hands = {side: Hand("/%s_servo" % side) for side in SIDES}

    def rest(self) -> None:
        """Until the next :meth:`listen`."""
        hands, self.hands = self.hands, {}
        for hand in hands.values():
            hand.close()

    @property
    def there(self) -> list[str]:
        """The sides that can be steered."""
        return [side for side, hand in self.hands.items() if hand.is_there]
