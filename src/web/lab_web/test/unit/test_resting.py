# SPDX-License-Identifier: BSD-3-Clause
"""Topics that rest while no page is open: no subscriber, or the newest message counts and others get every one."""
from types import SimpleNamespace

from lab_web import resting
from lab_web.resting import LINGER_S, OnDemand, Rest, rest

PERIOD_S, REST_S = 0.01, 0.05


class Reader:
    """A thread that reads messages which come each PERIOD_S, as rospy does: all that wait, one callback each."""

    def __init__(self, needed):
        self.now, self.reads, self.newest_s = 0.0, 0, 0.0
        self._rest = Rest(lambda: needed, REST_S, lambda: self.now, self._sleep)

    def _sleep(self, seconds):
        self.now += seconds

    def run(self, seconds):
        """Returns the greatest age of a message when its callback has returned [s]."""
        due, oldest = PERIOD_S, 0.0
        while self.now < seconds:
            self.now = max(self.now, due)
            self.reads += 1
            while due <= self.now:
                self._rest(None)
                oldest = max(oldest, self.now - due)
                due += PERIOD_S
        return oldest


def test_without_a_page_several_messages_are_read_at_a_time_and_none_becomes_old():
    reader = Reader(needed=False)
    assert reader.run(60.0) <= REST_S + PERIOD_S
    assert reader.reads < 0.4 * 60.0 / PERIOD_S


def test_with_a_page_each_message_is_read_as_it_comes():
    reader = Reader(needed=True)
    assert reader.run(60.0) == 0.0
    assert reader.reads >= 60.0 / PERIOD_S - 1


def test_a_topic_does_not_rest_where_another_client_has_subscribed_to_it(monkeypatch):
    made = {}

    def subscriber(topic, _kind, callback, queue_size):
        made[topic] = SimpleNamespace(callbacks=["the robot's", callback], queue_size=queue_size)
        return SimpleNamespace(impl=made[topic])

    slept = []
    monkeypatch.setattr(resting.rospy, "Subscriber", subscriber)
    monkeypatch.setattr(Rest.__init__, "__defaults__", (iter(range(1000)).__next__, slept.append))
    rest({"/robot/state": None}, lambda: False, REST_S)
    state = made["/robot/state"]
    state.callbacks[1](None)
    assert slept == [REST_S] and state.queue_size == 1
    state.callbacks.append("another client's")
    state.callbacks[1](None)
    assert slept == [REST_S]
    state.callbacks.pop()
    state.callbacks[1](None)
    assert slept == [REST_S] * 2


def test_topics_are_subscribed_to_while_a_page_is_there_and_a_little_longer():
    calls, now, needed = [], [100.0], [False]
    demand = OnDemand(lambda: calls.append("listen"), lambda: calls.append("rest"), lambda: needed[0], lambda: now[0])

    def look(is_needed, after_s):
        now[0] += after_s
        needed[0] = is_needed
        demand.look()
        return calls

    assert look(False, 0.0) == look(False, 2.0 * LINGER_S) == []
    assert look(True, 0.0) == look(True, 1000.0) == look(False, 0.9 * LINGER_S) == ["listen"]
    assert look(True, 0.05) == look(False, 0.9 * LINGER_S) == ["listen"]
    assert look(False, 0.2 * LINGER_S) == look(False, LINGER_S) == ["listen", "rest"]
    assert look(True, 0.0) == ["listen", "rest", "listen"]
