# SPDX-License-Identifier: BSD-3-Clause
"""One finding of the doctor."""

from dataclasses import dataclass
from enum import Enum


class Level(Enum):
    OK = "ok"
    NOTE = "note"
    BUSY = "busy"
    WRONG = "WRONG"


@dataclass(frozen=True)
class Finding:
    """A finding; fix is the command to type, empty if nothing is wrong."""

    topic: str
    level: Level
    what: str
    fix: str = ""
