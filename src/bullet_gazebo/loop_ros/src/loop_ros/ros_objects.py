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
        return self._subscribe(_Inbox(Mailbox(self._counting(topic)), topic, self), msg_class)

    def queue(self, topic, msg_class, depth, notice=lambda: None):
        """A :class:`Queue` that messages on ``topic`` fall into; ``notice()`` is called after each, in any thread."""
        return self._subscribe(_Inbox(Queue(depth, notice, self._counting(topic)), topic, self), msg_class)

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

    def _subscribe(self, inbox, msg_class):
        self._inboxes[inbox.topic] = [*self._inboxes.get(inbox.topic, ()), inbox]

        def register():
            inbox.registration = rospy.Subscriber(inbox.topic, msg_class, inbox.put, tcp_nodelay=True)
            # A connection that rospy made before this line is read by rospy, in a thread of its own.
            _read_in_loop(inbox.registration.impl, self._inlets, self._log, self.faults)

        self._jobs.put(register)
        return inbox

    def _counting(self, topic):
        return lambda error: self.faults.note(topic, error, "the message is dropped")

    def _forget(self, inbox):
        self._delivered_before[inbox.topic] = self._delivered_before.get(inbox.topic, 0) + inbox.delivered
        left = [other for other in self._inboxes.get(inbox.topic, ()) if other is not inbox]
        if left:
            self._inboxes[inbox.topic] = left
        else:
            self._inboxes.pop(inbox.topic, None)

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


class _Inbox:
    """A mailbox or a queue together with its subscription."""

    def __init__(self, box, topic, objects):
        self.topic = topic
        self.registration = None
        self.put = box.put
        self.handle, self.guarded = box.handle, box.guarded
        self._box = box
        self._objects = objects
        if isinstance(box, Mailbox):
            self.take = box.take
        else:
            self.drain = box.drain

    @property
    def delivered(self):
        return self._box.delivered

    @property
    def lost(self):
        return self._box.lost

    def close(self):
        self._objects._forget(self)
        self._objects.later(lambda: self.registration.unregister())
        self._box.close()


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
