# SPDX-License-Identifier: BSD-3-Clause
"""The weak set under the names that programs written for the SDK import; Python has had one of its own since 2.7."""
from weakref import WeakSet

WeakRefSet = WeakSet

__all__ = ["WeakRefSet", "WeakSet"]
