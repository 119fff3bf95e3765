# SPDX-License-Identifier: BSD-3-Clause
"""The labs of a class: their states, and what to do next. Time comes in as an argument; no ROS, no processes."""
from __future__ import annotations

import enum
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

#: A lab that has not answered after this time has failed [s].
START_LIMIT_S = 180.0
#: A lab that fails this often, each time within STEADY_S of its start, waits for the instructor.
MAX_FAILURES = 3
STEADY_S = 60.0
#: Where memory is short, labs that nobody has visited give theirs to those with a visitor, one in this time [s].
HAND_OVER_S = 15.0


class ClassLabState(enum.Enum):
    """Of a lab. The value is the word that people see."""

    STOPPED = "stopped"
    WAITING = "waiting"
    STARTING = "starting"
    RUNNING = "running"
    PAUSED = "paused"
    FAILED = "failed"


class Role(enum.Enum):
    """Of a client at the front door."""

    INSTRUCTOR = "instructor"
    STUDENT = "student"
    VIEWER = "viewer"


class Kind(enum.Enum):
    """Of a connection to a lab: an answer that is under way, a page that is open, another WebSocket."""

    ANSWER = "answer"
    PAGE = "page"
    SOCKET = "socket"


class Action(enum.Enum):
    """The supervisor's next action on a lab."""

    START = "start"
    PAUSE = "pause"
    WAKE = "wake"
    END = "end"
    KILL = "kill"


class ClassError(Exception):
    """Something that cannot be done; the text says why."""


@dataclass
class ClassLab:
    """One lab; times are of the clock that the caller passes in [s]. ``busy``: answers that are under way;
    ``sockets``: open WebSockets, of which ``pages`` are the lab's page; ``visited``: a client has asked since the lab
    was told to start; ``settled``: it has finished starting, of which its first answer is only a part."""

    name: str
    state: ClassLabState = ClassLabState.STOPPED
    since: float = 0.0
    used: float = 0.0
    busy: int = 0
    sockets: int = 0
    pages: int = 0
    reason: str = ""
    failures: int = 0
    asked: bool = field(default=False, repr=False)
    visited: bool = False
    settled: bool = False

    @property
    def is_starting(self) -> bool:
        """Whether it takes the place of one of those that start at a time."""
        return self.state is ClassLabState.STARTING or (self.state is ClassLabState.RUNNING and not self.settled)

    @property
    def has_processes(self) -> bool:
        return self.state in (ClassLabState.STARTING, ClassLabState.RUNNING, ClassLabState.PAUSED)


class Labs:
    """All labs of a class. Methods return the actions to take now: a list of (Action, name)."""

    def __init__(self, names: list[str], at_once: int, idle_s: float | None, keep_running: bool = False) -> None:
        """names: in the order of the roster; at_once: labs that may start at a time; idle_s: a lab without a client for
        so long is paused [s], or None; keep_running: else a lab that had no client yet is paused when it has settled,
        unless idle_s is None."""
        self._labs = {name: ClassLab(name) for name in names}
        self._at_once, self._idle_s = at_once, idle_s
        self._waits_paused = idle_s is not None and not keep_running
        self._handed_over = -HAND_OVER_S

    def __iter__(self) -> Iterator[ClassLab]:
        return iter(self._labs.values())

    def __getitem__(self, name: str) -> ClassLab:
        if name not in self._labs:
            raise ClassError("there is no lab %s; there are: %s" % (name, ", ".join(self._labs)))
        return self._labs[name]

    def __contains__(self, name: str) -> bool:
        return name in self._labs

    def place_in_line(self, name: str) -> int:
        """How many labs start before this one, which is waiting."""
        return [lab.name for lab in self._line()].index(name)

    def start(self, name: str, now: float) -> list[Any]:
        """The instructor, or the beginning of the class, wants this lab."""
        lab = self[name]
        if lab.state is ClassLabState.PAUSED:
            return self._wake(lab, now)
        if lab.state in (ClassLabState.STOPPED, ClassLabState.FAILED):
            lab.failures = 0
            self._enter_line(lab, now)
        return []

    def stop(self, name: str, now: float) -> list[tuple[Action, str]]:
        """The instructor ends this lab."""
        lab = self[name]
        had_processes = lab.has_processes
        self._set(lab, ClassLabState.STOPPED, now)
        return [(Action.END, name)] if had_processes else []

    def pause(self, name: str, now: float) -> list[tuple[Action, str]]:
        """Raises ClassError unless the lab is running."""
        lab = self[name]
        if lab.state is ClassLabState.PAUSED:
            return []
        if lab.state is not ClassLabState.RUNNING:
            raise ClassError("the lab %s is %s; only a running lab can be paused" % (name, lab.state.value))
        # When it goes on, nobody waits for the end of its start any more.
        lab.settled = True
        self._set(lab, ClassLabState.PAUSED, now)
        return [(Action.PAUSE, name)]

    def request(self, name: str, now: float) -> list[tuple[Action, str]]:
        """A client with a token asks this lab for something."""
        lab = self[name]
        lab.used = now
        if lab.state is ClassLabState.PAUSED:
            return self._wake(lab, now)
        if lab.state is ClassLabState.FAILED and lab.failures < MAX_FAILURES:
            self._enter_line(lab, now)
        lab.asked = lab.state is ClassLabState.WAITING
        lab.visited = True
        return []

    def serving(self, name: str, kind: Kind, by: int, now: float) -> None:
        """The number of connections of one Kind changes ``by`` 1 or -1. An open page alone keeps no lab awake."""
        lab = self[name]
        if kind is Kind.ANSWER:
            lab.busy += by
            lab.used = now
        else:
            lab.sockets += by
            lab.pages += by * (kind is Kind.PAGE)

    def answered(self, name: str, now: float) -> None:
        """A lab that was starting answers requests."""
        lab = self[name]
        if lab.state is ClassLabState.STARTING:
            self._set(lab, ClassLabState.RUNNING, now)
            lab.used = now

    def has_settled(self, name: str, now: float) -> list[tuple[Action, str]]:
        """A lab that answers has finished starting: it waits for its first client, paused."""
        lab = self[name]
        if not lab.is_starting:
            return []
        lab.settled = True
        return self.pause(name, now) if self._waits_paused and not (lab.visited or lab.busy or lab.sockets) else []

    def ended(self, name: str, reason: str, now: float) -> list[tuple[Action, str]]:
        """The processes of a lab have ended by themselves; those of a stopped lab are expected to."""
        lab = self[name]
        return self._fail(lab, reason, now) if lab.has_processes else []

    def exceeded(self, name: str, reason: str, now: float) -> list[tuple[Action, str]]:
        """A lab is over one of its limits: it is ended at once, and the instructor decides."""
        self._fail(self[name], reason, now)
        self[name].failures = MAX_FAILURES
        return [(Action.KILL, name)]

    def due(self, now: float, shortage: str = "") -> list[tuple[Action, str]]:
        """Whatever time brings: the next starts, labs to be paused, starts that take too long.

        shortage: why no further lab should start beside those that have started, or "".
        """
        actions = []
        for lab in self:
            if lab.state is ClassLabState.STARTING and now - lab.since > START_LIMIT_S:
                actions += self._fail(lab, "it did not answer within %d s" % START_LIMIT_S, now)
            elif (lab.state is ClassLabState.RUNNING and self._idle_s is not None and not lab.busy
                  and now - lab.used > self._idle_s):
                actions += self.pause(lab.name, now)
        starting = sum(lab.is_starting for lab in self)
        for lab in self._line():
            # What those that are starting need is seen when they have started.
            lab.reason = "" if starting else shortage
        if shortage and any(lab.has_processes for lab in self):
            return actions + self._hand_over(now)
        for lab in self._line()[:max(0, self._at_once - starting)]:
            self._set(lab, ClassLabState.STARTING, now)
            actions.append((Action.START, lab.name))
        return actions

    def _hand_over(self, now: float) -> list[tuple[Action, str]]:
        """A paused lab that nobody has visited ends, and waits, where another one has a visitor and may not start."""
        unused = [lab for lab in self if lab.state is ClassLabState.PAUSED and not lab.visited]
        if not unused or not any(lab.asked for lab in self._line()) or now - self._handed_over < HAND_OVER_S:
            return []
        self._handed_over = now
        self._enter_line(unused[-1], now)
        return [(Action.END, unused[-1].name)]

    def _line(self) -> list[ClassLab]:
        """Waiting labs: those with a waiting client first, then in the order of the roster."""
        return sorted((lab for lab in self if lab.state is ClassLabState.WAITING), key=lambda lab: not lab.asked)

    def _enter_line(self, lab: ClassLab, now: float) -> None:
        lab.visited = lab.settled = False
        self._set(lab, ClassLabState.WAITING, now)

    def _wake(self, lab: ClassLab, now: float) -> list[tuple[Action, str]]:
        self._set(lab, ClassLabState.RUNNING, now)
        lab.used = now
        return [(Action.WAKE, lab.name)]

    def _fail(self, lab: ClassLab, reason: str, now: float) -> list[tuple[Action, str]]:
        lab.failures = 1 if lab.state is ClassLabState.RUNNING and now - lab.since > STEADY_S else lab.failures + 1
        self._set(lab, ClassLabState.FAILED, now, reason)
        return [(Action.END, lab.name)]

    @staticmethod
    def _set(lab: ClassLab, state: ClassLabState, now: float, reason: str = "") -> None:
        lab.state, lab.since, lab.reason, lab.asked = state, now, reason, False


#: What each role may do at the front door: "use" a lab that is its own, "watch" one, "see" and "change" the class.
RIGHTS = {Role.INSTRUCTOR: ("see", "change"), Role.STUDENT: ("use", "watch"), Role.VIEWER: ("watch",)}


def may(role: Role | None, right: str) -> bool:
    """Whether a role (None: no valid token) has a right."""
    return role is not None and right in RIGHTS[role]
