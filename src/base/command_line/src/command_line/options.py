# SPDX-License-Identifier: BSD-3-Clause
"""Words on command lines: types for argparse that refuse numbers with which a program cannot compute, the name that a
slip may have meant, and numbers of things in answers. Free of ROS."""
from __future__ import annotations

import argparse
import difflib
import math
import re
from collections.abc import Callable, Iterable
from typing import NoReturn

#: Longest time that a program is told to wait or to run [s], thirty years; Python's own limit ends in a traceback.
MAX_SECONDS = 1e9
#: Most processes at a time.
MAX_WORKERS = 1000
#: Largest seed or serial number, as tables of results have room for.
MAX_SEED = 2**63 - 1


def number(kind: type, least: float, most: float, *, above: bool = False) -> Callable[[str], float]:
    """Return an argparse type: numbers of ``kind``, int or float, from ``least`` to ``most``; ``above``: without
    ``least`` itself. NaN is refused, and so are infinite ones unless a bound is. What it returns raises
    ArgumentTypeError, which says what was expected and found."""
    whole = "a whole number" if kind is int else "a number"
    expected = "%s %s %.12g, at most %.12g" % (whole, "above" if above else "from", least, most)

    def convert(text: str) -> float:
        try:
            value = kind(text)
        except ValueError:
            value = math.nan
        if not least <= value <= most or (above and value == least):
            raise argparse.ArgumentTypeError("expected %s, not %.60s" % (expected, text or "nothing"))
        return value
    return convert


def seconds(least: float = 0.0) -> Callable[[str], float]:
    """As :func:`number`: a time [s] above ``least``."""
    return number(float, least, MAX_SECONDS, above=True)


def did_you_mean(word: str, names: Iterable[str]) -> str:
    """Return a question for the name that is most like ``word``, to be put behind an error; "" if none is."""
    near = difflib.get_close_matches(word, list(names), 1)
    return "; did you mean %s?" % near[0] if near else ""


class Parser(argparse.ArgumentParser):
    """A parser of command lines whose errors ask for the choice or the option that a slip may have meant."""

    def error(self, message: str) -> NoReturn:
        super().error(message + self.meant(message))

    def meant(self, message: str) -> str:
        """The question behind an error of argparse, "" where nothing is like what was found."""
        if match := re.search(r"invalid choice: '(.*)' \(choose from (.*)\)", message):
            return did_you_mean(match[1], re.findall(r"[\w.:-]+", match[2]))
        if match := re.search(r"unrecognized arguments: (--[\w-]+)", message):
            return did_you_mean(match[1], re.findall(r"--[\w-]+", self.format_help()))
        return ""


def counted(count: int, noun: str, plural: str = "") -> str:
    """Return "1 row" or "2 rows"; ``plural``: where it is not the noun with an s, as in 2 stretches."""
    return "%d %s" % (count, noun if count == 1 else plural or noun + "s")
