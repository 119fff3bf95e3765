# SPDX-License-Identifier: BSD-3-Clause
"""The loop with a world that only counts."""
import threading
import time

import pytest

from gazebo_ros.mailbox import RequestBoard
from gazebo_ros.model_plugin import ModelPlugin
from gazebo_ros.simulation import AdvanceRefused, HostedPlugin, Simulation
from lab_testing.waiting import wait_until


class FakeWorld:
    time_step_s = 0.002

    def __init__(self):
        self.steps = 0
        self.resets = 0

    def step(self):
        self.steps += 1

    def reset_models(self):
        self.resets += 1

    def reset_time(self):
        pass


class FakeLog:
    def __init__(self):
        self.errors = []

    def error(self, text):
        self.errors.append(text)


class FakeContext:
    closed = False

    def close(self):
        self.closed = True


class Recorder(ModelPlugin):
    """Writes down what is called."""

    def __init__(self, fails_in=None):
        super().__init__(None)
        self.calls = []
        self._fails_in = fails_in

    def _note(self, *call):
        self.calls.append(call)
        if call[0] == self._fails_in:
            raise RuntimeError("broken on purpose")

    def update(self, time_s, dt):
        self._note("update", time_s, dt)

    def publish(self, time_s):
        self._note("publish", time_s)

    def joints_set(self):
        self._note("joints_set")

    def reset(self):
        self._note("reset")

    def close(self):
        self._note("close")


@pytest.fixture
def log():
    return FakeLog()


@pytest.fixture
def counts():
    return {"/command": 0}


@pytest.fixture
def simulation(log, counts):
    return Simulation(FakeWorld(), RequestBoard(), log, paused=True, deliveries=lambda: dict(counts))


@pytest.fixture
def running(simulation):
    """The loop in a thread of its own."""
    ending = threading.Event()
    thread = threading.Thread(target=simulation.run, args=(ending.is_set,))
    thread.start()
    yield simulation
    ending.set()
    thread.join(5.0)
    assert not thread.is_alive()


def host(simulation, **options):
    hosted = HostedPlugin(Recorder(**options), FakeContext(), "model", "libtest.so")
    simulation.host(hosted)
    return hosted


def advance(simulation, ticks, topics=(), timeout_s=5.0):
    return simulation.board.call(simulation.start_advance, ticks, topics, timeout_s)


def test_a_tick_is_update_step_publish_at_the_right_times(simulation):
    calls = host(simulation).plugin.calls
    simulation.do_tick()
    simulation.do_tick()
    assert calls == [("update", 0.0, 0.002), ("publish", 0.002), ("update", 0.002, 0.002), ("publish", 0.004)]
    assert simulation.world.steps == 2


def test_time_is_exact_after_days(simulation):
    simulation.tick = 3 * 24 * 3600 * 500 + 1
    assert simulation.time_ns == 259200 * 10**9 + 2_000_000


@pytest.mark.parametrize("where", ["update", "publish"])
def test_a_failing_plugin_is_reported_once_and_left_out(simulation, log, where):
    bad, good = host(simulation, fails_in=where), host(simulation)
    for _ in range(3):
        simulation.do_tick()
    assert len(log.errors) == 1
    assert "libtest.so" in log.errors[0] and where in log.errors[0] and "broken on purpose" in log.errors[0]
    assert [call[0] for call in bad.plugin.calls].count(where) == 1
    assert bad.context.closed and bad.plugin.calls[-1] == ("close",)
    assert len(good.plugin.calls) == 6 and simulation.world.steps == 3


def test_reset_keeps_the_time_unless_asked(simulation):
    plugin = host(simulation).plugin
    jumped = []
    simulation.on_time_reset = lambda: jumped.append(simulation.tick)
    simulation.do_tick()
    simulation.reset(time_too=False)
    assert (simulation.tick, simulation.world.resets, jumped) == (1, 1, [])
    simulation.reset(time_too=True)
    assert (simulation.tick, simulation.world.resets, jumped) == (0, 2, [0])
    assert plugin.calls.count(("reset",)) == 2


def test_unhosting_a_model_closes_its_plugins_only(simulation):
    first, second = host(simulation), host(simulation)
    second.model_name = "other"
    simulation.unhost("other")
    simulation.do_tick()
    assert second.plugin.calls == [("close",)] and second.context.closed
    assert first.plugin.calls and not first.context.closed


def test_a_paused_world_stands_still_and_answers(running):
    assert running.board.call(lambda: running.tick) == 0
    assert running.board.call(lambda: running.tick) == 0


def test_a_world_runs_in_real_time(running):
    running.paused = False
    start, start_tick = time.monotonic(), running.tick
    wait_until(lambda: running.tick - start_tick >= 250, "half a second of simulation")
    # A busy machine makes it later, nothing makes it earlier.
    assert time.monotonic() - start > 0.45


def test_an_advance_makes_exactly_so_many_ticks(running):
    assert advance(running, 7).result(5.0) == (7, 14_000_000)
    assert advance(running, 0).result(5.0) == (7, 14_000_000)
    assert advance(running, 1000).result(5.0) == (1007, 2_014_000_000)
    assert running.world.steps == 1007


def test_an_advance_waits_for_its_topics_each_time(running, counts):
    future = advance(running, 2, ["/command"])
    # The loop has taken the request up and gone round since, and waits.
    assert running.board.call(lambda: running.tick) == 0
    assert running.board.call(lambda: running.tick) == 0
    assert not future.done()
    counts["/command"] += 1
    assert future.result(5.0)[0] == 2
    # What arrived before does not count again.
    second = advance(running, 2, ["/command"], timeout_s=0.1)
    with pytest.raises(AdvanceRefused, match="no message within 0.1 s on /command"):
        second.result(5.0)
    assert running.tick == 2


def test_an_advance_in_a_running_world_is_refused(running):
    running.paused = False
    with pytest.raises(AdvanceRefused, match="pause_physics"):
        advance(running, 1)


def test_two_advances_at_a_time_are_refused(running, counts):
    first = advance(running, 1, ["/command"])
    with pytest.raises(AdvanceRefused, match="under way"):
        advance(running, 1)
    counts["/command"] += 1
    assert first.result(5.0)[0] == 1


def test_a_topic_that_nobody_listens_to_is_named(running):
    with pytest.raises(AdvanceRefused, match="/nonsense.*/command"):
        advance(running, 1, ["/nonsense"])


@pytest.mark.parametrize("timeout_s", [-1.0, float("nan")])
def test_an_impossible_deadline_is_refused(running, timeout_s):
    with pytest.raises(AdvanceRefused, match="timeout_s"):
        advance(running, 1, [], timeout_s)


def test_unpausing_ends_a_waiting_advance(running):
    future = advance(running, 5, ["/command"])
    running.paused = False
    with pytest.raises(AdvanceRefused, match="unpaused with 5 ticks left"):
        future.result(5.0)
