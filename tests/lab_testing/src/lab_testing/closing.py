# SPDX-License-Identifier: BSD-3-Clause
"""Things that tests make and that are closed after them."""
from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from typing import Any


@contextlib.contextmanager
def factory(kind: Callable[..., Any], *parts: str) -> Iterator[Callable[..., Any]]:
    """A function that calls ``kind``; in the end, ``parts`` of all that it has made are closed, in this order."""
    made = []

    def make(*arguments: Any, **options: Any) -> Any:
        made.append(kind(*arguments, **options))
        return made[-1]

    yield make
    for each in made:
        for part in parts:
            getattr(each, part).close()
