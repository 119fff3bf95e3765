# SPDX-License-Identifier: BSD-3-Clause
"""xacro, for pyright: src/base/xacro puts the installed engine, which says nothing of its types, in its own place."""

from collections.abc import Mapping
from xml.dom.minidom import Document

def process_file(input_file_name: str, *, mappings: Mapping[str, str] | None = None) -> Document: ...
def main() -> None: ...
