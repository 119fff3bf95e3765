# SPDX-License-Identifier: BSD-3-Clause
"""Pages in HTML: one for each student, one for the instructor. Free of ROS, without scripts and outside references."""
from __future__ import annotations

import html
import os
import shlex
import statistics
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from command_line.options import counted
from rf_grading import drawing
from rf_grading.formats import plain
from rf_grading.results import GRADED, NOT_GRADED, POINTS, held_back

if TYPE_CHECKING:
    from rf_checks.exercises import Exercise
    from rf_grading.results import Cell, Results, Row

_STYLE = """
:root { color-scheme: light dark; --text: #1c1f22; --page: #fff; --small: #5b6167; --line: #e3e6e8; --box: #f2f3f4;
--hint: #fff6d6; --passed: #16703c; --failed: #a12a1c; --open: #85610a; --link: #0b5c80; }
@media screen and (prefers-color-scheme: dark) { :root { --text: #e4e7ea; --page: #16191c; --small: #a3abb3;
--line: #363c42; --box: #22272b; --hint: #40371a; --passed: #6fce94; --failed: #f08a7d; --open: #dfb95c;
--link: #7cc4e6; } }
body { font: 15px/1.45 system-ui, sans-serif; color: var(--text); background: var(--page); max-width: 68rem;
margin: 2rem auto; padding: 0 1rem; overflow-wrap: break-word; } a { color: var(--link); }
h1 { font-size: 1.5rem; } h2 { font-size: 1.2rem; margin-top: 2rem; } h3 { font-size: 1rem; }
table { border-collapse: collapse; margin: 0.6rem 0; display: block; overflow-x: auto; }
th, td { text-align: left; padding: 0.2rem 0.8rem 0.2rem 0; vertical-align: top; border-bottom: 1px solid var(--line); }
td.n, th.n { text-align: right; white-space: nowrap; } td.why { min-width: 18rem; }
.passed { color: var(--passed); } .failed { color: var(--failed); } .open { color: var(--open); }
.hint { background: var(--hint); padding: 0.6rem 0.8rem; border-radius: 4px; } pre { background: var(--box);
padding: 0.6rem; overflow: auto; max-height: 16rem; font-size: 13px; } svg { max-width: 100%; height: auto; }
.small { color: var(--small); font-size: 13px; } .bar { background: #0b6e99; height: 0.8rem; display: inline-block; }
@media print { body { margin: 0; max-width: none; } pre { max-height: none; white-space: pre-wrap; }
h2, h3, .before { break-after: avoid; } tr, svg, .hint { break-inside: avoid; } .bar { print-color-adjust: exact; } }
"""
_PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width">
<title>%(title)s</title><style>%(style)s</style></head>
<body>
<h1>%(title)s</h1>
%(body)s
</body></html>
"""


def _text(value: str) -> str:
    return html.escape(plain(value))


def _page(title: str, parts: list[str]) -> str:
    return _PAGE % {"title": _text(title), "style": _STYLE, "body": "\n".join(parts)}


def _points(value: float | None) -> str:
    return "not graded" if value is None else "%g" % round(value, 1)


def _class_of(cell: Cell) -> str:
    if cell.status == NOT_GRADED:
        return "open"
    return "passed" if cell.has_passed else "failed"


def link_to(path: str) -> str:
    """The address of a file below the page's folder. path: text as from os.listdir."""
    return "/".join(quote(os.fsencode(part)) for part in path.split("/"))


# -- a student's page

def feedback(results: Results, row: Row, motions: dict[str, list[dict[str, list[Any]]]]) -> str:
    """The page of one student; it has nothing of other students, and no notes for the instructor.

    motions: {key: [motion of each run]}.
    """
    who = row.submission.name or row.submission.student
    total = ('<p><b class="n">%s of %g points</b></p>' % (_points(row.points), results.most_points)
             if row.points is not None else "<p><b>Not graded yet</b></p>")
    parts = [total]
    for exercise in results.exercises:
        parts += _exercise(results, exercise, row.cells[exercise.name], motions)
    parts.append('<p class="small">Graded by version %s. On your own machine the same version gives the same points: '
                 "<code>./baxter.sh grade --version</code> prints it.</p>" % _text(results.version))
    return _page("%s: %s" % (results.assignment, who), parts)


def _exercise(results: Results, exercise: Exercise, cell: Cell,
              motions: dict[str, list[dict[str, list[Any]]]]) -> Iterator[str]:
    yield "<h2>%s: %s</h2>" % (_text(exercise.name), _text(exercise.title))
    yield '<p><b class="%s">%s of %g points</b></p>' % (_class_of(cell), _points(cell.points), POINTS)
    if cell.sentence:
        yield '<p class="hint">%s</p>' % _text(cell.sentence.rstrip(".") + ".")
    if cell.note:
        yield "<p>%s: %s.</p>" % (_text(cell.program), _text(cell.note))
    if cell.status != GRADED or cell.verdict is None:
        return
    runs = cell.verdict["runs"]
    for number, run in enumerate(runs):
        yield "<h3><code>%s</code></h3>" % _text(" ".join([cell.verdict["program"], *run["arguments"]]))
        yield _criteria(run)
        shown = motions.get(cell.key, [])
        if number < len(shown) and shown[number]:
            yield ('<p class="small before">What the robot did, in a loop: left arm blue, right arm orange, both at '
                   "the start grey, the hands' paths thin.</p>")
            yield drawing.of_run(shown[number])
        for title, name in (("It printed", "output"), ("Its errors", "errors")):
            if run.get(name):
                yield "<details open><summary>%s</summary><pre>%s</pre></details>" % (title, _text(run[name]))
    yield '<p class="before">The same check on your own machine:</p>'
    yield "<pre>%s</pre>" % _text(_command(results, exercise, cell))


def _criteria(run: dict[str, Any]) -> str:
    rows = "".join('<tr><td>%s</td><td class="n">%g</td><td class="n">%g</td><td>%s</td></tr>' % (
        _text(one["name"]), round(one["points"], 1), round(one["of"], 1), _text(one["found"]))
        for one in run["criteria"])
    end = ""
    if run["end"]:
        end = '<p class="small">The run: %s, after %.1f s of simulated time.</p>' % (
            _text(run["end"]["how"]), run["end"]["simulated_s"])
    return ('<table><tr><th>criterion</th><th class="n">points</th><th class="n">of</th><th>found</th></tr>%s</table>'
            "<p>%g points for this run%s.</p>%s" % (rows, round(run["points"], 1), _text(held_back(run)), end))


def _command(results: Results, exercise: Exercise, cell: Cell) -> str:
    words = ["./baxter.sh", "check", exercise.lab, exercise.name, cell.program]
    for name, usual in (("seed", 0), ("profile", "sim"), ("serial", 0)):
        if results.conditions[name] != usual:
            words += ["--" + name, str(results.conditions[name])]
    return shlex.join(words)


# -- the instructor's page

def overview(results: Results, seconds: float | None, feedback_of: Callable[..., Any]) -> str:
    """The instructor's page. seconds: how long this start took, or None. feedback_of: function of a Row, the path of
    the student's page."""
    graded = [row.points for row in results.rows if row.points is not None]
    conditions = ", ".join("%s %s" % one for one in results.conditions.items())
    parts = ["<p>%s, %d graded; %s; version %s%s.</p>" % (
        counted(len(results.rows), "submission"), sum(row.status == GRADED for row in results.rows),
        _text(conditions), _text(results.version),
        "" if seconds is None else "; this start took %.0f s" % seconds)]
    if graded:
        parts.append("<p>Mean %.1f of %g points, median %.1f.</p>" % (
            sum(graded) / len(graded), results.most_points, statistics.median(graded)))
        parts.append(_histogram(graded, results.most_points))
    parts.append('<p>Files: <a href="results.csv">results.csv</a>, <a href="results.json">results.json</a>, '
                 '<a href="results.xml">results.xml</a> (JUnit), <a href="nbgrader.csv">nbgrader.csv</a>; '
                 "results.json for Gradescope is beside each student's page.</p>")
    parts += ["<h2>Submissions</h2>", _submissions(results, feedback_of)]
    parts += ["<h2>What went wrong, by number</h2>", _faults(results)]
    parts += ["<h2>Submissions that are alike</h2>", *_alike(results, feedback_of)]
    notes = [(row, name, note) for row in results.rows for name, note in row.notes]
    if notes:
        parts.append("<h2>Notes</h2><p>They change no points.</p><table>%s</table>" % "".join(
            "<tr><td>%s</td><td>%s</td><td>%s</td></tr>" % (_text(row.submission.entry), _text(name), _text(note))
            for row, name, note in notes))
    if results.left_out:
        parts.append("<p>Not a submission, and left out: %s.</p>" % _text(", ".join(results.left_out)))
    return _page("%s: the class" % results.assignment, parts)


def _histogram(points: list[float], most: float) -> str:
    counts = [0] * 10
    for value in points:
        counts[min(9, int(10 * value / most))] += 1
    rows = "".join('<tr><td class="n">%g to %g</td><td class="n">%d</td><td><span class="bar" style="width: %dpx">'
                   "</span></td></tr>" % (most * k / 10, most * (k + 1) / 10, count, round(300 * count / max(counts)))
                   for k, count in enumerate(counts))
    return "<table>%s</table>" % rows


def _submissions(results: Results, feedback_of: Callable[[Any], Any]) -> str:
    head = "".join('<th class="n">%s</th>' % _text(exercise.name) for exercise in results.exercises)
    # Folders and files without a learning system's names have none.
    named = any(row.submission.name for row in results.rows)
    lines = []
    for row in results.rows:
        cells = "".join('<td class="n %s">%s</td>' % (_class_of(row.cells[exercise.name]),
                                                      _points(row.cells[exercise.name].points))
                        for exercise in results.exercises)
        name = "<td>%s</td>" % _text(row.submission.name) if named else ""
        lines.append('<tr><td><a href="%s">%s</a></td>%s%s<td class="n">%s</td><td class="why">%s</td></tr>' % (
            link_to(feedback_of(row)), _text(row.submission.entry), name, cells, _points(row.points),
            _text("; ".join(row.sentences))))
    return ('<table><tr><th>submission</th>%s%s<th class="n">points</th><th>reasons</th></tr>%s</table>'
            % ("<th>name</th>" if named else "", head, "".join(lines)))


def _faults(results: Results) -> str:
    found = {}
    for row in results.rows:
        for name, cell in row.cells.items():
            what = (cell.verdict or {}).get("fault") or (cell.status if cell.status != GRADED else "")
            if what:
                found.setdefault((name, what.replace("_", " ")), []).append(cell.sentence)
    if not found:
        return "<p>Nothing.</p>"
    return ('<table><tr><th class="n">number</th><th>exercise</th><th>fault</th><th>one of the sentences</th></tr>%s'
            "</table>" % "".join(
                '<tr><td class="n">%d</td><td>%s</td><td>%s</td><td class="why">%s</td></tr>' % (
                    len(sentences), _text(name), _text(what), _text(sentences[0]))
                for (name, what), sentences in sorted(found.items(), key=lambda one: (-len(one[1]), one[0]))))


def _alike(results: Results, feedback_of: Callable[[Any], Any]) -> Iterator[str]:
    if not results.alike:
        yield "<p>None share half of their own code.</p>"
        return
    yield ("<p>Names, numbers, texts and formatting do not count, nor does code that was handed out or that a large "
           "part of the class shares. Compare the two programs: this is no proof.</p>")
    pages = {row.submission.entry: link_to(feedback_of(row)) for row in results.rows}
    yield "<table><tr><th>first</th><th>second</th><th>found</th></tr>%s</table>" % "".join(
        '<tr><td><a href="%s">%s</a></td><td><a href="%s">%s</a></td><td>%s</td></tr>' % (
            pages[pair.first], _text(pair.first), pages[pair.second], _text(pair.second),
            "the same files, byte for byte" if pair.is_same else
            "%.0f %% of the first's own code is in the second, %.0f %% of the second's in the first" % (
                100 * pair.of_first, 100 * pair.of_second)) for pair in results.alike)
