# SPDX-License-Identifier: BSD-3-Clause
"""Topics and services of the loop, registered with the ROS master by a thread of their own.

A registration is a round trip to the master (1 to 2 ms); a robot brings about a hundred. The objects are handed out at
once and come alive when their turn comes, so the loop never waits; :meth:`RosObjects.flush` waits for all of them.
"""
import queue
import threading
import weakref

import rospy

from loop_ros.faults import SURVIVED, described
from loop_ros.mailbox import LoopEnded, Mailbox, Queue
from loop_ros.publisher import LoopPublisher
from loop_ros.subscriber import Inlet
from rospy_limits.messages import largest_message_bytes


class RosObjects:
    """Makes publishers, mailboxes, queues and services for the loop."""

    def __init__(self, hub, inlets, board, log, faults):
        """``hub``: :class:`PublisherHub`; ``inlets``: :class:`InletHub`; ``board``: :class:`RequestBoard`; ``log``:
        :class:`LoopLog`; ``faults``: :class:`Faults`, which are counted here by topic and service."""
        self._hub = hub
        self._inlets = inlets
        self._board = board
        self._log = log
        #: For who finds more of them.
        self.faults = faults
        self._jobs = queue.SimpleQueue()
        self._inboxes = {}
        self._delivered_before = {}
        self._services = {}
        threading.Thread(target=self._work, name="ros_registrar", daemon=True).start()

    def publisher(self, topic, msg_class, latch=False, greet=False):
        """A :class:`LoopPublisher` for the absolute name ``topic``."""
        registered = []

        def register():
            if publisher.is_closed:
                return
            registration = rospy.Publisher(topic, msg_class, latch=latch, queue_size=1)
            registered.append(registration)
            # rospy would put a queue and a thread between us and each connection.
            registration.impl.set_queue_size(None)
            registration.impl.add_subscriber_listener(_Attention(self._hub, publisher))
            publisher.attach(registration.impl)

        def unregister():
            for registration in registered:
                registration.unregister()

        publisher = LoopPublisher(self._hub, topic, msg_class, latch=latch, greet=greet,
                                  release=lambda: self._jobs.put(unregister))
        self._jobs.put(register)
        return publisher

    def mailbox(self, topic, msg_class):
        """A :class:`Mailbox` that messages on ``topic`` fall into."""
        return self._subscribe(Mailbox(self._counting(topic)), topic, msg_class)

    def queue(self, topic, msg_class, depth, notice=lambda: None):
        """A :class:`Queue` that messages on ``topic`` fall into; ``notice()`` is called after each, in any thread."""
        return self._subscribe(Queue(depth, notice, self._counting(topic)), topic, msg_class)

    def service(self, name, srv_class, handler):
        """Advertise ``name``; ``handler(request)`` runs in the loop thread."""
        return self._serve(name, srv_class, lambda request: self.call_in_loop(handler, request), handler)

    def service_in_thread(self, name, srv_class, handler):
        """Advertise ``name``; ``handler(request)`` runs in rospy's thread for the request."""
        return self._serve(name, srv_class, handler, handler)

    def served(self):
        """Names of the services that are advertised now: a list."""
        return list(self._services)

    def withdraw(self, name):
        """Loop thread: no longer serve the service ``name``, nor listen to the topic of that name, whoever opened it.

        Returns the service's handler, which only the caller reaches from then on; None where there is no such service.
        """
        for inbox in self._inboxes.get(name, ()):
            inbox.close()
        service = self._services.get(name)
        if service is None:
            return None
        service.close()
        return service.handler

    def call_in_loop(self, function, *arguments):
        """Any thread but the loop's: have ``function(*arguments)`` called between two ticks and wait for it.

        Raises ``rospy.ServiceException``, the right end for a service request, when the loop ends before.
        """
        try:
            return self._board.call(function, *arguments)
        except LoopEnded as error:
            raise rospy.ServiceException(str(error)) from None

    def deliveries(self):
        """How many messages the loop's subscriptions have received: {topic: count}. Those that have been closed count
        on, so that it never becomes less."""
        return {topic: self._delivered_before.get(topic, 0) + sum(inbox.delivered for inbox in inboxes)
                for topic, inboxes in list(self._inboxes.items())}

    def flush(self, timeout_s=10.0):
        """Any thread but the loop's: wait until all registrations asked for so far are done."""
        done = threading.Event()
        self._jobs.put(done.set)
        return done.wait(timeout_s)

    def later(self, function):
        """Have ``function()`` called in the registration thread."""
        self._jobs.put(function)

    def _serve(self, name, srv_class, answer_in_thread, handler):
        service = self._services[name] = _Service(self, name, handler)

        def register():
            service.registration = rospy.Service(name, srv_class, answering(name, answer_in_thread, self.faults))

        self._jobs.put(register)
        return service

    def _subscribe(self, box, topic, msg_class):
        """Have rospy put what comes in on ``topic`` into a :class:`Mailbox` or :class:`Queue`, until that is closed."""
        self._inboxes[topic] = [*self._inboxes.get(topic, ()), box]
        registered = []

        def register():
            registration = rospy.Subscriber(topic, msg_class, box.put, tcp_nodelay=True)
            registered.append(registration)
            # A connection that rospy made before this line is read by rospy, in a thread of its own.
            _read_in_loop(registration.impl, self._inlets, self._log, self.faults)

        def unregister():
            for registration in registered:
                registration.unregister()

        def end():
            self._forget(topic, box)
            self._jobs.put(unregister)

        box.on_close = end
        self._jobs.put(register)
        return box

    def _counting(self, topic):
        return lambda error: self.faults.note(topic, error, "the message is dropped")

    def _forget(self, topic, box):
        self._delivered_before[topic] = self._delivered_before.get(topic, 0) + box.delivered
        left = [other for other in self._inboxes.get(topic, ()) if other is not box]
        if left:
            self._inboxes[topic] = left
        else:
            self._inboxes.pop(topic, None)

    def _work(self):
        while True:
            job = self._jobs.get()
            try:
                job()
            except Exception as error:  # noqa: BLE001  (one bad name or a lost master must not end the thread)
                if not rospy.is_shutdown():
                    self._log.error("cannot register with the ROS master: %s" % error)


def answering(name, handler, faults):
    """``handler`` as rospy is to call it: what it raises is counted and an error to the client, whatever it is."""

    def answer(request):
        try:
            return handler(request)
        except rospy.ServiceException:
            raise
        except SURVIVED as error:
            faults.note(name, error, "the request is answered with an error")
            raise rospy.ServiceException("%s failed: %s" % (name, described(error))) from error

    return answer


def _read_in_loop(impl, inlets, log, faults):
    """Have the loop read the connections of rospy's subscription ``impl``, as soon as they are made."""
    add = impl.add_connection

    def add_connection(connection):
        # Held weakly: a connection that rospy drops while it is being made leaves its socket to be closed with the last
        # reference, and the publisher serves nobody else before that.
        held = weakref.ref(connection)
        connection.receive_loop = lambda _: _receive(held(), impl, inlets, log, faults)
        return add(connection)

    impl.add_connection = add_connection


def _receive(connection, impl, inlets, log, faults):
    """What rospy's thread for a connection does, once that stands: wait for its end."""

    def deliver(data):
        connection.stat_bytes += len(data)
        connection.stat_num_msg += 1
        try:
            message = impl.data_class().deserialize(data)
            message._connection_header = connection.header
            if connection.is_latched:
                connection.latch = message
            impl.receive_callback([message], connection)
        except Exception as error:  # noqa: BLE001  (anything may be sent; the world goes on)
            if not impl.closed:
                faults.note(impl.resolved_name, error,
                            "a message from %s cannot be read and is dropped" % connection.callerid_pub)

    try:
        # With the end of its header a publisher may have sent its first message, the one that it latches.
        inlet = Inlet(connection.socket, deliver, largest_message_bytes(), held=connection.read_buff.getvalue())
    except (AttributeError, OSError):  # it has been closed already
        connection.close()
        return
    inlets.add(inlet)
    inlet.ended.wait()
    if inlet.fault:
        log.error("%s: the connection to %s is closed: %s"
                  % (impl.resolved_name, connection.callerid_pub, inlet.fault))
    connection.close()


class _Attention(rospy.SubscribeListener):
    """Tells the loop that a publisher has a new listener."""

    def __init__(self, hub, publisher):
        self._hub = hub
        self._publisher = publisher

    def peer_subscribe(self, topic_name, topic_publish, peer_publish):
        self._hub.attention.append(self._publisher)


class _Service:
    """An advertised service. ``handler``: what answers a request."""

    def __init__(self, objects, name, handler):
        self.registration = None
        self.handler = handler
        self._objects, self._name = objects, name
        self._is_closed = False

    def close(self):
        if self._is_closed:
            return
        self._is_closed = True
        if self._objects._services.get(self._name) is self:
            del self._objects._services[self._name]
        self._objects.later(lambda: self.registration.shutdown("closed"))
