# SPDX-License-Identifier: BSD-3-Clause
"""The loop with a world that only counts."""
import threading
import time

import pytest

from gazebo_ros.model_plugin import ModelPlugin
from gazebo_ros.pacing import LATE_S
from gazebo_ros.simulation import AdvanceRefused, HostedPlugin, Simulation
from lab_testing.waiting import wait_until
from loop_ros.faults import Faults
from loop_ros.request_queue import RequestQueue
from loop_ros.testing import FakeLog


class FakeWorld:
    time_step_s = 0.002

    def __init__(self):
        self.steps = 0
        self.resets = 0

    def set_time_step(self, time_step_s):
        self.time_step_s = time_step_s

    def step(self):
        self.steps += 1

    def reset_models(self):
        self.resets += 1

    def reset_time(self):
        pass


class FakeContext:
    closed = False

    def close(self):
        self.closed = True


class Recorder(ModelPlugin):
    """Writes down what is called."""

    def __init__(self, fails_in=None, error=RuntimeError, restart_fails=False):
        super().__init__(None)
        self.calls = []
        self.fails_in, self.error, self.restart_fails = fails_in, error, restart_fails
        self.wants_revival = False

    def _note(self, *call):
        self.calls.append(call)
        if call[0] == self.fails_in:
            raise self.error("broken on purpose")

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

    def hold(self):
        self._note("hold")

    def restarted(self):
        self._note("restarted")
        if self.restart_fails:
            raise RuntimeError("cannot begin")
        return self

    def while_failed(self, time_s):
        self._note("while_failed", time_s)
        return self.wants_revival

    def named(self, what):
        return [call for call in self.calls if call[0] == what]


@pytest.fixture
def log():
    return FakeLog()


@pytest.fixture
def counts():
    return {"/command": 0}


@pytest.fixture
def simulation(log, counts):
    return Simulation(FakeWorld(), RequestQueue(), log, Faults(log), paused=True, deliveries=lambda: dict(counts))


@pytest.fixture
def running(simulation):
    """The loop in a separate thread."""
    ending = threading.Event()
    thread = threading.Thread(target=simulation.run, args=(ending.is_set,))
    thread.start()
    yield simulation
    ending.set()
    thread.join(60.0)
    assert not thread.is_alive()


def host(simulation, **options):
    hosted = HostedPlugin(Recorder(**options), FakeContext(), "model", "libtest.so")
    simulation.host(hosted)
    return hosted


def advance(simulation, ticks, topics=(), timeout_s=60.0):
    return simulation.requests.call(simulation.start_advance, ticks, topics, timeout_s)


def test_a_tick_is_update_step_publish_at_the_right_times(simulation):
    calls = host(simulation).plugin.calls
    simulation.do_tick()
    simulation.do_tick()
    assert calls == [("update", 0.0, 0.002), ("publish", 0.002), ("update", 0.002, 0.002), ("publish", 0.004)]
    assert simulation.world.steps == 2


def test_ticks_up_to_a_multiple_follow_each_other_at_once_in_a_paced_world_alone(simulation):
    simulation.paused, simulation.turn_lengths = False, (4, 4)
    simulation.do_tick()
    assert [simulation._some_ticks() for _ in range(3)] == [3, 4, 4] and simulation.tick == 12

    def pause():
        simulation.paused = simulation.tick == 14

    simulation.on_tick = pause
    assert simulation._some_ticks() == 2
    simulation.paused, simulation.on_tick = False, lambda: None
    simulation.real_time_factor = 0.0
    assert simulation._some_ticks() == 1


def test_a_late_world_has_longer_turns(simulation):
    simulation.paused, simulation.turn_lengths = False, (1, 5)
    assert simulation.ticks_at_once == 1
    simulation._pacer.lag.is_late = True
    assert [simulation._some_ticks() for _ in range(2)] == [5, 5]
    simulation.real_time_factor = 1.0
    assert simulation.ticks_at_once == 1


def test_a_long_request_does_not_make_a_world_late_and_a_short_one_does_not_hide_it(simulation):
    forgotten, turns = [], iter(range(3))
    simulation.paused, simulation._pacer.forget_lag = False, lambda: forgotten.append(simulation.tick)
    # A request that takes long is what is tested.
    requests = [lambda: None, lambda: time.sleep(1.2 * LATE_S)]

    def stop():
        if requests:
            simulation.requests.submit(requests.pop(0))
        return next(turns, None) is None

    simulation.run(stop)
    assert forgotten == [1] and simulation.tick == 3


def test_time_is_exact_after_days(simulation):
    simulation.tick = 3 * 24 * 3600 * 500 + 1
    assert simulation.time_ns == 259200 * 10**9 + 2_000_000


def test_the_length_of_a_tick_changes_and_time_goes_on(simulation):
    plugin = host(simulation).plugin
    changed = []
    simulation.on_step_change = lambda: changed.append(simulation.step_s)
    simulation.do_tick()
    simulation.set_step(0.001)
    simulation.do_tick()
    simulation.set_step(0.004)
    simulation.do_tick()
    assert plugin.named("update") == [("update", 0.0, 0.002), ("update", 0.002, 0.001), ("update", 0.003, 0.004)]
    assert simulation.time_ns == 7_000_000 and changed == [0.001, 0.004]
    assert simulation.world.time_step_s == 0.004
    simulation.reset(time_too=True)
    simulation.do_tick()
    assert simulation.time_ns == 4_000_000


def test_a_plugin_may_keep_the_length_of_a_tick(simulation):
    host(simulation).plugin.keeps_step = True
    with pytest.raises(ValueError, match="libtest.so of model model is made for steps of 0.002 s"):
        simulation.set_step(0.001)
    assert simulation.step_s == simulation.world.time_step_s == 0.002


CALLS = {"update": Simulation.do_tick, "publish": Simulation.do_tick,
         "reset": lambda simulation: simulation.reset(time_too=False),
         "joints_set": lambda simulation: simulation.joints_were_set("model")}


@pytest.mark.parametrize("error", [RuntimeError, RecursionError, SystemExit, MemoryError])
@pytest.mark.parametrize("where", CALLS)
def test_a_plugin_that_raises_once_restarts(simulation, log, where, error):
    bad, good = host(simulation, fails_in=where, error=error), host(simulation)
    CALLS[where](simulation)
    line, = log.of("error")
    assert "libtest.so" in line and where + "()" in line and "broken on purpose" in line and error.__name__ in line
    assert len(bad.plugin.named("restarted")) == 1 and not bad.plugin.named("hold")
    assert not bad.context.closed
    bad.plugin.fails_in = None
    before = len(bad.plugin.named("update"))
    simulation.do_tick()
    assert len(bad.plugin.named("update")) == before + 1 and (bad.has_failed, bad.failures) == (False, 1)
    assert good.plugin.named("update") and not good.plugin.named("restarted")
    assert len(log.of("error")) == 1


def test_at_the_third_failure_within_ten_seconds_a_plugin_counts_as_failed_until_a_reset(simulation, log):
    bad, good = host(simulation, fails_in="update"), host(simulation)
    for _ in range(5):
        simulation.do_tick()
    assert bad.has_failed and bad.failures == 3
    assert len(bad.plugin.named("update")) == 3 and len(bad.plugin.named("publish")) == 2
    assert bad.plugin.named("while_failed") == [("while_failed", time_s) for time_s in (0.006, 0.008, 0.01)]
    assert len(bad.plugin.named("hold")) == 1
    assert len(log.of("error")) == 3
    assert "reset_world" in log.of("error")[-1] and "broken on purpose" in log.of("error")[-1]
    assert len(good.plugin.named("update")) == 5 and simulation.world.steps == 5
    simulation.joints_were_set("model")
    assert not bad.plugin.named("joints_set")

    bad.plugin.fails_in = None
    simulation.reset(time_too=False)
    assert not bad.has_failed and bad.plugin.calls[-2:] == [("restarted",), ("reset",)]
    simulation.do_tick()
    assert bad.plugin.calls[-2][0] == "update" and bad.plugin.calls[-1][0] == "publish"
    assert "revived by a reset" in log.of("info")[-1]


def test_failures_that_are_ten_seconds_apart_are_each_the_first(simulation):
    bad = host(simulation)
    for _ in range(6):
        bad.plugin.fails_in = "update"
        simulation.do_tick()
        bad.plugin.fails_in = None
        simulation.tick += 2600
    assert not bad.has_failed and bad.failures == 6


def test_failures_before_time_went_back_do_not_count(simulation):
    bad = host(simulation, fails_in="update")
    simulation.do_tick()
    simulation.do_tick()
    simulation.reset(time_too=True)
    simulation.do_tick()
    assert not bad.has_failed and bad.failures == 3


def test_a_failed_plugin_can_ask_to_be_revived(simulation, log):
    bad = host(simulation, fails_in="publish")
    for _ in range(4):
        simulation.do_tick()
    assert bad.has_failed
    bad.plugin.fails_in, bad.plugin.wants_revival = None, True
    simulation.do_tick()
    assert not bad.has_failed and "revived by a request" in log.of("info")[-1]
    simulation.do_tick()
    assert bad.plugin.calls[-1][0] == "publish"


def test_a_plugin_that_cannot_restart_counts_as_failed_immediately(simulation, log):
    bad = host(simulation, fails_in="update", restart_fails=True)
    simulation.do_tick()
    assert bad.has_failed and "cannot begin" in log.of("error")[-1]
    bad.plugin.fails_in, bad.plugin.restart_fails = "while_failed", False
    simulation.do_tick()  # an error is only counted from now on
    bad.plugin.fails_in = None
    simulation.reset(time_too=True)
    assert not bad.has_failed


@pytest.mark.parametrize("name", ["on_turn", "before_step", "on_tick"])
def test_what_hangs_on_the_loop_may_raise(running, log, name):
    def fail():
        raise RuntimeError("broken on purpose")

    running.requests.call(setattr, running, name, fail)
    running.paused = False
    wait_until(lambda: running.tick > 20 and log.of("error"), "the world to go on")
    assert "broken on purpose" in log.of("error")[0] and len(log.of("error")) == 1


def test_a_model_that_is_deleted_takes_its_failed_plugin_along(simulation):
    bad = host(simulation, fails_in="update")
    for _ in range(3):
        simulation.do_tick()
    bad.plugin.fails_in = None
    simulation.unhost("model")
    simulation.do_tick()
    assert bad.context.closed and simulation.plugins == [] and len(bad.plugin.named("while_failed")) == 1


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
    assert running.requests.call(lambda: running.tick) == 0
    assert running.requests.call(lambda: running.tick) == 0


def test_a_world_runs_in_real_time(running):
    start, start_tick = time.monotonic(), running.tick
    running.paused = False
    wait_until(lambda: running.tick - start_tick >= 250, "half a second of simulation")
    # A busy machine may delay it; it never comes early.
    assert time.monotonic() - start > 0.45


def test_an_advance_makes_exactly_so_many_ticks(running):
    assert advance(running, 7).result(60.0) == (7, 14_000_000)
    assert advance(running, 0).result(60.0) == (7, 14_000_000)
    assert advance(running, 1000).result(60.0) == (1007, 2_014_000_000)
    assert running.world.steps == 1007


def test_an_advance_waits_for_its_topics_each_time(running, counts):
    future = advance(running, 2, ["/command"])
    # The loop has accepted the request, has made a turn since, and waits.
    assert running.requests.call(lambda: running.tick) == 0
    assert running.requests.call(lambda: running.tick) == 0
    assert not future.done()
    counts["/command"] += 1
    assert future.result(60.0)[0] == 2
    # What arrived before does not count again.
    second = advance(running, 2, ["/command"], timeout_s=0.1)
    with pytest.raises(AdvanceRefused, match="no message within 0.1 s on /command"):
        second.result(60.0)
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
    assert first.result(60.0)[0] == 1


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
        future.result(60.0)
