# SPDX-License-Identifier: BSD-3-Clause
"""Topics that nobody needs: the newest message counts; who needs them gets every one, at once."""
import threading

from rospy_limits.rest import Demand, Rest

PERIOD_S, REST_S, LINGER_S = 0.01, 0.05, 5.0


class Reader:
    """A thread that reads messages which come each PERIOD_S, as rospy does: all that wait, one callback each."""

    def __init__(self, needed):
        self.now, self.reads = 0.0, 0
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


def test_several_messages_are_read_at_a_time_and_none_becomes_old():
    reader = Reader(needed=False)
    assert reader.run(60.0) <= REST_S + PERIOD_S
    assert reader.reads < 0.4 * 60.0 / PERIOD_S


def test_where_it_is_needed_each_message_is_read_as_it_comes():
    reader = Reader(needed=True)
    assert reader.run(60.0) == 0.0
    assert reader.reads >= 60.0 / PERIOD_S - 1


def test_a_topic_is_needed_from_the_first_request_until_some_time_after_the_last():
    now = [100.0]
    demand = Demand(LINGER_S, lambda: now[0])
    assert not demand.is_needed()
    assert demand.need()
    for _ in range(3):
        now[0] += 0.9 * LINGER_S
        assert demand.is_needed()
        assert not demand.need()
    now[0] += 1.1 * LINGER_S
    assert not demand.is_needed()
    assert demand.need()


def test_a_sleeping_thread_wakes_when_it_is_needed_and_does_not_sleep_again():
    demand, slept = Demand(1000.0), []

    def read():
        for _ in range(2):
            demand.sleep(1000.0)
            slept.append(True)

    thread = threading.Thread(target=read, daemon=True)
    thread.start()
    assert demand.need()
    thread.join(60.0)
    assert len(slept) == 2
