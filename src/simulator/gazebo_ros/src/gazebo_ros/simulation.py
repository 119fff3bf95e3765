# SPDX-License-Identifier: BSD-3-Clause
"""The loop: one thread that owns the physics world and everything that touches it. ROS-free.

A tick is: commands and requests in, plugins' ``update``, one physics step, time, plugins' ``publish``.
"""
from __future__ import annotations

import contextlib
import time
import traceback
from concurrent.futures import Future
from typing import TYPE_CHECKING

from command_line.options import counted
from gazebo_ros.pacing import LATE_S, Pacer
from loop_ros.faults import SURVIVED, described

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from bullet_sim import World
    from gazebo_ros.model_plugin import ModelPlugin, PluginContext
    from loop_ros.faults import Faults
    from loop_ros.protocol import Log
    from loop_ros.request_queue import RequestQueue

# While the world is paused: how long the loop sleeps when nobody asks for anything, and while a lock-step request
# waits for its topics [s].
IDLE_S = 0.005
AWAIT_S = 0.0002
# A plugin that raises this many times within this time [s, simulated time] is not restarted again.
FAILURES, FAILURES_WITHIN_S = 3, 10.0


class AdvanceRefused(Exception):
    """A lock-step request cannot be served; the text says why."""


class HostedPlugin:
    """A model plugin with its resources and its failures.

    ``failures``: how often it has raised; ``last_error``: the newest one as text; ``has_failed``: whether it counts as
    failed, so that it is not ticked until a reset revives it.
    """

    def __init__(self, plugin: ModelPlugin, context: PluginContext, model_name: str, label: str) -> None:
        """``label``: the plugin's file name, for messages."""
        self.plugin = plugin
        self.context = context
        self.model_name = model_name
        self.label = label
        self.failures, self.last_error, self.has_failed = 0, "", False
        self.failed_at: list[float] = []  # simulation times of the newest failures [s]


class _Advance:
    def __init__(self, ticks: int, awaited: list[str], timeout_s: float, give_up_at: float) -> None:
        self.remaining = ticks
        self.awaited = awaited
        self.timeout_s = timeout_s
        self.give_up_at = give_up_at
        self.future: Future[tuple[int, int]] = Future()


class Simulation:
    """Runs a ``bullet_sim.World`` and its model plugins, tick by tick."""

    def __init__(self, world: World, requests: RequestQueue, log: Log, faults: Faults, real_time_factor: float = 1.0,
                 paused: bool = False, deliveries: Callable[[], dict[str, int]] = dict) -> None:
        """Ready to :meth:`run`.

        ``requests``: :class:`loop_ros.request_queue.RequestQueue`; ``faults``: :class:`loop_ros.faults.Faults`.
        ``deliveries()`` -> {topic: number of messages received} for the topics that this world subscribes to.
        """
        #: Hooks: once per turn of the loop, also while paused; before each physics step; after each tick; after time
        #: went back to zero; before models are moved, to read the messages that came before.
        self.on_turn = self.before_step = self.on_tick = self.on_time_reset = self.read_messages = lambda: None
        #: Called after the length of a tick has changed.
        self.on_step_change = lambda: None
        #: In a paced world, the ticks up to a multiple of this follow each other at once: fewer wake-ups, which make a
        #: tick take longer. The second number is for a world that is late.
        self.turn_lengths: tuple[int, int] = 1, 1
        self.world = world
        self.requests = requests
        self.paused = paused
        self.plugins: list[HostedPlugin] = []
        self.tick = 0
        self._working: list[HostedPlugin] = []
        self._failed: list[HostedPlugin] = []
        self._log = log
        self._faults = faults
        self._deliveries = deliveries
        self._step_s = world.time_step_s
        self._step_ns = round(world.time_step_s * 1e9)
        self._step_since = 0, 0  # tick and time [ns] since which a tick has its present length
        self._pacer = Pacer(self._step_s, real_time_factor)
        self._advance: _Advance | None = None
        self._delivered_before: dict[str, int] = {}

    @property
    def time_ns(self) -> int:
        """Simulation time as an exact count of nanoseconds."""
        tick, time_ns = self._step_since
        return time_ns + (self.tick - tick) * self._step_ns

    @property
    def time_s(self) -> float:
        """Simulation time [s]."""
        return self.time_ns * 1e-9

    @property
    def step_s(self) -> float:
        """Length of a tick [s]."""
        return self._step_s

    def set_step(self, step_s: float) -> None:
        """Set the length of a tick from the next one on [s]; time and the real-time factor stay.

        Raises ``BulletSimError`` if it is out of bounds, and ``ValueError`` if a plugin only works with the present
        step.
        """
        keeping = [hosted for hosted in self.plugins if hosted.plugin.keeps_step]
        if keeping:
            raise ValueError("time_step %g s cannot be set: %s is made for steps of %g s; delete it first"
                             % (step_s, _names(keeping[0]), self._step_s))
        self.world.set_time_step(step_s)
        self._step_since = self.tick, self.time_ns
        self._step_s, self._step_ns = step_s, round(step_s * 1e9)
        self._pacer = Pacer(step_s, self.real_time_factor)
        for hosted in self.plugins:
            self._faults.guarded("%s, another time step" % _names(hosted), hosted.plugin.step_changed, step_s)
        self.on_step_change()

    @property
    def real_time_factor(self) -> float:
        """The requested factor; 0 is as fast as possible."""
        return self._pacer.real_time_factor

    @real_time_factor.setter
    def real_time_factor(self, factor: float) -> None:
        self._pacer = Pacer(self._step_s, factor)

    @property
    def ticks_at_once(self) -> int:
        """The one of ``turn_lengths`` that is in force."""
        return self.turn_lengths[self._pacer.lag.is_late]

    @property
    def is_stepping(self) -> bool:
        """True while time moves: running, or advancing in lock-step."""
        return not self.paused or (self._advance is not None and not self._advance.awaited)

    def run(self, stop: Callable[[], bool]) -> None:
        """Turn until ``stop()`` is true. The calling thread becomes the only one that may touch the world."""
        self._pacer.restart()
        requests = self.requests
        while not stop():
            began = time.perf_counter()
            if requests.run_pending() and time.perf_counter() - began > LATE_S:
                self._pacer.forget_lag()
            self._faults.guarded("between two ticks", self.on_turn)
            if self._advance is not None:
                self._advance_turn(self._advance)
            elif self.paused:
                requests.wait(IDLE_S)
                self._pacer.restart()
            else:
                self._pacer.wait(self._some_ticks())
        if self._advance is not None:
            self._end_advance(self._advance, AdvanceRefused("the simulator is shutting down"))

    def _some_ticks(self) -> int:
        """The ticks of one turn; returns how many."""
        count, at_once = 0, self.ticks_at_once if self._pacer.is_paced else 1
        while True:
            self.do_tick()
            count += 1
            if self.tick % at_once == 0 or self.paused:
                return count

    def do_tick(self) -> None:
        """One tick."""
        time_s, step_s = self.time_s, self._step_s
        for hosted in self._working:
            try:
                hosted.plugin.update(time_s, step_s)
            except SURVIVED as error:  # a plugin is user code
                self._has_raised(hosted, "update", error)
        self._faults.guarded("before a step", self.before_step)
        self.world.step()
        self.tick += 1
        time_s = self.time_s
        for hosted in self._working:
            try:
                hosted.plugin.publish(time_s)
            except SURVIVED as error:
                self._has_raised(hosted, "publish", error)
        if self._failed:
            self._wait_for_revival(time_s)
        self._faults.guarded("after a tick", self.on_tick)

    def start_advance(self, ticks: int, topics: Sequence[str], timeout_s: float) -> Future[tuple[int, int]]:
        """Advance the paused world by ``ticks`` once each of ``topics`` has delivered since the last advance.

        Returns a ``Future`` of (tick, time in ns) that ends when that is done, or with :class:`AdvanceRefused`. Raises
        the latter at once for a request that cannot be served.
        """
        if not self.paused:
            raise AdvanceRefused("the world is running; call /gazebo/pause_physics first")
        if self._advance is not None:
            raise AdvanceRefused("another advance is under way (%s left)" % counted(self._advance.remaining, "tick"))
        if not timeout_s >= 0.0:
            raise AdvanceRefused("timeout_s is %r, expected 0 or a positive number of seconds" % (timeout_s,))
        heard = self._deliveries()
        unheard = [topic for topic in topics if topic not in heard]
        if unheard:
            raise AdvanceRefused("nothing in this world listens to %s; it listens to %s"
                                 % (", ".join(unheard), ", ".join(sorted(heard)) or "no topic"))
        self._advance = _Advance(ticks, list(topics), timeout_s, time.monotonic() + timeout_s)
        return self._advance.future

    def reset(self, time_too: bool) -> None:
        """Reset every model to its start, and with ``time_too`` the time to zero. Revives failed plugins."""
        self.read_messages()
        self.world.reset_models()
        if time_too:
            self.world.reset_time()
            self.tick, self._step_since = 0, (0, 0)
        for hosted in list(self.plugins):
            hosted.failed_at = []
            if hosted.has_failed:
                self._revive(hosted, "a reset")
        for hosted in self._working:
            try:
                hosted.plugin.reset()
            except SURVIVED as error:
                self._has_raised(hosted, "reset", error)
        if time_too:
            self.on_time_reset()
        self._pacer.restart()

    def joints_were_set(self, model_name: str) -> None:
        """Tell the model's plugins that its joints were moved by a service."""
        self.read_messages()
        for hosted in [hosted for hosted in self._working if hosted.model_name == model_name]:
            try:
                hosted.plugin.joints_set()
            except SURVIVED as error:
                self._has_raised(hosted, "joints_set", error)

    def host(self, hosted: HostedPlugin) -> None:
        """Run this plugin from the next tick on."""
        self.plugins = [*self.plugins, hosted]
        self._sort()

    def unhost(self, model_name: str | None = None) -> None:
        """Close the plugins of one model, or of all."""
        for hosted in [h for h in self.plugins if model_name is None or h.model_name == model_name]:
            self._close(hosted)

    def _advance_turn(self, advance: _Advance) -> None:
        if not self.paused:
            self._end_advance(advance, AdvanceRefused(
                "the world was unpaused with %s left" % counted(advance.remaining, "tick")))
            return
        if advance.awaited:
            counts = self._deliveries()
            advance.awaited = [topic for topic in advance.awaited
                               if counts.get(topic, 0) <= self._delivered_before.get(topic, 0)]
            if advance.awaited and time.monotonic() > advance.give_up_at:
                self._end_advance(advance, AdvanceRefused("no message within %g s on %s"
                                                          % (advance.timeout_s, ", ".join(advance.awaited))))
            elif advance.awaited:
                self.requests.wait(AWAIT_S)
            return
        if advance.remaining:
            self.do_tick()
            advance.remaining -= 1
        if not advance.remaining:
            self._end_advance(advance, None)

    def _end_advance(self, advance: _Advance, error: AdvanceRefused | None) -> None:
        self._advance = None
        if error is not None:
            advance.future.set_exception(error)
            return
        self._delivered_before = self._deliveries()
        advance.future.set_result((self.tick, self.time_ns))

    def _sort(self) -> None:
        # New lists each time: the loop may be walking over the old ones.
        self._working = [hosted for hosted in self.plugins if not hosted.has_failed]
        self._failed = [hosted for hosted in self.plugins if hosted.has_failed]

    def _has_raised(self, hosted: HostedPlugin, where: str, error: BaseException) -> None:
        """A plugin has raised: restart it, or stop it if restarting has not helped."""
        hosted.failures += 1
        hosted.last_error = "%s() raised %s" % (where, described(error))
        now = self.time_s
        hosted.failed_at = [then for then in hosted.failed_at if now - FAILURES_WITHIN_S < then <= now] + [now]
        who = _names(hosted)
        if len(hosted.failed_at) >= FAILURES:
            self._give_up(hosted, "%s has failed %d times within %g s" % (who, FAILURES, FAILURES_WITHIN_S))
            return
        self._log.error("%s: %s; it restarts from the model's present state.\n%s"
                        % (who, hosted.last_error, _trace(error)))
        self._restart_or_stop(hosted)

    def _restart_or_stop(self, hosted: HostedPlugin) -> None:
        try:
            hosted.plugin = hosted.plugin.restarted()
        except SURVIVED as error:
            hosted.last_error = "its restart raised %s" % described(error)
            self._give_up(hosted, "%s cannot restart" % _names(hosted))
            return
        hosted.has_failed = False
        self._sort()

    def _give_up(self, hosted: HostedPlugin, why: str) -> None:
        hosted.has_failed = True
        self._faults.guarded("%s, stopping its joints" % _names(hosted), hosted.plugin.hold)
        self._sort()
        self._log.error("%s and is stopped; the world goes on. A reset revives it: rosservice call /gazebo/reset_world "
                        "{}. The last error: %s" % (why, hosted.last_error))

    def _wait_for_revival(self, time_s: float) -> None:
        for hosted in self._failed:
            if self._faults.guarded("%s, failed" % _names(hosted), hosted.plugin.while_failed, time_s):
                self._revive(hosted, "a request")

    def _revive(self, hosted: HostedPlugin, by: str) -> None:
        hosted.failed_at = []
        self._restart_or_stop(hosted)
        if not hosted.has_failed:
            self._log.info("%s is revived by %s" % (_names(hosted), by))

    def _close(self, hosted: HostedPlugin) -> None:
        self.plugins = [other for other in self.plugins if other is not hosted]
        self._sort()
        try:
            hosted.plugin.close()
        except SURVIVED as error:
            self._log.error("%s failed in close():\n%s" % (_names(hosted), _trace(error)))
        with contextlib.suppress(Exception):
            hosted.context.close()


def _names(hosted: HostedPlugin) -> str:
    return "model plugin %s of model %s" % (hosted.label, hosted.model_name)


def _trace(error: BaseException) -> str:
    return "".join(traceback.format_exception(error)).rstrip()
