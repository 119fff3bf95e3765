# SPDX-License-Identifier: BSD-3-Clause
"""The command line of `./baxter.sh grade`."""
from __future__ import annotations

import argparse
import contextlib
import io
import json
import os
import signal
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from command_line.options import MAX_SEED, MAX_WORKERS, Parser, counted, number, seconds
from command_line.user_files import read_file
from disk_cache.files import remove_drafts
from lab_batch import JobError, Spec
from lab_batch.keeping import default_memory_bytes
from lab_batch.processes import BatchLimits, map_seeds
from processes import isolation
from processes.work_folder import work_folder
from rf_checks import similarity
from rf_checks.command import write_report
from rf_checks.exercises import LABS, UnknownExercise
from rf_checks.judge import WALL_LIMIT_S
from rf_checks.sandbox import MEMORY_BYTES
from rf_grading import alike, archives, formats, keys, pages, plan, programs, reading, results
from rf_grading.ledger import Ledger, LedgerError
from rf_grading.submissions import BadFolder, read_class

if TYPE_CHECKING:
    from lab_batch.job import Outcome

GRADED, NOT_ALL_GRADED, WRONG_WORDS, FAILED, STOPPED = 0, 1, 2, 3, 130
#: Memory of a judge with its lab, beside its program's limit [bytes].
LAB_BYTES = 1 << 30
#: A worker ends this long after its check should have given up [s, wall].
_GRACE_S = 120.0
#: Judges keep memory: a worker is replaced after so many checks.
_CHECKS_OF_A_WORKER = 50
#: The results of the whole class, by the names of their files.
_TABLES = {"results.json": formats.as_json, "results.csv": formats.as_csv, "results.xml": formats.as_junit,
           "nbgrader.csv": formats.as_nbgrader}
_JOB = "rf_grading.job:Grade"


def parse(argv: list[str] | None) -> argparse.Namespace:
    """The options; ``chosen``: the exercises to judge."""
    parser = Parser(
        prog="./baxter.sh grade", formatter_class=argparse.RawDescriptionHelpFormatter,
        description="Judge the submissions of a class, several at a time, each in a separate lab and sandbox.\n"
                    "Only new and changed submissions are judged; a grading that was stopped goes on.",
        epilog="FOLDER has a folder, an archive (zip, tar) or files for each student, as Moodle, nbgrader and\n"
               "Gradescope export them; it may be an archive itself.\n"
               "exit status: 0 all graded, 1 some not graded, 2 wrong arguments, 3 nothing can be graded, 130 stopped")
    parser.add_argument("folder", nargs="?", metavar="FOLDER", type=Path)
    parser.add_argument("lab", nargs="?", default="", metavar="LAB", help="%s (default: all)" % " or ".join(LABS))
    parser.add_argument("exercises", nargs="*", metavar="EXERCISE",
                        help="what was to be sent (default: what any of the submissions has a program for)")
    parser.add_argument("--out", type=Path, metavar="FOLDER", help="for results and pages (default: FOLDER-graded)")
    parser.add_argument("--assignment", default="", metavar="NAME",
                        help="nbgrader's: only STUDENT/NAME is read; also the name in the results")
    parser.add_argument("--seed", type=number(int, 0, MAX_SEED), default=0,
                        help="of start postures and goals (default: %(default)s)")
    parser.add_argument("--profile", choices=("sim", "robot"), default="sim", help="as in check (default: %(default)s)")
    parser.add_argument("--serial", type=number(int, 0, MAX_SEED), default=0,
                        help="as in check (default: %(default)s)")
    parser.add_argument("--workers", type=number(int, 1, MAX_WORKERS), metavar="N",
                        help="judges at a time (default: one for each processor, as far as memory lasts)")
    parser.add_argument("--wall-limit", type=seconds(), default=WALL_LIMIT_S, metavar="SECONDS",
                        help="give up a check ungraded after so long (default: %(default)g)")
    parser.add_argument("--given", type=Path, action="append", default=[], metavar="FILE",
                        help="code that the students were given: it counts for nobody as copied; may be repeated")
    parser.add_argument("--trusted", action="store_true",
                        help="where this machine allows no sandbox, run all programs without one: never for other "
                             "people's programs")
    parser.add_argument("--version", action="store_true", help="print the version on which verdicts depend, and end")
    options = parser.parse_args(argv)
    if options.version:
        return options
    if options.folder is None:
        parser.error("say which folder has the submissions: ./baxter.sh grade FOLDER [LAB [EXERCISE ...]]")
    if not options.folder.exists():
        parser.error("%s is neither a folder nor a zip or tar file" % options.folder)
    try:
        options.chosen = programs.exercises_of(options.lab, options.exercises)
    except UnknownExercise as error:
        parser.error(str(error))
    return options


def _fail(sentence: Any) -> None:
    print("grade: %s" % sentence, file=sys.stderr)


def workers_for(processors: int, free_bytes: int) -> int:
    """How many judges run at a time."""
    return max(1, min(processors, free_bytes // (MEMORY_BYTES + LAB_BYTES)))


def _free_bytes() -> int:
    for line in Path("/proc/meminfo").read_text(encoding="ascii").splitlines():
        if line.startswith("MemAvailable:"):
            return int(line.split()[1]) << 10
    return MEMORY_BYTES + LAB_BYTES


def _workspace() -> Path:
    return Path(os.environ.get("LAB_ROOT") or Path(__file__).resolve().parents[5])


def _places(options: argparse.Namespace) -> tuple[Path, Path]:
    """(folder, out) of the options, resolved. Raises BadFolder where one lies in the other or around the workspace."""
    folder = options.folder.resolve()
    name = folder.name if folder.is_dir() else archives.stem(folder.name)
    out = (options.out or folder.parent / ("%s-graded" % name)).resolve()
    if out == folder or folder in out.parents or out in folder.parents:
        raise BadFolder("the results, %s, and the submissions, %s, must not lie in each other; name another folder "
                        "with --out" % (out, folder))
    for place in (folder, out):
        for root in map(Path, isolation.workspaces(os.environ)):
            if place == root or place in root.parents:
                raise BadFolder("%s is hidden from the judged programs, but they need %s, which lies in it; use "
                                "separate folders for submissions and results" % (place, root))
    return folder, out


class _Grading:
    """One start of the command."""

    def __init__(self, options: argparse.Namespace, folder: Path, out: Path) -> None:
        self._options, self._folder, self._out = options, folder, out
        self._began = time.monotonic()
        self._failures = {}

    def run(self) -> int:
        """Returns the exit status. Raises BadFolder, LedgerError, JobError, OSError."""
        options = self._options
        exercises = options.chosen
        version = keys.product_version(_workspace())
        conditions = {"seed": options.seed, "profile": options.profile, "serial": options.serial}
        walls = "trusted" if isolation.problem() else "bubblewrap"
        sent, left_out = read_class(self._folder, [one.name for one in exercises], options.assignment)
        if not sent:
            raise BadFolder("%s has no submissions: no folder, archive or program of a student" % self._folder)
        (self._out / "motions").mkdir(parents=True, exist_ok=True)
        with Ledger(self._out / "verdicts.jsonl") as ledger, work_folder("lab-grade-") as work:
            for place in (self._out, self._out / "motions", *self._out.glob("feedback/*/")):
                remove_drafts(place)
            exercises, entries, tasks = plan.make(sent, exercises, version, {**conditions, "walls": walls},
                                                  work / "programs", only_used=not options.exercises)
            if not exercises:
                raise BadFolder("no submission in %s has a program for an exercise; name it: ./baxter.sh grade %s LAB "
                                "EXERCISE" % (self._folder, self._options.folder))
            given = [read_file(path, archives.most_bytes(path.name)).decode("utf-8", "replace")
                     for path in options.given]
            texts = {entry.submission.entry: list(entry.texts.values()) for entry in entries if entry.texts}
            handed_out = [*similarity.References(_workspace()).handed_out, *given]
            try:
                pairs = alike.pairs(texts, handed_out)
            except Exception as error:  # noqa: BLE001  (grading goes on without it)
                _fail("the submissions are not compared with each other: %s" % reading.unforeseen(error))
                pairs = []
            todo = [task for task in tasks.values() if task.key not in ledger.verdicts]
            print("%s, %s; %d have their verdict already, %d to judge; results in %s" % (
                counted(len(sent), "submission"), counted(sum(len(entry.keys) for entry in entries), "program"),
                len(tasks) - len(todo), len(todo), self._out),
                flush=True)
            name = options.assignment or archives.stem(self._folder.name)
            try:
                self._judge(todo, ledger, entries, work)
            finally:
                rows = results.rows_of(entries, exercises, ledger.verdicts, self._failures)
                rows = self._write(results.Results(name, tuple(exercises), rows, conditions, version, tuple(left_out),
                                            tuple(pairs)), entries)
        return self._conclude(rows)

    def _judge(self, todo: list[plan.PlannedVerdict], ledger: Ledger, entries: list[plan.SubmissionEntry],
               work: Path) -> None:
        if not todo:
            return
        owners = {}
        for entry in entries:
            for key in entry.keys.values():
                owners.setdefault(key, []).append(entry.submission.entry)
        options = self._options
        (work / "tasks.json").write_text(json.dumps([
            {"lab": task.exercise.lab, "exercise": task.exercise.name, "program": task.program, "seed": options.seed,
             "profile": options.profile, "serial": options.serial} for task in todo]), encoding="utf-8")
        spec = Spec(_JOB, {"tasks": str(work / "tasks.json"), "wall_limit": options.wall_limit,
                           "trusted": options.trusted, "hidden": [str(self._folder), str(self._out)]})
        processors = len(os.sched_getaffinity(0))
        workers = min(options.workers or workers_for(processors, _free_bytes()), len(todo))
        memory = max(MEMORY_BYTES + LAB_BYTES, default_memory_bytes(workers))
        limits = BatchLimits(workers, options.wall_limit + _GRACE_S, _CHECKS_OF_A_WORKER, memory)
        with contextlib.closing(map_seeds(spec, range(len(todo)), limits)) as outcomes:
            for count, outcome in enumerate(outcomes, 1):
                task = todo[outcome.seed]
                try:
                    said = self._take(task, outcome, ledger)
                except (ArithmeticError, LookupError, TypeError, ValueError) as error:
                    # OSError, as of a full disk, concerns them all.
                    said = self._failures[task.key] = (
                        "the check itself failed, which is not the program's fault: %s" % reading.unforeseen(error))
                print(formats.one_line("%d of %d: %s, %s: %s" % (
                    count, len(todo), ", ".join(owners[task.key]), task.exercise.name, said)), flush=True)

    def _take(self, task: plan.PlannedVerdict, outcome: Outcome, ledger: Ledger) -> str:
        """Keep what a worker has found; returns a sentence."""
        if not outcome.is_done:
            self._failures[task.key] = "the check itself failed, which is not the program's fault: %s" % outcome.error
            return self._failures[task.key]
        verdict = outcome.result["verdict"]
        if not verdict["graded"]:
            self._failures[task.key] = "not graded: %s" % verdict["not_graded"]
            return self._failures[task.key]
        write_report(self._out / "motions" / (task.key + ".json"), json.dumps(outcome.result["motions"]))
        ledger.add(task.key, verdict)
        return "%g points%s" % (round(verdict["points"], 1), "; " + verdict["hint"] if verdict["hint"] else "")

    def _write(self, found: results.Results, entries: list[plan.SubmissionEntry]) -> tuple[results.Row, ...]:
        """Write all reports; returns the Rows that they show."""
        out = self._out
        found = replace(found, rows=tuple(self._reported(found, row) for row in found.rows))
        # Programs made of notebooks, for the check on the student's own machine.
        made = {entry.submission.entry: {Path(path).name: entry.texts[path] for name, path in entry.paths.items()
                                         if entry.notes[name]} for entry in entries}
        for name, write in _TABLES.items():
            write_report(out / name, write(found))
        for row in found.rows:
            folder = out / _page_of(row)
            folder.parent.mkdir(parents=True, exist_ok=True)
            write_report(folder, pages.feedback(found, row, self._motions_of(row)))
            write_report(folder.parent / "results.json", formats.as_gradescope(row))
            for name, text in made.get(row.submission.entry, {}).items():
                write_report(folder.parent / name, text)
        write_report(out / "index.html", pages.overview(found, time.monotonic() - self._began, _page_of))
        return found.rows

    def _reported(self, found: results.Results, row: results.Row) -> results.Row:
        """A row whose reports can be written: this one, or one that says why it cannot."""
        try:
            single = replace(found, rows=(row,), alike=())
            for write in _TABLES.values():
                write(single).encode()
            pages.overview(single, None, _page_of).encode()
            pages.feedback(single, row, self._motions_of(row)).encode()
            formats.as_gradescope(row).encode()
        except Exception as error:  # noqa: BLE001  (one submission ends no report of the others)
            sentence = "its report cannot be written: %s" % reading.unforeseen(error)
            return replace(row, cells={name: results.Cell(results.NOT_GRADED, None, sentence) for name in row.cells})
        return row

    def _motions_of(self, row: results.Row) -> dict[str, list[dict[str, list[Any]]]]:
        return {cell.key: self._motions(cell.key) for cell in row.cells.values() if cell.key}

    def _motions(self, key: str) -> list[dict[str, list[Any]]]:
        try:
            return json.loads((self._out / "motions" / (key + ".json")).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return []

    def _conclude(self, rows: tuple[results.Row, ...]) -> int:
        missing = [row for row in rows if row.status == results.NOT_GRADED]
        for row in missing:
            print(formats.one_line("%s: %s" % (row.submission.entry, "; ".join(row.sentences))))
        print("%d graded, %d without a program, %d not graded, in %.0f s; the class: %s" % (
            sum(row.status == results.GRADED for row in rows), sum(row.status == results.NO_PROGRAM for row in rows),
            len(missing), time.monotonic() - self._began, self._out / "index.html"))
        return NOT_ALL_GRADED if missing else GRADED


def _page_of(row: results.Row) -> str:
    return "feedback/%s/feedback.html" % row.submission.entry


def _stop(*_: object) -> NoReturn:
    raise KeyboardInterrupt


def main(argv: list[str] | None = None) -> int:
    """Returns the exit status."""
    options = parse(argv)
    if options.version:
        print(keys.product_version(_workspace()))
        return GRADED
    if isolation.problem() and not options.trusted:
        _fail("programs of others are not run without walls around them, and this machine allows none: %s"
              % isolation.problem())
        return FAILED
    for one in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(one, _stop)
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")
    try:
        folder, out = _places(options)
        return _Grading(options, folder, out).run()
    except BadFolder as error:
        _fail(error)
        return WRONG_WORDS
    except (LedgerError, JobError, OSError) as error:
        _fail(error)
        return FAILED
    except KeyboardInterrupt:
        _fail("stopped; the same command goes on where it was")
        return STOPPED
