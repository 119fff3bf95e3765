# SPDX-License-Identifier: BSD-3-Clause
"""Nodes and roslaunch start without what they do not use.

roslib imports catkin's search for packages, and with it a library for grammars, though few programs search; by way of
rosclean, which looks for the program ``du``, roslaunch imports setuptools, as much as all the rest of it. A launch
searches the workspace three times, and each node once, for the last place that settings of its log may be in.
"""
from __future__ import annotations

import functools
import importlib
import os
import shutil
import sys
import time
import types
from collections.abc import Callable
from typing import Any

_SEARCH = "catkin.find_in_workspaces"
_LOG_SETTINGS = "ROS_PYTHON_LOG_CONFIG_FILE"
# How long a search for packages counts [s]: as long as a launch reads its files and starts its nodes. A user makes a
# package while a notebook goes on.
_REMEMBERED_S = 5.0


def amend(module: Any) -> None:
    """Called when catkin, rosgraph.roslogging or roslaunch.config has been loaded; the modules in question are imported
    after these."""
    if module.__name__ == "catkin":
        _search_later(module)
    elif module.__name__ == "rosgraph.roslogging":
        module.configure_logging = with_settings_found(module.configure_logging, module.rospkg)
    else:
        _import_rosclean()


def _search_later(catkin: Any) -> None:
    if _SEARCH in sys.modules:
        return

    def find_in_workspaces(*args, **kwargs):
        return _search().find_in_workspaces(*args, **kwargs)

    def of_the_search(name):
        if name.startswith("__"):
            raise AttributeError(name)
        return getattr(_search(), name)

    later: Any = types.ModuleType(_SEARCH)
    later.find_in_workspaces, later.__getattr__ = find_in_workspaces, of_the_search
    sys.modules[_SEARCH] = catkin.find_in_workspaces = later


@functools.cache
def _search() -> Any:
    """The module itself."""
    sys.modules.pop(_SEARCH, None)
    search: Any = importlib.import_module(_SEARCH)
    search.find_packages = remembering(search.find_packages)
    return search


def remembering(find: Callable, clock: Callable[[], float] = time.monotonic) -> Callable:
    """``find(path)``, which counts for some seconds. ``clock()`` [s]: replaceable for tests."""
    found = {}  # {path: (time, result)}

    @functools.wraps(find)
    def find_packages(path, *args, **kwargs):
        if args or kwargs:
            return find(path, *args, **kwargs)
        if path not in found or clock() - found[path][0] > _REMEMBERED_S:
            packages = find(path)
            found[path] = clock(), packages
        return found[path][1]

    return find_packages


def with_settings_found(configure: Callable, rospkg: Any) -> Callable:
    """rosgraph's ``configure``, without a search for the package rosgraph where the user or the system has settings."""
    @functools.wraps(configure)
    def configure_logging(*args, **kwargs):
        if not os.environ.get(_LOG_SETTINGS):
            folders = os.path.join(rospkg.get_ros_home(), "config"), rospkg.get_etc_ros_dir()
            files = (os.path.join(folder, name) for folder in folders
                     for name in ("python_logging.conf", "python_logging.yaml"))
            found = next(filter(os.path.isfile, files), None)
            if found:
                os.environ[_LOG_SETTINGS] = found
                try:
                    return configure(*args, **kwargs)
                finally:
                    os.environ.pop(_LOG_SETTINGS, None)  # children look for themselves
        return configure(*args, **kwargs)

    return configure_logging


def _import_rosclean() -> None:
    names = "distutils", "distutils.spawn"
    if any(name in sys.modules for name in names):
        return
    modules: Any = [types.ModuleType(name) for name in names]
    package, spawn = modules
    spawn.find_executable = shutil.which
    sys.modules.update(zip(names, (package, spawn), strict=True))
    try:
        importlib.import_module("rosclean")
    finally:
        for name in names:
            sys.modules.pop(name, None)
