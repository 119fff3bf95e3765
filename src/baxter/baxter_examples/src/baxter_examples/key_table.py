# SPDX-License-Identifier: BSD-3-Clause
"""Keys (or joystick controls) with their actions, and the help that lists them. No ROS needed."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any


class KeyTable:
    """Actions by key; `add` them, then `press` keys. Every other key, and `?`, shows the help."""

    def __init__(self, title: str, show: Callable[[Any], None] = print) -> None:
        self._title = title
        self._show = show
        self._actions = {}

    def add(self, key: str, text: str, action: Callable[..., Any], *arguments: object) -> None:
        """Let `key` call `action(*arguments)`; `text` describes it. Raises ValueError for a key in use."""
        if key in self._actions:
            raise ValueError("the key %r is in use for: %s" % (key, self._actions[key][0]))
        self._actions[key] = (text, action, arguments)

    def press(self, key: str) -> None:
        """Execute the action of `key`, and print it."""
        if key not in self._actions:
            self._show(self.help())
            return
        text, action, arguments = self._actions[key]
        self._show(text)
        action(*arguments)

    def help(self) -> str:
        """Return the list of keys as text."""
        width = max((len(key) for key in self._actions), default=1)
        lines = ["  %s: %s" % (key.ljust(width), text) for key, (text, _, _) in self._actions.items()]
        return "\n".join([self._title, *lines])
