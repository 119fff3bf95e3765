# SPDX-License-Identifier: BSD-3-Clause
"""Names of topics and services, checked before they are opened. ROS-free."""
import re

# What roscpp takes, and thereby every other node; the ROS master cannot even read some of the rest.
_LEGAL = re.compile(r"(?:/[A-Za-z0-9_]+)+")
_SLASHES = re.compile("//+")


class IllegalName(ValueError):
    """A name that is none in ROS; the text says what was found and what is allowed."""


def checked_name(name: str) -> str:
    """The absolute name ``name`` of a topic, a service or a namespace, without slashes that are too many.

    Raises :class:`IllegalName`.
    """
    plain = _SLASHES.sub("/", name).removesuffix("/")
    if not _LEGAL.fullmatch(plain):
        raise IllegalName("%s is no name in ROS: letters from a to z, digits and _ are allowed between slashes"
                          % shown(name))
    return plain


def shown(text: str) -> str:
    """``text`` for a message: quoted, its beginning alone, and nothing in it that a terminal obeys."""
    return ascii(text if len(text) <= 100 else text[:100] + "...")
