# SPDX-License-Identifier: BSD-3-Clause
"""Errors for a client whose request cannot be served."""

from __future__ import annotations

from typing import Any


class BridgeError(ValueError):
    """The root of this package's errors; the text is a sentence for the client."""


class FrameError(BridgeError):
    """A frame that holds no operation."""


class FieldError(BridgeError):
    """A field of an operation or of a message with a wrong name, type or value."""


class UnknownType(BridgeError):
    """A message or service type that this machine does not have."""


class RequestForbidden(BridgeError):
    """A request that the server's rules forbid."""


class NoSuchTopic(BridgeError):
    """A topic whose type nobody has said."""


class ServiceFailed(BridgeError):
    """A service that is not there, or that answered with an error."""


def shown(value: Any, length: int = 60) -> str:
    """A value as an error text quotes it: its repr, cut to ``length`` characters."""
    text = repr(value[:length] if isinstance(value, str | bytes | list) else value)
    return text if len(text) <= length else text[:length] + "…"
