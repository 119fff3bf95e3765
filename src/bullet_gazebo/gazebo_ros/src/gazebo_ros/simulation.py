# SPDX-License-Identifier: BSD-3-Clause
"""The loop: one thread that owns the physics world and everything that touches it. ROS-free.

A tick is: commands and requests in, plugins' ``update``, one physics step, time, plugins' ``publish``.
"""
import contextlib
import time
import traceback
from concurrent.futures import Future

from gazebo_ros.pacing import Pacer

# While the world is paused: how long the loop sleeps when nobody asks for anything, and while a lock-step request
# waits for its topics [s].
IDLE_S = 0.005
AWAIT_S = 0.0002


class AdvanceRefused(Exception):
    """A lock-step request cannot be served; the text says why."""


class HostedPlugin:
    """A model plugin and what must be closed with it."""

    def __init__(self, plugin, context, model_name, label):
        """``label``: the plugin's file name, for messages."""
        self.plugin = plugin
        self.context = context
        self.model_name = model_name
        self.label = label


class _Advance:
    def __init__(self, ticks, awaited, timeout_s, give_up_at):
        self.remaining = ticks
        self.awaited = awaited
        self.timeout_s = timeout_s
        self.give_up_at = give_up_at
        self.future = Future()


class Simulation:
    """Runs a ``bullet_sim.World`` and its model plugins, tick by tick."""

    def __init__(self, world, board, log, real_time_factor=1.0, paused=False, deliveries=dict,
                 clock=time.monotonic):
        """Ready to :meth:`run`.

        ``board``: :class:`gazebo_ros.mailbox.RequestBoard`. ``deliveries()`` -> how many messages have come in on each
        topic that something in this world listens to.
        """
        #: Called once per turn of the loop, also while paused; before each physics step; after each tick; after time
        #: went back to zero.
        self.on_turn = self.before_step = self.on_tick = self.on_time_reset = lambda: None
        self.world = world
        self.board = board
        self.paused = paused
        self.plugins = []
        self.tick = 0
        self._log = log
        self._deliveries = deliveries
        self._clock = clock
        self._step_s = world.time_step_s
        self._step_ns = round(world.time_step_s * 1e9)
        self._pacer = Pacer(self._step_s, real_time_factor)
        self._advance = None
        self._delivered_before = {}

    @property
    def time_ns(self):
        """Simulation time as an exact count of nanoseconds."""
        return self.tick * self._step_ns

    @property
    def time_s(self):
        """Simulation time [s]."""
        return self.tick * self._step_ns * 1e-9

    @property
    def step_s(self):
        """Length of a tick [s]."""
        return self._step_s

    @property
    def real_time_factor(self):
        """What was asked for; 0 is as fast as possible."""
        return self._pacer.real_time_factor

    @real_time_factor.setter
    def real_time_factor(self, factor):
        self._pacer = Pacer(self._step_s, factor)

    @property
    def is_stepping(self):
        """True while time moves: running, or advancing in lock-step."""
        return not self.paused or (self._advance is not None and not self._advance.awaited)

    def run(self, stop):
        """Turn until ``stop()`` is true. The calling thread becomes the only one that may touch the world."""
        self._pacer.restart()
        board = self.board
        while not stop():
            board.run_pending()
            self.on_turn()
            if self._advance is not None:
                self._advance_turn()
            elif self.paused:
                board.wait(IDLE_S)
                self._pacer.restart()
            else:
                self.do_tick()
                self._pacer.wait()
        if self._advance is not None:
            self._end_advance(AdvanceRefused("the simulator is shutting down"))

    def do_tick(self):
        """One tick."""
        time_s, step_s = self.time_s, self._step_s
        for hosted in self.plugins:
            try:
                hosted.plugin.update(time_s, step_s)
            except Exception:  # noqa: BLE001  (a plugin is anybody's code; the world goes on without it)
                self._disable(hosted, "update")
        self.before_step()
        self.world.step()
        self.tick += 1
        time_s = self.time_s
        for hosted in self.plugins:
            try:
                hosted.plugin.publish(time_s)
            except Exception:  # noqa: BLE001
                self._disable(hosted, "publish")
        self.on_tick()

    def start_advance(self, ticks, topics, timeout_s):
        """Advance the paused world by ``ticks`` once each of ``topics`` has delivered since the last advance.

        Returns a ``Future`` of (tick, time in ns) that ends when that is done, or with :class:`AdvanceRefused`. Raises
        the latter at once for a request that cannot be served.
        """
        if not self.paused:
            raise AdvanceRefused("the world is running; call /gazebo/pause_physics first")
        if self._advance is not None:
            raise AdvanceRefused("another advance is under way (%d ticks left)" % self._advance.remaining)
        if not timeout_s >= 0.0:
            raise AdvanceRefused("timeout_s is %r, expected 0 or a positive number of seconds" % (timeout_s,))
        heard = self._deliveries()
        unheard = [topic for topic in topics if topic not in heard]
        if unheard:
            raise AdvanceRefused("nothing in this world listens to %s; it listens to %s"
                                 % (", ".join(unheard), ", ".join(sorted(heard)) or "no topic"))
        self._advance = _Advance(ticks, list(topics), timeout_s, self._clock() + timeout_s)
        return self._advance.future

    def reset(self, time_too):
        """Put every model back to its start, and with ``time_too`` the time back to zero."""
        self.world.reset_models()
        if time_too:
            self.world.reset_time()
            self.tick = 0
        for hosted in list(self.plugins):
            try:
                hosted.plugin.reset()
            except Exception:  # noqa: BLE001
                self._disable(hosted, "reset")
        if time_too:
            self.on_time_reset()
        self._pacer.restart()

    def joints_were_set(self, model_name):
        """Tell the model's plugins that its joints were put elsewhere."""
        for hosted in [hosted for hosted in self.plugins if hosted.model_name == model_name]:
            try:
                hosted.plugin.joints_set()
            except Exception:  # noqa: BLE001
                self._disable(hosted, "joints_set")

    def host(self, hosted):
        """Run this plugin from the next tick on."""
        # A new list each time: the loop may be walking over the old one.
        self.plugins = [*self.plugins, hosted]

    def unhost(self, model_name=None):
        """Close the plugins of one model, or of all."""
        for hosted in [h for h in self.plugins if model_name is None or h.model_name == model_name]:
            self._close(hosted)

    def _advance_turn(self):
        advance = self._advance
        if not self.paused:
            self._end_advance(AdvanceRefused("the world was unpaused with %d ticks left" % advance.remaining))
            return
        if advance.awaited:
            counts = self._deliveries()
            advance.awaited = [topic for topic in advance.awaited
                               if counts.get(topic, 0) <= self._delivered_before.get(topic, 0)]
            if advance.awaited and self._clock() > advance.give_up_at:
                self._end_advance(AdvanceRefused("no message within %g s on %s"
                                                 % (advance.timeout_s, ", ".join(advance.awaited))))
            elif advance.awaited:
                self.board.wait(AWAIT_S)
            return
        if advance.remaining:
            self.do_tick()
            advance.remaining -= 1
        if not advance.remaining:
            self._end_advance(None)

    def _end_advance(self, error):
        advance, self._advance = self._advance, None
        if error is not None:
            advance.future.set_exception(error)
            return
        self._delivered_before = self._deliveries()
        advance.future.set_result((self.tick, self.time_ns))

    def _disable(self, hosted, where):
        self._log.error("model plugin %s of model %s failed in %s() and is left out from now on; the world goes on.\n%s"
                        % (hosted.label, hosted.model_name, where, traceback.format_exc()))
        self._close(hosted)

    def _close(self, hosted):
        self.plugins = [other for other in self.plugins if other is not hosted]
        try:
            hosted.plugin.close()
        except Exception:  # noqa: BLE001
            self._log.error("model plugin %s of model %s failed in close():\n%s"
                            % (hosted.label, hosted.model_name, traceback.format_exc()))
        with contextlib.suppress(Exception):
            hosted.context.close()
