# SPDX-License-Identifier: BSD-3-Clause
"""Topics that rest while no page is open: no subscriber, or the newest message counts."""
from types import SimpleNamespace

from lab_web import resting
from lab_web.resting import LINGER_S, OnDemand, rest
from rospy_limits.rest import Rest

REST_S = 0.05


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
