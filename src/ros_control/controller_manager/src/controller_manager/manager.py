# SPDX-License-Identifier: BSD-3-Clause
"""Loads, starts and stops controllers, and keeps their states. ROS-free; one thread only."""
from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Future, InvalidStateError

from controller_manager.controller import ControllerContext
from controller_manager.hardware import RobotHardware
from loop_ros.protocol import Log

from .controller import Controller
from .errors import ControllerError, Refused
from .hardware import SwitchResult
from .interfaces import COMMAND

# Exceptions of a controller that do not stop the others.
_SURVIVED = (Exception, SystemExit)

BEST_EFFORT = 1
STRICT = 2

INITIALIZED = "initialized"
RUNNING = "running"
STOPPED = "stopped"
WAITING = "waiting"
ABORTED = "aborted"


class Loaded:
    """A controller under its name: ``name``, ``kind`` (its type string), ``controller``, ``state``."""

    __slots__ = ("name", "kind", "controller", "state")

    def __init__(self, name: str, kind: str, controller: Controller) -> None:
        self.name = name
        self.kind = kind
        self.controller = controller
        self.state = INITIALIZED

    @property
    def claimed_resources(self) -> list[tuple[str, list[str]]]:
        """List of (hardware interface, sorted joint names)."""
        return [(interface, sorted(joints)) for interface, joints in self.controller.claims.items()]

    @property
    def commanded_joints(self) -> set[str]:
        """Set of the joints that this controller commands, through whichever interface."""
        claims = self.controller.claims
        return {joint for interface in COMMAND for joint in claims.get(interface, ())}


class _Switch:
    """An accepted change that waits for the next update."""

    def __init__(self, start: list[Loaded], stop: list[Loaded], new: list[Loaded], start_asap: bool,
                 timeout_s: float) -> None:
        self.start = start  # every controller whose starting() is due
        self.stop = stop
        self.new = new  # those of ``start`` that did not run before
        self.start_asap = start_asap
        self.timeout_s = timeout_s
        self.began_s: float | None = None
        self.future: Future[None] = Future()


class ControllerManager:
    """Loads, starts and stops controllers on one robot's hardware.

    A switch takes place inside :meth:`update`, so it takes as long as updates do not come.
    """

    def __init__(self, hardware: RobotHardware, log: Log) -> None:
        """``hardware``: :class:`RobotHardware`; ``log``: ``info``, ``warn``, ``error`` of one text."""
        self.hardware = hardware
        self._log = log
        self._loaded: dict[str, Loaded] = {}
        self._running: list[Loaded] = []
        self._idle: list[Loaded] = []  # loaded, not running, but with work in each tick
        self._switch: _Switch | None = None
        self._closed = False

    @property
    def loaded(self) -> list[Loaded]:
        """List of :class:`Loaded`, in the order of loading."""
        return list(self._loaded.values())

    def load(self, name: str, kind: str,
             controller_class: Callable[[str, RobotHardware, ControllerContext], Controller],
             context: ControllerContext) -> None:
        """Make a controller; it does not run yet. Raises :class:`Refused` when the name is taken or its constructor
        refuses; the context is closed then."""
        try:
            self.check_free(name)
            controller = controller_class(name, self.hardware, context)
        except Refused:
            context.close()
            raise
        except ControllerError as error:
            context.close()
            raise Refused("cannot load controller '%s': %s" % (name, error)) from error
        except _SURVIVED as error:
            context.close()
            raise Refused("cannot load controller '%s': its constructor failed with %s: %s"
                          % (name, type(error).__name__, error)) from error
        self._loaded[name] = Loaded(name, kind, controller)
        self._sort()

    def check_free(self, name: str) -> None:
        """Raise :class:`Refused` when a controller of this name is loaded."""
        if self._closed:
            raise Refused("the controller manager has ended")
        if name in self._loaded:
            raise Refused("cannot load controller '%s': a controller of this name is already loaded (type %s); unload "
                          "it first" % (name, self._loaded[name].kind))

    def unload(self, name: str) -> None:
        """Remove a controller. Raises :class:`Refused` when it runs, or when there is none of that name."""
        loaded = self._loaded.get(name)
        if loaded is None:
            raise Refused("cannot unload controller '%s': %s" % (name, self._unknown()))
        if loaded.state == RUNNING:
            raise Refused("cannot unload controller '%s': it is running; stop it first" % name)
        del self._loaded[name]
        self._sort()
        self._close(loaded)

    def switch(self, start: Iterable[str], stop: Iterable[str], strictness: int = STRICT, start_asap: bool = False,
               timeout_s: float = 0.0) -> Future[None]:
        """Accept a request to stop and start controllers (lists of names) within the next updates.

        Returns a ``Future`` that is set when this is done (also when a start has failed, see state ``aborted``). Raises
        :class:`Refused` if the strictness, two controllers on one joint or the hardware forbid it; nothing changes
        then. ``timeout_s``: time limit of the hardware, 0 for none.
        """
        if self._switch is not None or self._closed:
            raise Refused("the controller manager has ended" if self._closed else "another switch is under way")
        if strictness == 0:
            self._log.warn("switch_controller: strictness 0 is taken as BEST_EFFORT (%d); say which one is meant, "
                           "BEST_EFFORT or STRICT (%d)" % (BEST_EFFORT, STRICT))
        strict = strictness == STRICT
        starting, stopping = self._named(start, strict, "start"), self._named(stop, strict, "stop")
        for loaded in self._loaded.values():
            running = loaded.state == RUNNING
            if running and loaded in stopping and loaded in starting:
                raise Refused("conflicting switching command: '%s' is running and should be started and stopped; one "
                              "call cannot restart it" % loaded.name)
            if strict and not running and loaded in stopping:
                raise Refused("cannot stop controller '%s': it is %s, not running" % (loaded.name, loaded.state))
            if strict and running and loaded in starting:
                raise Refused("cannot start controller '%s': it is already running" % loaded.name)
        stopping = [loaded for loaded in stopping if loaded.state == RUNNING]
        new = [loaded for loaded in starting if loaded.state != RUNNING]
        self._check_conflicts([loaded for loaded in self._running if loaded not in stopping] + new)
        if not self.hardware.prepare_switch(_claims(new), _claims(stopping)):
            raise Refused("the hardware refuses to start [%s] and stop [%s]" % (_names(new), _names(stopping)))
        self._switch = _Switch(starting, stopping, new, start_asap, timeout_s)
        return self._switch.future

    def abandon_switch(self, future: Future[None]) -> None:
        """Drop a change whose caller has given up; without effect when it is done."""
        if self._switch is not None and self._switch.future is future:
            for loaded in self._switch.start:
                if loaded.state == WAITING:
                    loaded.state = ABORTED
            self._switch = None

    def restart(self, time_s: float) -> None:
        """Stop and start every running controller at control time ``time_s`` [s]: their goals and commands end."""
        for loaded in self._running:
            try:
                loaded.controller.stopping(time_s)
                loaded.controller.starting(time_s)
            except _SURVIVED as error:  # a controller is foreign code; the others continue
                self._fail(loaded, "restart", error)

    def update(self, time_s: float, dt: float, reset_controllers: bool = False) -> None:
        """One tick. ``time_s``: control time [s], ``dt``: since the last update [s].

        ``reset_controllers``: :meth:`restart` first. A controller that raises is logged and stopped (state
        ``aborted``), and its joints are held; it can be started again.
        """
        if reset_controllers:
            self.restart(time_s)
        for loaded in self._running:
            try:
                loaded.controller.update(time_s, dt)
            except _SURVIVED as error:  # a controller is foreign code; the others continue
                # A client that waits for the end of a goal is told.
                with contextlib.suppress(*_SURVIVED):
                    loaded.controller.stopping(time_s)
                self._fail(loaded, "update", error)
        for loaded in self._idle:
            try:
                loaded.controller.idle(time_s)
            except _SURVIVED as error:
                self._idle = [other for other in self._idle if other is not loaded]
                self._log.error("controller '%s' failed in idle() with %s: %s; it is not called again before it runs"
                                % (loaded.name, type(error).__name__, error))
        if self._switch is not None:
            try:
                self._go_on_switching(self._switch, time_s)
            except _SURVIVED as error:  # a driver is user code, too
                self._give_up_switch(self._switch, error)

    def close(self) -> None:
        """Close all controllers and wake all waiting callers of a switch (the future is cancelled)."""
        self._closed = True
        if self._switch is not None:
            self._switch.future.cancel()
        self._switch, self._running, self._idle = None, [], []
        while self._loaded:
            self._close(self._loaded.popitem()[1])

    # -- inside -------------------------------------------------------------------------------------------------

    def _named(self, names: Iterable[str], strict: bool, purpose: str) -> list[Loaded]:
        found = []
        for name in names:
            loaded = self._loaded.get(name)
            if loaded is None and strict:
                raise Refused("cannot %s controller '%s': %s" % (purpose, name, self._unknown()))
            if loaded is not None and loaded not in found:
                found.append(loaded)
        return found

    def _unknown(self) -> str:
        return "no controller of this name is loaded; loaded are: %s" % (", ".join(self._loaded) or "none")

    @staticmethod
    def _check_conflicts(would_run: Iterable[Loaded]) -> None:
        users: dict[str, list[str]] = {}
        for loaded in would_run:
            for joint in loaded.commanded_joints:
                users.setdefault(joint, []).append(loaded.name)
        shared = {joint: names for joint, names in users.items() if len(names) > 1}
        if shared:
            raise Refused("resource conflict: %s" % "; ".join(
                "joint '%s' is claimed by %s" % (joint, " and ".join(names))
                for joint, names in sorted(shared.items())))

    def _go_on_switching(self, switch: _Switch, time_s: float) -> None:
        hardware = self.hardware
        if switch.began_s is None:
            switch.began_s = time_s
            hardware.do_switch(_claims(switch.new), _claims(switch.stop))
            for loaded in switch.stop:
                self._stop(loaded, time_s)
        timed_out = switch.timeout_s > 0.0 and time_s - switch.began_s > switch.timeout_s
        whole = None if switch.start_asap else hardware.switch_result()
        left = []
        for loaded in switch.start:
            result = whole or hardware.switch_result(loaded.controller.claims)
            if result is SwitchResult.DONE:
                self._start(loaded, time_s)
            elif result is SwitchResult.ERROR or timed_out:
                self._log.error("controller '%s' is not started: the hardware %s" % (
                    loaded.name, "reports an error" if result is SwitchResult.ERROR else
                    "did not get ready within %g s" % switch.timeout_s))
                self._set_state(loaded, ABORTED)
            else:
                self._set_state(loaded, WAITING)
                left.append(loaded)
        switch.start = left
        if not left:
            self._switch = None
            _finish(switch.future)

    def _give_up_switch(self, switch: _Switch, error: BaseException) -> None:
        self._switch = None
        text = "the hardware failed in changing controllers with %s: %s" % (type(error).__name__, error)
        self._log.error(text)
        for loaded in switch.start:
            if loaded.state != RUNNING:
                self._set_state(loaded, ABORTED)
        with contextlib.suppress(InvalidStateError):
            switch.future.set_exception(Refused(text))

    def _start(self, loaded: Loaded, time_s: float) -> None:
        try:
            self.hardware.let_go(loaded.controller.claims)
            loaded.controller.starting(time_s)
        except _SURVIVED as error:
            self._fail(loaded, "starting", error)
        else:
            self._set_state(loaded, RUNNING)

    def _stop(self, loaded: Loaded, time_s: float) -> None:
        try:
            loaded.controller.stopping(time_s)
        except _SURVIVED as error:
            self._fail(loaded, "stopping", error)
        else:
            self._set_state(loaded, STOPPED)

    def _fail(self, loaded: Loaded, where: str, error: BaseException) -> None:
        self._log.error("controller '%s' failed in %s() with %s: %s; it is stopped and its joints are held, the others "
                        "continue. It can be started again: rosservice call .../controller_manager/switch_controller"
                        % (loaded.name, where, type(error).__name__, error))
        self._set_state(loaded, ABORTED)
        try:
            self.hardware.hold(loaded.controller.claims)
        except _SURVIVED as held:
            self._log.error("the joints of controller '%s' cannot be held: %s: %s"
                            % (loaded.name, type(held).__name__, held))

    def _set_state(self, loaded: Loaded, state: str) -> None:
        loaded.state = state
        self._sort()

    def _sort(self) -> None:
        # Updates run in the order of loading.
        self._running = [loaded for loaded in self._loaded.values() if loaded.state == RUNNING]
        self._idle = [loaded for loaded in self._loaded.values()
                      if loaded.state != RUNNING and type(loaded.controller).idle is not Controller.idle]

    def _close(self, loaded: Loaded) -> None:
        try:
            loaded.controller.close()
        except _SURVIVED as error:
            self._log.error("controller '%s' failed in close() with %s: %s"
                            % (loaded.name, type(error).__name__, error))
        loaded.controller.context.close()


def _claims(controllers: Sequence[Loaded]) -> list[dict[str, list[str]]]:
    return [loaded.controller.claims for loaded in controllers]


def _names(controllers: Sequence[Loaded]) -> str:
    return ", ".join(loaded.name for loaded in controllers)


def _finish(future: Future[None]) -> None:
    # The caller may have cancelled it.
    with contextlib.suppress(InvalidStateError):
        future.set_result(None)
