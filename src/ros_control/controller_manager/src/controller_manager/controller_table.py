# SPDX-License-Identifier: BSD-3-Clause
"""Maps the ``type`` of a controller to its Python class. ROS-free."""
from __future__ import annotations

import importlib
from collections.abc import Mapping
from types import ModuleType
from typing import Any

from .controller import Controller
from .errors import ControllerError


class ControllerTable:
    """Type string, such as ``position_controllers/JointPositionController`` -> ``"module:Class"``."""

    def __init__(self, entries: Mapping[str, Any]) -> None:
        """``entries``: mapping; a wrong entry raises only when it is used."""
        self._entries = dict(entries)
        self._modules: dict[str, ModuleType] = {}

    @property
    def types(self) -> list[str]:
        """Sorted type strings."""
        return sorted(self._entries)

    def find(self, kind: str) -> type[Controller]:
        """The class for a type; raises :class:`ControllerError` for unknown types and entries that do not load."""
        if kind not in self._entries:
            raise ControllerError("controller type '%s' is not known; known types: %s" % (kind, ", ".join(self.types)))
        target = self._entries[kind]
        if not isinstance(target, str) or target.count(":") != 1 or not all(target.split(":")):
            raise ControllerError('controller type %s: the table has %r, expected "module:Class"' % (kind, target))
        module_name, class_name = target.split(":")
        try:
            module = self._modules.get(module_name) or importlib.import_module(module_name)
            found = getattr(module, class_name)
        except (ImportError, AttributeError, SyntaxError) as error:
            raise ControllerError("controller type %s: cannot load %s: %s"
                                  % (kind, target, error)) from error
        if not (isinstance(found, type) and issubclass(found, Controller)):
            raise ControllerError("controller type %s: %s is not a subclass of controller_manager.Controller"
                                  % (kind, target))
        self._modules[module_name] = module
        return found

    def reload(self) -> None:
        """Reload all modules used so far, so that changed source takes effect."""
        for name, module in list(self._modules.items()):
            self._modules[name] = importlib.reload(module)
