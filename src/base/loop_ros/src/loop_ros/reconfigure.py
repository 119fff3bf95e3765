# SPDX-License-Identifier: BSD-3-Clause
"""Settings that can be changed at run time, over the topics and the service of dynamic_reconfigure.

Nothing here waits and nothing starts a thread: requests are answered in the loop's thread, messages go out through
publishers that do not block.
"""
from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, Protocol

import rospy
from dynamic_reconfigure.msg import (
    BoolParameter,
    Config,
    ConfigDescription,
    DoubleParameter,
    Group,
    GroupState,
    IntParameter,
    ParamDescription,
)
from dynamic_reconfigure.srv import Reconfigure, ReconfigureResponse

__all__ = ["Setting", "SettingsServer"]

# Type of a value -> the type's name, its field in Config, its message class.
_KINDS = {bool: ("bool", "bools", BoolParameter), int: ("int", "ints", IntParameter),
          float: ("double", "doubles", DoubleParameter)}
# All settings are in one group.
_GROUP = "Default"


@dataclass(frozen=True)
class Setting:
    """One number or switch: the type of its initial ``value`` decides which (bool, int or float).

    ``low``, ``high``: the range of a number. ``meaning``: in words, with the unit.
    """

    name: str
    value: bool | int | float
    low: bool | int | float = False
    high: bool | int | float = True
    meaning: str = ""

    @property
    def kind(self) -> type:
        return type(self.value)

    def checked(self, value: Any) -> Any:
        """``value`` clamped to the range; raises ``ValueError`` if it is not finite."""
        if not math.isfinite(value):
            raise ValueError("%s is %s, expected a finite number" % (self.name, value))
        return value if self.kind is bool else min(max(value, self.low), self.high)


class Sender(Protocol):
    """A publisher of settings."""

    def publish(self, message: Any) -> object:
        """Send ``message`` to all subscribers."""


class SettingsTopics(Protocol):
    """The part of :class:`loop_ros.protocol.Topics` that settings need."""

    def publisher(self, topic: str, msg_class: type, latch: bool) -> Sender:
        """Publish ``topic``."""
        ...

    def service(self, name: str, srv_class: type, handler: Callable[[Any], Any]) -> object:
        """Serve ``name``."""


class SettingsServer:
    """Serves the settings of one name. Every method belongs to the loop's thread."""

    def __init__(self, topics: SettingsTopics, name: str, settings: Iterable[Setting],
                 apply: Callable[[dict[str, Any]], object]) -> None:
        """Open ``<name>/set_parameters``, ``<name>/parameter_descriptions`` and ``<name>/parameter_updates``.

        ``settings``: list of :class:`Setting`. ``apply(values)`` gets {name: value} of all of them when a client
        changes some; it may raise ``ValueError`` to refuse.
        """
        self._name = name
        self._settings = {setting.name: setting for setting in settings}
        self._apply = apply
        self.values = {setting.name: setting.value for setting in settings}
        self._updates = topics.publisher(name + "/parameter_updates", Config, latch=True)
        topics.publisher(name + "/parameter_descriptions", ConfigDescription, latch=True).publish(self._description())
        topics.service(name + "/set_parameters", Reconfigure, self._answer)
        self._updates.publish(self._config(self.values))

    def show(self, **values: Any) -> None:
        """Publish values that did not change through the service."""
        if any(self.values[name] != value for name, value in values.items()):
            self.values.update(values)
            self._updates.publish(self._config(self.values))

    # -- inside -------------------------------------------------------------------------------------------------

    def _answer(self, request: Any) -> ReconfigureResponse:
        values = dict(self.values)
        try:
            for kind, (_, field, _) in _KINDS.items():
                for entry in getattr(request.config, field):
                    values[entry.name] = self._setting(entry.name, kind).checked(entry.value)
            for entry in request.config.strs:
                self._setting(entry.name, str)
            self._apply(dict(values))
        except ValueError as error:
            raise rospy.ServiceException("%s: %s" % (self._name, error)) from error
        self.show(**values)
        return ReconfigureResponse(self._config(self.values))

    def _setting(self, name: str, kind: type) -> Setting:
        setting = self._settings.get(name)
        if setting is None:
            raise ValueError("there is no setting '%s'; settings: %s" % (name, ", ".join(self._settings)))
        if setting.kind is not kind:
            raise ValueError("%s is a %s, not a %s" % (name, _KINDS[setting.kind][0], _KINDS.get(kind, ("str",))[0]))
        return setting

    def _config(self, values: dict[str, Any]) -> Config:
        config = Config(groups=[GroupState(_GROUP, True, 0, 0)])
        for name, value in values.items():
            _, field, message = _KINDS[self._settings[name].kind]
            getattr(config, field).append(message(name, value))
        return config

    def _description(self) -> ConfigDescription:
        settings = self._settings.values()
        parameters = [ParamDescription(setting.name, _KINDS[setting.kind][0], 0, setting.meaning, "")
                      for setting in settings]
        return ConfigDescription([Group(_GROUP, "", parameters, 0, 0)], *(
            self._config({setting.name: getattr(setting, what) for setting in settings})
            for what in ("high", "low", "value")))
