# SPDX-License-Identifier: BSD-3-Clause
"""Topics without a subscriber while no page is open."""
from lab_web.resting import LINGER_S, OnDemand


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
