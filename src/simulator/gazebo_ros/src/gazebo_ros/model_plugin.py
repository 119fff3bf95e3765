# SPDX-License-Identifier: BSD-3-Clause
"""The base class of model plugins. A URDF's ``<plugin filename="...">`` loads one into the world.

A plugin lives in the loop thread. It may use the context and the world in that thread only; other threads touch only
the subscriptions of the context. No call blocks: topics and services are registered with the ROS master by a thread of
their own, messages are sent without waiting.
"""
from __future__ import annotations

import contextlib
from typing import TYPE_CHECKING, NamedTuple, overload

import numpy as np

from loop_ros.node_handle import NodeHandle

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence
    from typing import Any, Self

    import numpy.typing as npt

    from bullet_sim import Model, World
    from loop_ros.protocol import Log, LoopRos
    from urdf_model import Robot
    from world_picture.shared_picture import NoPicture, PictureWriter


class PluginError(Exception):
    """A plugin cannot serve this model; the text says what was found and what would be right."""


class ModelPlugin:
    """Base class of all model plugins.

    Per tick the loop calls ``update`` of every plugin, makes one physics step, and calls ``publish`` of every plugin.
    Times are simulation seconds since the start of the world; ``dt`` is the length of a tick [s].
    A plugin that raises is restarted (``restarted``). The third time within 10 s it counts as failed: the loop calls
    ``hold``, and then ``while_failed`` in place of ``update`` and ``publish``, until a reset revives it. Messages that
    are taken with ``handle`` (see :meth:`PluginContext.queue`) do not cause this: a message whose handler raises is
    dropped.
    """

    #: Whether it only works with the tick length that it was made with; then the length cannot be changed.
    keeps_step = False
    #: Whether a model is not spawned when this plugin refuses it. If False, as for sensors, the plugin is left out,
    #: with a warning.
    required = True
    #: Whether its names begin with the model's where it has no ``robotNamespace`` and the model was spawned without a
    #: namespace or stands in a world file, as Gazebo's drive by two wheels has it.
    named_after_model = False
    #: Whether its names begin with the model's where its ``robotNamespace`` is empty. So it is for those above, too.
    named_if_empty = False

    @classmethod
    def spawn_options(cls, robot: Robot, element: Any) -> dict[str, Any]:
        """Keyword arguments for ``bullet_sim.World.spawn`` of a model with this plugin.

        Called before the model exists, with the ``urdf_model.Robot`` and the ``<plugin>`` element. A robot that is
        bolted to the floor answers ``{"static": True}``; one with its own self-collision table adds
        ``self_collision_pairs``, one with links that collide with nothing adds ``solids``, the argument of
        ``bullet_sim.solids.with_solids``, which is applied to the robot before it is spawned.

        Runs in a service thread (not in the loop), so slow work such as computing tables belongs here.
        """
        return {}

    def __init__(self, context: PluginContext) -> None:
        """Runs in the loop thread at spawn, after a start configuration (``spawn_model -J``) is in place.

        Raise :class:`PluginError` to refuse the model. ``context`` is a :class:`PluginContext`.
        """
        self.context = context

    def update(self, time_s: float, dt: float) -> None:
        """Before the physics step: read the state, command the drives. ``time_s`` is the time the step starts at."""

    def publish(self, time_s: float) -> None:
        """After the physics step: publish due messages. ``time_s`` is the time that the step reached."""

    def step_changed(self, step_s: float) -> None:
        """From the next tick on, a tick lasts ``step_s`` [s]; ``update`` gets it as ``dt``."""

    def joints_set(self) -> None:
        """A service has moved the model's joints (set_model_configuration); targets should follow, so that nothing
        moves until a new command comes.

        Messages that are in the queues now came before.
        """

    def reset(self) -> None:
        """The world was reset. After ``reset_simulation`` the next ``time_s`` is smaller."""

    def close(self) -> None:
        """The model is being deleted or the node ends. Topics and services of the context are closed after this."""

    # -- when it has raised ---------------------------------------------------------------------------------------

    def restarted(self) -> ModelPlugin:
        """Return the plugin that replaces this one after it raised. It must start no motion, and moving joints come to
        rest.

        By default: a new one of the same class, see :meth:`successor`.
        """
        return self.successor()

    def successor(self, *arguments: Any) -> Self:
        """Close this plugin; returns a new one of its class, made with the context and ``arguments``.

        It takes over topics and services of the same name and type, so that clients stay connected; the others are
        closed.
        """
        with contextlib.suppress(Exception):
            self.close()
        self.context.begin_restart()
        plugin = type(self)(self.context, *arguments)
        self.context.end_restart()
        return plugin

    def hold(self) -> None:
        """The plugin counts as failed: keep the joints that it drives where they are, by the simplest means."""

    def while_failed(self, time_s: float) -> bool:
        """Called in place of ``update`` and ``publish`` while it counts as failed; return True to be revived."""
        return False


def with_tf_prefix(parameters: dict[str, Any], namespace: str, name: str) -> str:
    """The frame ``name`` with the ``tf_prefix`` that a node in ``namespace`` finds among ``parameters`` (a tree)."""
    if name.startswith("/"):
        return name.lstrip("/")
    found, branch = "", parameters
    for part in (*namespace.strip("/").split("/"), ""):
        if not isinstance(branch, dict):
            break
        found = branch.get("tf_prefix", found)
        branch = branch.get(part)
    prefix = found.strip("/") if isinstance(found, str) else ""
    return "%s/%s" % (prefix, name) if prefix else name


class PluginSource(NamedTuple):
    """The place of a plugin in a description; :class:`PluginContext` documents the fields."""

    robot: Robot
    element: Any
    namespace: str = ""
    urdf_xml: str = ""


def _no_screen(link: str, *arguments: object) -> PictureWriter | NoPicture:
    raise PluginError("a screen is on link '%s', but nothing here shows screens" % link)


class PluginHost(NamedTuple):
    """The functions that :meth:`PluginContext.screen` and :meth:`PluginContext.plugins` call."""

    add_screen: Callable[[str, np.ndarray, Sequence[float], Sequence[int], bool, float],
                         PictureWriter | NoPicture] = _no_screen
    plugins: Callable[[], Iterable[ModelPlugin]] = tuple


_NO_HOST = PluginHost()


class PluginContext(NodeHandle):
    """The context of one plugin of one model: a :class:`loop_ros.node_handle.NodeHandle`, and its model.

    Attributes
    ----------
    world, model :
        ``bullet_sim.World`` and the ``bullet_sim.Model`` this plugin belongs to.
    robot :
        ``urdf_model.Robot`` of the model.
    element :
        The ``<plugin>`` element (ElementTree).
    namespace : str
        The plugin's ``robotNamespace``, absolute and without trailing slash ("" for the root namespace).
    urdf_xml : str
        The robot description as it was spawned.
    log :
        ``info``, ``warn``, ``error`` and ``*_throttle(period_s, text)``; never blocks the loop.
    """

    def __init__(self, world: World, model: Model, source: PluginSource, log: Log, ros: LoopRos,
                 parameters: dict[str, Any], host: PluginHost = _NO_HOST) -> None:
        """``ros``: as for a NodeHandle; ``parameters``: the tree of the parameter server at spawn time; ``source``:
        :class:`PluginSource`; ``host``: :class:`PluginHost`."""
        self.world = world
        self.model = model
        self.robot, self.element, self.urdf_xml = source.robot, source.element, source.urdf_xml
        super().__init__(ros, source.namespace)
        self.log = log
        self._parameters = parameters
        self._host = host

    def plugins(self) -> tuple[ModelPlugin, ...]:
        """Loop thread: the :class:`ModelPlugin` objects that the model has now, in the order of its description."""
        return tuple(self._host.plugins())

    def screen(self, link: str, place: npt.ArrayLike, size_m: Sequence[float], pixels: Sequence[int],
               glows: bool = False, radius_m: float = 0.0) -> PictureWriter | NoPicture:
        """Make a screen, a rectangle of the model that shows pictures; call it in the constructor.

        It is fixed to ``link`` at ``place`` (4, 4): the frame of its centre, with x to the right and y up for a viewer
        in front of it. ``size_m``: width and height; ``pixels``: columns and rows; ``glows``: for lights,
        whose black pixels show what is behind them; ``radius_m``: of the cylinder around which it is bent: ``place`` is
        then the frame of the cylinder's centre, y its axis, and the picture's middle is in the direction of z. Returns
        a :class:`world_picture.shared_picture.PictureWriter`, whose ``show(pixels)`` is for the loop.
        """
        # It belongs to the model and is closed with it.
        at = np.asarray(place, dtype=float)
        return self._opening(("screen", link, tuple(size_m), tuple(pixels)),
                             lambda: self._host.add_screen(link, at, size_m, pixels, glows, radius_m), closes=False)

    def param(self, name: str, default: Any = None) -> Any:
        """Value of a ROS parameter as it was when the model was spawned; relative names as in :meth:`resolve`."""
        branch = self._parameters
        for part in self.resolve(name).strip("/").split("/"):
            if not isinstance(branch, dict) or part not in branch:
                return default
            branch = branch[part]
        return branch

    def frame(self, name: str) -> str:
        """The frame ``name`` as messages have it: behind the parameter ``tf_prefix`` of the namespace, or of one above
        it, unless the name is absolute."""
        return with_tf_prefix(self._parameters, self.namespace, name)

    @overload
    def element_text(self, tag: str, default: str) -> str: ...

    @overload
    def element_text(self, tag: str, default: None = None) -> str | None: ...

    def element_text(self, tag: str, default: str | None = None) -> str | None:
        """Stripped text of a child of the ``<plugin>`` element, or ``default`` where it is missing or empty."""
        text = self.element.findtext(tag)
        return text.strip() if text and text.strip() else default
