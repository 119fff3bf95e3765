# SPDX-License-Identifier: BSD-3-Clause
"""The report of a check: as text, as JSON, as JUnit XML. Free of ROS."""
from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree

from rf_checks.exercises import PASS_MARK

if TYPE_CHECKING:
    from rf_checks.judge import Result
    from rf_checks.lab import WhichRobot


def has_passed(result: Result) -> bool:
    return result.points is not None and result.points >= PASS_MARK


def text(result: Result) -> str:
    """As text for users: a table of each run, then the hint."""
    exercise = result.exercise
    lines = ["%s %s: %s" % (exercise.lab, exercise.name, exercise.title)]
    for run in result.runs:
        lines.append("  " + " ".join((Path(result.program).name, *run.arguments)))
        for one in run.criteria:
            lines.append("    %-22s %5.1f of %4.1f   %s" % (one.name, one.share * one.weight, one.weight, one.found))
        if run.fault and run.fault.cap * 100.0 < sum(one.share * one.weight for one in run.criteria):
            lines.append("    %-22s no more than %.0f, for the fault below" % ("", 100.0 * run.fault.cap))
    if result.not_graded:
        return "\n".join([*lines, "not graded: %s. That says nothing about the program: try again when the machine has "
                          "less to do, or with a longer --wall-limit." % result.not_graded])
    lines.append("%s: %.0f of 100 points (%s; %sseed %d, %.0f s)" % (
        "passed" if has_passed(result) else "not passed", result.points,
        "%g are due" % PASS_MARK, _robot(result.which), result.seed, result.lasted_s))
    if result.fault:
        lines.append("Hint: %s." % result.fault.sentence.rstrip("."))
    lines += ["Note for the instructor (it changes no points): %s." % note for note in result.notes]
    return "\n".join(lines)


def _robot(which: WhichRobot) -> str:
    """The robot, where it is not the labs' usual one."""
    return "" if which.is_usual else "profile %s, serial %d, " % which


def as_json(result: Result) -> str:
    """The same as a JSON text."""
    points = result.points
    return json.dumps({
        "lab": result.exercise.lab, "exercise": result.exercise.name, "program": result.program, "seed": result.seed,
        "profile": result.which.profile, "serial": result.which.serial,
        "graded": not result.not_graded, "not_graded": result.not_graded or None,
        "points": None if points is None else round(points, 2), "pass_mark": PASS_MARK,
        "passed": has_passed(result),
        "fault": result.fault.key if result.fault else None, "hint": result.fault.sentence if result.fault else None,
        "notes": list(result.notes), "isolation": result.isolation, "wall_s": round(result.lasted_s, 2),
        "runs": [{"arguments": list(run.arguments), "points": round(run.points, 2),
                  "fault": run.fault.key if run.fault else None, "end": run.end,
                  "criteria": [{"name": one.name, "points": round(one.share * one.weight, 2), "of": one.weight,
                                "found": one.found} for one in run.criteria]} for run in result.runs],
    }, indent=1)


def as_junit(result: Result) -> str:
    """The same as JUnit XML: one case for each run; a failure has points and hint."""
    failed = sum(run.points < PASS_MARK for run in result.runs)
    name = "%s.%s" % (result.exercise.lab, result.exercise.name)
    ungraded = bool(result.not_graded)
    suite = ElementTree.Element("testsuite", name=name, tests=str(len(result.runs) + ungraded), failures=str(failed),
                                errors=str(int(ungraded)), time="%.2f" % result.lasted_s)
    if ungraded:
        case = ElementTree.SubElement(suite, "testcase", name="not graded", classname=name)
        ElementTree.SubElement(case, "error", message=_clean(result.not_graded))
    for run in result.runs:
        name = " ".join((result.exercise.name, *run.arguments))
        case = ElementTree.SubElement(suite, "testcase", name=name,
                                      classname="%s.%s" % (result.exercise.lab, result.exercise.name))
        lines = ["%s: %.1f of %.1f (%s)" % (one.name, one.share * one.weight, one.weight, one.found)
                 for one in run.criteria]
        if run.points < PASS_MARK:
            hint = run.fault.sentence if run.fault else "see the points"
            failure = ElementTree.SubElement(case, "failure",
                                             message="%.0f of 100 points: %s" % (run.points, _clean(hint)))
            failure.text = _clean("\n".join(lines))
        else:
            ElementTree.SubElement(case, "system-out").text = _clean("\n".join(lines))
    return ElementTree.tostring(suite, encoding="unicode", xml_declaration=True)


def _clean(words: str) -> str:
    """Without characters that XML cannot carry."""
    return "".join(c if c in "\t\n" or " " <= c < "\ud800" or "\ue000" <= c <= "\ufffd" else "?" for c in words)
