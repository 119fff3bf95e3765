# SPDX-License-Identifier: BSD-3-Clause
"""Maps the file name of a model plugin to its Python class."""
from __future__ import annotations

import importlib
import os
from typing import TYPE_CHECKING

import yaml

from gazebo_ros.model_plugin import ModelPlugin, PluginError

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from typing import Any


def _read(path: str | os.PathLike[str]) -> Any:
    with open(path, encoding="utf-8") as file:
        return yaml.safe_load(file) or {}


class PluginTable:
    """File name of a plugin -> ``"module:Class"``, imported when first asked for."""

    def __init__(self, entries: dict[str, str]) -> None:
        """``entries``: mapping of file names to "module:Class"; a wrong entry raises :class:`PluginError`."""
        if not isinstance(entries, dict):
            raise PluginError("the table of model plugins is %s, expected a mapping of file name to module:Class"
                              % type(entries).__name__)
        for filename, target in entries.items():
            if not isinstance(target, str) or target.count(":") != 1 or not all(target.split(":")):
                raise PluginError("model plugin %s: found %r, expected \"module:Class\"" % (filename, target))
        self._entries = dict(entries)
        self._classes: dict[str, type[ModelPlugin]] = {}

    @classmethod
    def from_yaml(cls, path: str | os.PathLike[str], extra: dict[str, str] | None = None,
                  others: Sequence[str | os.PathLike[str]] = (),
                  warn: Callable[[str], object] | None = None) -> PluginTable:
        """The table of a YAML file, with the entries of the mapping ``extra`` added or replaced. ``others``: further
        files, the first one of which counts; one that cannot be used is left out, after a call of ``warn(text)``, or
        raises :class:`PluginError` where there is no ``warn``."""
        entries = _read(path)
        for other in reversed(others):
            try:
                more = _read(other)
                cls(more)
            except (OSError, UnicodeDecodeError, yaml.YAMLError, PluginError) as error:
                if warn is None:
                    raise PluginError("%s: %s" % (other, error)) from error
                warn("%s is left out: %s" % (other, error))
            else:
                entries.update(more)
        if extra is not None and not isinstance(extra, dict):
            raise PluginError("~model_plugins is %r, expected a mapping of file name to module:Class" % (extra,))
        return cls({**entries, **(extra or {})})

    @property
    def known(self) -> list[str]:
        """Sorted file names."""
        return sorted(self._entries)

    def find(self, filename: str) -> type[ModelPlugin] | None:
        """The plugin class for ``<plugin filename=...>``, or None for a file name that is not in the table.

        A path in front of the file name does not count. An entry that cannot be imported, or that is no
        ``ModelPlugin``, raises :class:`PluginError`.
        """
        key = os.path.basename(filename)
        if key not in self._entries:
            return None
        if key not in self._classes:
            self._classes[key] = self._load(key, self._entries[key])
        return self._classes[key]

    @staticmethod
    def _load(key: str, target: str) -> type[ModelPlugin]:
        module_name, class_name = target.split(":")
        try:
            loaded = getattr(importlib.import_module(module_name), class_name)
        except (ImportError, AttributeError) as error:
            raise PluginError("model plugin %s: cannot load %s: %s" % (key, target, error)) from error
        if not (isinstance(loaded, type) and issubclass(loaded, ModelPlugin)):
            raise PluginError("model plugin %s: %s is not a subclass of gazebo_ros.model_plugin.ModelPlugin"
                              % (key, target))
        return loaded
