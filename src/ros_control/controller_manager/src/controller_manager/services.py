# SPDX-License-Identifier: BSD-3-Clause
"""The services of a controller manager: each request in a separate thread, the work in the loop's."""
from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable, Iterable
from concurrent.futures import CancelledError
from concurrent.futures import TimeoutError as FutureTimeout
from typing import Any

import rosgraph
import rospy
from controller_manager_msgs.msg import ControllerState, HardwareInterfaceResources
from controller_manager_msgs.srv import (
    ListControllers,
    ListControllersResponse,
    ListControllerTypes,
    ListControllerTypesResponse,
    LoadController,
    LoadControllerResponse,
    ReloadControllerLibraries,
    ReloadControllerLibrariesResponse,
    SwitchController,
    SwitchControllerResponse,
    UnloadController,
    UnloadControllerResponse,
)

from controller_manager.controller import ControllerContext
from controller_manager.controller_table import ControllerTable
from controller_manager.errors import ControlError, Refused
from controller_manager.manager import BEST_EFFORT, ControllerManager

BASE_CLASS = "controller_interface::ControllerBase"
# Additional time beyond a switch's own limit that its caller may wait [wall s].
_GRACE_S = 1.0


class ControllerManagerServices:
    """Serves ``<namespace>/controller_manager/...``, changes one after the other.

    A switch ends with an update of the loop; while physics is paused it waits for one, and later changes wait behind
    it. Listing does not wait, and shows controllers that wait.
    """

    def __init__(self, manager: ControllerManager, find_table: Callable[[], ControllerTable], host: Any,
                 robot: Any) -> None:
        """``host``: a ``loop_ros.node_handle.NodeHandle`` that has a ``log`` too. ``find_table()`` ->
        :class:`ControllerTable`, called at each request, from any thread. ``robot``: the ``urdf_model.Robot`` for
        controllers."""
        self._manager = manager
        self._find_table = find_table
        self._host = host
        self._robot = robot
        self._log = host.log
        self._closed = False
        self._one_at_a_time = threading.Lock()
        for name, srv_class, handler, changes in (
                ("list_controllers", ListControllers, self._list, False),
                ("list_controller_types", ListControllerTypes, self._list_types, False),
                ("load_controller", LoadController, self._load, True),
                ("unload_controller", UnloadController, self._unload, True),
                ("switch_controller", SwitchController, self._switch, True),
                ("reload_controller_libraries", ReloadControllerLibraries, self._reload, True)):
            turn = self._one_at_a_time if changes else contextlib.nullcontext()
            host.service_in_thread("controller_manager/" + name, srv_class, self._guarded(handler, turn))

    def close(self) -> None:
        """Loop thread: refuse new requests and wake all waiting callers."""
        self._closed = True
        self._manager.close()

    def _guarded(self, handler: Callable[[Any], Any],
                 turn: contextlib.AbstractContextManager[Any]) -> Callable[[Any], Any]:
        def answer(request: Any) -> Any:
            with turn:
                if self._closed:
                    raise rospy.ServiceException("the controller manager of this robot has ended")
                try:
                    return handler(request)
                except CancelledError:
                    raise rospy.ServiceException("the controller manager ended before it could answer") from None

        return answer

    def _in_loop(self, function: Callable[..., Any], *arguments: Any) -> Any:
        return self._host.call_in_loop(function, *arguments)

    def _succeeds(self, function: Callable[..., Any], *arguments: Any) -> bool:
        """Call and return True, or log the refusal and return False."""
        try:
            function(*arguments)
        except ControlError as error:
            self._log.error("%s/controller_manager: %s" % (self._host.namespace, error))
            return False
        return True

    # -- one method per service; these run in threads -------------------------------------------------------------

    def _list(self, _: Any) -> ListControllersResponse:
        return ListControllersResponse(self._in_loop(self._states))

    def _list_types(self, _: Any) -> ListControllerTypesResponse:
        try:
            types = self._find_table().types
        except ControlError as error:
            raise rospy.ServiceException(str(error)) from error
        return ListControllerTypesResponse(types, [BASE_CLASS] * len(types))

    def _load(self, request: Any) -> LoadControllerResponse:
        return LoadControllerResponse(self._succeeds(self._do_load, request.name))

    def _unload(self, request: Any) -> UnloadControllerResponse:
        return UnloadControllerResponse(self._succeeds(self._do_unload, request.name))

    def _switch(self, request: Any) -> SwitchControllerResponse:
        return SwitchControllerResponse(self._succeeds(
            self._do_switch, request.start_controllers, request.stop_controllers, request.strictness,
            request.start_asap, request.timeout))

    def _reload(self, request: Any) -> ReloadControllerLibrariesResponse:
        return ReloadControllerLibrariesResponse(self._succeeds(self._do_reload, request.force_kill))

    # -- the work of the services ------------------------------------------------------------------------------------

    def _states(self) -> list[ControllerState]:
        return [ControllerState(loaded.name, loaded.state, loaded.kind,
                                [HardwareInterfaceResources(*claim) for claim in loaded.claimed_resources])
                for loaded in self._manager.loaded]

    def _do_load(self, name: str) -> None:
        host, manager = self._host, self._manager
        self._in_loop(manager.check_free, name)
        context = ControllerContext(name, host.namespace, _parameters(host.namespace), host.branch(), self._log,
                                    self._robot)
        kind = context.param("type")
        if not isinstance(kind, str) or not kind:
            found = "is missing" if kind is None else "is %r" % (kind,)
            raise Refused("cannot load controller '%s': parameter %s %s; give the controller's type, e.g. "
                          "position_controllers/JointTrajectoryController (has its YAML file been loaded, in this "
                          "namespace?)" % (name, context.resolve("type"), found))
        try:
            # Importing is slow, so it happens outside of the loop.
            controller_class = self._find_table().find(kind)
        except ControlError as error:
            raise Refused("cannot load controller '%s': %s" % (name, error)) from error
        self._in_loop(manager.load, name, kind, controller_class, context)
        host.flush()

    def _do_unload(self, name: str) -> None:
        self._in_loop(self._manager.unload, name)

    def _do_switch(self, start: Iterable[str], stop: Iterable[str], strictness: int, start_asap: bool,
                   timeout_s: float) -> None:
        future = self._in_loop(self._manager.switch, start, stop, strictness, start_asap, timeout_s)
        try:
            future.result(min(timeout_s + _GRACE_S, threading.TIMEOUT_MAX) if timeout_s > 0.0 else None)
        except FutureTimeout:
            with contextlib.suppress(CancelledError):
                self._in_loop(self._manager.abandon_switch, future)
            raise Refused("the switch was given up after %g s: the control loop does not run (is physics paused?) or "
                          "the hardware is not ready" % (timeout_s + _GRACE_S)) from None

    def _do_reload(self, force_kill: bool) -> None:
        names = [state.name for state in self._in_loop(self._states)]
        if names and not force_kill:
            raise Refused("cannot reload the controller libraries: %s are loaded; unload them first or set force_kill"
                          % ", ".join(names))
        if names:
            self._do_switch([], names, BEST_EFFORT, False, 0.0)
        for name in names:
            self._do_unload(name)
        try:
            self._find_table().reload()
        except Exception as error:  # noqa: BLE001  (user code)
            raise Refused("cannot reload the controller libraries: %s: %s" % (type(error).__name__, error)) from error


def _parameters(namespace: str) -> Any:
    # Read from the master itself: rospy answers "/" from a cache that is nearly empty once the node has logged.
    try:
        return rosgraph.Master(rospy.get_name()).getParam(namespace or "/")
    except rosgraph.MasterError:
        return {}
