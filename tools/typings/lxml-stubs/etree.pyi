# SPDX-License-Identifier: BSD-3-Clause
"""lxml.etree, for pyright: it is compiled, and says nothing of its types."""

from typing import Any

def __getattr__(name: str) -> Any: ...
