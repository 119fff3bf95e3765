# SPDX-License-Identifier: BSD-3-Clause
"""How much of a physical robot's interface is here, for pages: compared when a page asks. No ROS: what reads the
master is an argument.
"""
from __future__ import annotations

from typing import TYPE_CHECKING

from baxter_conformance.comparison import Verdict, compare, scores, totals
from lab_web.lab import RobotError

if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from baxter_conformance.comparison import ConformanceFinding, SeenInterface
    from baxter_model.interface import Interface
    from lab_web.task_queue import TaskQueue


class Comparison:
    """``findings()`` returns baxter_conformance's findings, takes some seconds, and raises RobotError; ``tasks``:
    :class:`lab_web.task_queue.TaskQueue`, of this class alone; ``changed(state)`` tells all pages; ``clock()``: now
    [s since 1970].
    """

    def __init__(self, findings: Callable[[], list[ConformanceFinding]], tasks: TaskQueue,
                 changed: Callable[[dict[str, Any]], object], clock: Callable[[], float]) -> None:
        self._findings = findings
        self._tasks = tasks
        self._changed = changed
        self._clock = clock
        # The last result stays in sight while the robot is compared again.
        self._state = {"is_running": False}

    def ask(self, client: int, _operation: dict[str, Any]) -> None:
        """Compare, unless that is under way; all pages are told. Does not wait."""
        if not self._state["is_running"]:
            self._share(is_running=True)
            self._tasks.add(client, self._compare)

    def _compare(self) -> None:
        result = {}
        try:
            result = {**shown_of(self._findings()), "when_s": self._clock()}
        finally:
            self._share(is_running=False, **result)

    def _share(self, **values: Any) -> None:
        self._state = {**self._state, **values}
        self._changed(self._state)


def shown_of(findings: list[ConformanceFinding]) -> dict[str, Any]:
    """Findings as pages show them: ``met`` and ``of`` (numbers of items), ``groups`` [{name, met, of}], ``others``
    [{name, verdict, reason}] of all that is missing or other than expected.
    """
    met, of = totals(findings, True)
    return {"met": met, "of": of,
            "groups": [{"name": name, "met": here, "of": due} for name, (here, due) in scores(findings).items()],
            "others": [{"name": one.name, "verdict": one.verdict.name.lower(), "reason": one.reason}
                       for one in findings if one.is_public and one.verdict is not Verdict.MET]}


def findings_of(robot: Interface, read: Callable[[Interface], SeenInterface], is_there: Callable[[], bool],
                no_answer: type[BaseException] | tuple[type[BaseException], ...]) -> list[ConformanceFinding]:
    """Findings about the robot on the master, from ``read(robot)``, a baxter_conformance.comparison.SeenInterface.
    Raises RobotError where the master ends meanwhile.

    ``robot``: baxter_model.interface.Interface; ``is_there()``: does the master answer? ``no_answer``: the errors of
    one that does not.
    """
    try:
        seen = read(robot)
        reason = "" if is_there() else "it is not reachable any more"
    except no_answer as error:
        reason = str(error)
    # What was seen of a robot that ends meanwhile is no finding about it.
    if reason:
        raise RobotError("nothing was compared, because the ROS master stopped answering: %s" % reason)
    return compare(robot, seen)
