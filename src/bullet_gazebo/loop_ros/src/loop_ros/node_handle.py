# SPDX-License-Identifier: BSD-3-Clause
"""One owner's topics and services: made below a namespace, closed together, handed over when the owner begins anew."""


class NodeHandle:
    """Topics and services of one owner, such as a plugin.

    ``loop_ros.protocol.Topics`` says what every owner may use; the rest is for plugins. ``namespace``: absolute,
    without trailing slash ("" for the root namespace).
    """

    def __init__(self, ros, namespace=""):
        """``ros``: makes the objects from absolute names, a ``loop_ros.protocol.LoopRos``."""
        self.namespace = namespace
        self._ros = ros
        self._opened = []  # of (what it is: kind, name, type ..., the object, whether it is closed with the others)
        self._kept = []  # the same, of the owner before; see `begin_anew`
        self._subscriptions, self._noted = [], set()  # the numbers of those that got messages

    def resolve(self, name):
        """Absolute ROS name: relative names live in the handle's namespace."""
        if name.startswith("/"):
            return name
        return "%s/%s" % (self.namespace, name)

    def publisher(self, topic, msg_class, latch=False):
        """A ``loop_ros.protocol.Publisher``: ``has_listeners`` and ``publish`` are for the loop."""
        name = self.resolve(topic)
        return self._opening(("publisher", name, msg_class, latch),
                             lambda: self._ros.publisher(name, msg_class, latch=latch))

    def subscription(self, topic, msg_class, depth=1):
        """A ``loop_ros.protocol.Subscription``, which keeps the newest ``depth`` unread messages.

        ``handle(function)`` calls ``function(message)`` for each of them, oldest first, and drops and counts a message
        on which that fails. Unguarded: ``drain()`` -> list of them; ``take()`` -> the newest or None.
        """
        name = self.resolve(topic)

        def make():
            number = len(self._subscriptions)
            self._subscriptions.append(
                self._ros.subscription(name, msg_class, depth, lambda: self._noted.add(number)))
            return self._subscriptions[number]

        return self._opening(("subscription", name, msg_class, depth), make)

    def pending(self):
        """Loop thread: the subscriptions of this handle that got messages since the last call, in the order they were
        opened.

        For an owner with so many subscriptions that asking each of them at every tick takes time.
        """
        if not self._noted:
            return ()
        numbers = sorted(self._noted)
        # Before they are read: what comes in from here on is told again.
        self._noted.difference_update(numbers)
        return [self._subscriptions[number] for number in numbers]

    def service(self, name, srv_class, handler):
        """Advertise a service; ``handler(request)`` runs in the loop thread between two ticks."""
        return self._serving(self._ros.service, self.resolve(name), srv_class, handler)

    def service_in_thread(self, name, srv_class, handler):
        """Advertise a service that may take its time; ``handler(request)`` runs in a thread of its own.

        It reaches what belongs to the loop through :meth:`call_in_loop` only.
        """
        return self._serving(self._ros.service_in_thread, self.resolve(name), srv_class, handler)

    def call_in_loop(self, function, *arguments):
        """Any thread but the loop's: have ``function(*arguments)`` called between two ticks; returns or raises what it
        does. Raises ``rospy.ServiceException`` when the loop ends before."""
        return self._ros.call_in_loop(function, *arguments)

    def flush(self):
        """Any thread but the loop's: wait until the topics and services opened so far are known to the ROS master."""
        self._ros.flush()

    def branch(self):
        """A handle in the same namespace, for a part of the owner that opens and closes on its own."""
        return NodeHandle(self._ros, self.namespace)

    def served(self):
        """Absolute names of the services that the node serves now, this owner's and all others: a list."""
        return self._ros.served()

    def withdraw(self, name):
        """Loop thread: for good, no longer serve the service ``name`` nor listen to the topic of that name, for all
        owners; for an owner that guards what others may do.

        Returns the service's handler, for the caller's own requests; None where there is no such service.
        """
        return self._ros.withdraw(self.resolve(name))

    def survived(self, place, error):
        """Count an error that the owner has dealt with: a line in the log now and then, a figure in /diagnostics.

        ``place``: the topic or service, or in words what was being done.
        """
        self._ros.faults.note(place, error)

    def begin_anew(self):
        """From here to :meth:`end_anew`, what is opened again is what was open already."""
        self._kept, self._opened = [*self._kept, *self._opened], []

    def end_anew(self):
        """Close what was open before :meth:`begin_anew` and has not been opened again."""
        kept, self._kept = self._kept, []
        _close_all(kept)

    def close(self):
        """Close every topic and service that was opened through this handle."""
        opened, self._opened, self._kept = [*self._kept, *self._opened], [], []
        _close_all(opened)

    def _opening(self, what, make, closes=True):
        """The object that was opened as ``what`` before, or a new one; ``closes``: whether :meth:`close` ends it."""
        for entry in self._kept:
            if entry[0] == what:
                self._kept.remove(entry)
                break
        else:
            entry = what, make(), closes
        self._opened.append(entry)
        return entry[1]

    def _serving(self, advertise, name, srv_class, handler):
        def make():
            answering = _Answering(handler)
            answering.service = advertise(name, srv_class, lambda request: answering.handler(request))
            return answering

        answering = self._opening(("service", advertise.__name__, name, srv_class), make)
        answering.handler = handler
        return answering


class _Answering:
    """A service whose handler can be replaced."""

    def __init__(self, handler):
        self.handler = handler

    def close(self):
        self.service.close()


def _close_all(opened):
    for _, thing, closes in reversed(opened):
        if closes:
            thing.close()
