# SPDX-License-Identifier: BSD-3-Clause
"""`./baxter.sh batch`: run a job for many seeds, continue where it was, and show how it goes."""
from __future__ import annotations

import argparse
import ast
import os
import shlex
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO, cast

from command_line.options import MAX_SEED, MAX_WORKERS, Parser, counted, did_you_mean, number, seconds

from . import keeping, parquet, processes, ray_engine
from .job import JobError, Spec, check, class_of, parameters_of
from .records import Records, RecordsError, summary, versions
from .shipped import JOBS

if TYPE_CHECKING:
    from io import TextIOWrapper

    from lab_batch.job import Outcome

ROOT = Path(os.environ.get("LAB_ROOT", Path.cwd()))
# Between two lines of progress: on a terminal, where each replaces the last one, and in a file.
PROGRESS_S, LINE_S = 0.5, 30.0
# No end of an episode for so long is told [s], where it is also so many times the longest until then.
SILENT_S, SILENT_FACTOR = 60.0, 5.0
BAR_WIDTH = 30
# Python itself needs the least [GB].
MIN_GB, MAX_GB = 0.1, 1e6
MAX_RECYCLE = 10**9
# Most seeds of one batch, whose results are held in memory.
MAX_SEEDS = 10_000_000
ENGINES = {"processes": processes.map_seeds, "ray": ray_engine.map_seeds}


def seeds_of(text: str) -> list[int]:
    """0:1000 is 0 to 999; 5 is 5 alone; 1:3,7 is 1, 2, 7. Raises argparse.ArgumentTypeError."""
    parts, count = [], 0
    try:
        for part in text.split(","):
            first, colon, last = part.partition(":")
            first = int(first or 0) if colon else int(first)
            last = int(last) if colon else first + 1
            if not 0 <= first < last <= MAX_SEED + 1:
                raise ValueError
            count += last - first
            parts.append(range(first, last))
    except ValueError:
        raise argparse.ArgumentTypeError("seeds are numbers from 0 to %d, such as 0:1000, 7 or 0:10,20:30, not %.60r"
                                         % (MAX_SEED, text)) from None
    if count > MAX_SEEDS:
        raise argparse.ArgumentTypeError("%d seeds are too many for one batch; at most %d are run, so make it several"
                                         % (count, MAX_SEEDS))
    return list(dict.fromkeys(seed for part in parts for seed in part))


def setting_of(text: str) -> tuple[str, Any]:
    """NAME=VALUE, where VALUE is a Python literal, or else a text. Raises argparse.ArgumentTypeError."""
    name, equals, value = text.partition("=")
    if not (name.isidentifier() and equals):
        raise argparse.ArgumentTypeError("a parameter is NAME=VALUE, not %r" % text)
    try:
        return name, ast.literal_eval(value)
    except (ValueError, SyntaxError):
        return name, value


def parse(argv: list[str] | None) -> argparse.Namespace:
    parser = Parser(
        prog="./baxter.sh batch", description=__doc__,
        epilog="JOB is a name of --list, or package.module:Class (a class that derives from lab_batch.Job). "
               "Exit status: 0 all episodes ended well, 1 some failed or the job cannot start, 2 wrong options, "
               "130 after Ctrl-C.")
    parser.add_argument("job", nargs="?", metavar="JOB")
    parser.add_argument("--list", action="store_true", help="the jobs that come with this workspace")
    parser.add_argument("--seeds", type=seeds_of, metavar="A:B", help="0:1000 is 0 to 999; also 7, or 0:10,20:30")
    parser.add_argument("--set", type=setting_of, action="append", default=[], metavar="NAME=VALUE",
                        help="a parameter of the job; may be repeated")
    parser.add_argument("--engine", choices=ENGINES, default="processes", help="default: processes of this machine")
    parser.add_argument("--address", metavar="HOST:PORT", help="the head of a Ray cluster; without it Ray runs here")
    parser.add_argument("--workers", type=number(int, 1, MAX_WORKERS), default=os.cpu_count(), metavar="N",
                        help="processes at a time (default: one for each processor, %(default)s)")
    parser.add_argument("--time-limit", type=seconds(), metavar="S", help="longest wall time of an episode")
    parser.add_argument("--memory", type=number(float, MIN_GB, MAX_GB), metavar="GB",
                        help="most memory of a worker with all its processes (default: its share of %d %%%% of this "
                             "machine's; on a cluster: no limit but Ray's own)" % (100 * keeping.SHARE))
    parser.add_argument("--recycle", type=number(int, 1, MAX_RECYCLE), default=200, metavar="N",
                        help="a worker is replaced after N episodes (default %(default)s)")
    parser.add_argument("--retry-failed", action="store_true", help="also run seeds again that failed before")
    parser.add_argument("--out", type=Path, metavar="FILE", help="default: .baxter/batch/JOB.jsonl")
    parser.add_argument("--parquet", type=Path, metavar="FILE",
                        help="write the results of these seeds as Parquet as well; pyarrow is installed on first use")
    options = parser.parse_args(argv)
    if not options.list and not options.job:
        parser.error("JOB and --seeds are needed, or --list")
    if options.job and ":" not in options.job and options.job not in JOBS:
        parser.error("there is no job '%s'; JOB is a name of --list, or package.module:Class%s"
                     % (options.job, did_you_mean(options.job, JOBS)))
    if not options.list and not options.seeds:
        try:
            check(_spec(options))
        except JobError as error:
            parser.error(str(error))
        parser.error("--seeds is needed, such as --seeds 0:100")
    return options


def _spec(options: argparse.Namespace) -> Spec:
    return Spec(JOBS[options.job][0] if options.job in JOBS else options.job, dict(options.set))


def repeating_line(options: argparse.Namespace, seed: int) -> str:
    """The command that runs one episode again, in the folder of this one."""
    script = "./baxter.sh"
    if not os.path.exists(script):
        script = os.path.join(os.environ.get("LAB_ROOT", "."), "baxter.sh")
    words = [script, "batch", options.job, "--seeds", str(seed)]
    for name, value in options.set:
        text = "%s=%s" % (name, value)
        words += ["--set", text if setting_of(text) == (name, value) else "%s=%r" % (name, value)]
    if options.time_limit:
        words += ["--time-limit", "%g" % options.time_limit]
    memory_bytes = memory_bytes_of(options)
    if memory_bytes not in (None, keeping.default_memory_bytes(os.cpu_count() or 1)):
        words += ["--memory", "%.3g" % (memory_bytes / 1e9)]
    return shlex.join([*words, "--out", "/dev/null"])


def memory_bytes_of(options: argparse.Namespace) -> int | None:
    """The limit of memory of each worker, or None: the machines of a cluster may have other ones."""
    if options.memory:
        return round(1e9 * options.memory)
    return None if options.address else keeping.default_memory_bytes(options.workers)


class Progress:
    """Says how far a batch is: done of total, rate, time left. A bar on a terminal, a line now and then elsewhere.

    clock: returns the time [s]; stream: a text stream.
    """

    def __init__(self, total: int, stream: TextIO | None = None, clock: Callable[[], float] = time.monotonic) -> None:
        self._stream, self._clock = sys.stderr if stream is None else stream, clock
        self._total, self._count, self._failed = total, 0, 0
        self._began = self._shown = self._ended = clock()  # of the last episode
        self._longest, self._silent_s = 0.0, SILENT_S

    def step(self, outcome: Outcome) -> None:
        self._count += 1
        self._failed += not outcome.is_done
        now = self._clock()
        self._longest, self._ended = max(self._longest, now - self._ended), now
        terminal, is_last = self._stream.isatty(), self._count == self._total
        if terminal and (is_last or now - self._shown >= PROGRESS_S):
            self._write("\r\x1b[K%s %s" % (self._bar(), self._text(now)))
        elif not terminal and now - self._shown >= LINE_S:
            self._write(self._text(now) + "\n")
        else:
            return
        self._shown = now

    def silence(self) -> str:
        """A line to show where no episode has ended for much longer than before, else "". Each line of one silence
        comes after twice the time of the last. Any thread may call it."""
        silent = self._clock() - self._ended
        if silent < SILENT_S:
            self._silent_s = SILENT_S
        if silent < max(self._silent_s, SILENT_FACTOR * self._longest):
            return ""
        self._silent_s = 2.0 * silent
        return ("batch: no episode has ended for %s. If one hangs, --time-limit SECONDS gives it up: Ctrl-C, then the "
                "same command with it, which goes on from here" % duration(silent))

    def _bar(self) -> str:
        full = BAR_WIDTH * self._count // self._total
        return "[%s%s]" % ("#" * full, "." * (BAR_WIDTH - full))

    def _text(self, now: float) -> str:
        seconds = max(now - self._began, 1e-9)
        left = (self._total - self._count) * seconds / self._count
        return "%d/%d, %d failed, %.3g/s, %s left" % (
            self._count, self._total, self._failed, self._count / seconds, duration(left))

    def _write(self, text: str) -> None:
        self._stream.write(text)
        self._stream.flush()

    def end(self) -> None:
        if self._stream.isatty() and self._count:
            self._write("\n")


def duration(seconds: float) -> str:
    """1:02:03 for 3723 s, 02:03 for 123 s."""
    minutes, second = divmod(round(seconds), 60)
    hours, minute = divmod(minutes, 60)
    return "%d:%02d:%02d" % (hours, minute, second) if hours else "%02d:%02d" % (minute, second)


def list_jobs() -> None:
    for name, (target, text) in JOBS.items():
        print("%-14s %s" % (name, text))
        for parameter, default in parameters_of(class_of(target)).items():
            print("%-14s   --set %s=%s" % ("", parameter, default))


def run(options: argparse.Namespace) -> int:
    spec = _spec(options)
    check(spec)  # wrong names are told before anything starts
    if options.parquet:
        parquet.ensure_installed(ROOT)
    if options.engine == "ray":
        ray_engine.ensure_installed(ROOT)  # its version is one of those in the file
    path = options.out or ROOT / ".baxter" / "batch" / ("%s.jsonl" % options.job.replace("/", "_").replace(":", "."))
    records = Records(path, spec, versions(ROOT))
    try:
        known = {seed for seed, one in records.outcomes.items() if one.is_done or not options.retry_failed}
        left = [seed for seed in options.seeds if seed not in known]
        if len(left) < len(options.seeds):
            print("results in %s: of %d of %s" % (
                path, len(options.seeds) - len(left), counted(len(options.seeds), "seed")))
        for earlier in records.header.get("earlier versions", ()):
            print("batch: some of them are of other versions: %s" % changes(earlier, records.header["versions"]),
                  file=sys.stderr)
        began = time.monotonic()
        _run_left(options, spec, left, records)
        seconds = time.monotonic() - began
        chosen = [records.outcomes[seed] for seed in options.seeds]
        code = report(options, chosen, path, len(left), seconds)
        if options.parquet:
            parquet.write(options.parquet, records.header, chosen)
        return code
    finally:
        records.close()


def changes(earlier: dict[str, str], now: dict[str, str]) -> str:
    """Say which versions ({name: text}) are others now."""
    return ", ".join("%s %s (now %s)" % (name, earlier.get(name, "absent"), now.get(name, "absent"))
                     for name in sorted({**earlier, **now}) if earlier.get(name) != now.get(name))


def _run_left(options: argparse.Namespace, spec: Spec, left: list[int], records: Records) -> None:
    progress = Progress(len(left))
    limits = processes.BatchLimits(min(options.workers, max(1, len(left))), options.time_limit, options.recycle,
                                   memory_bytes_of(options))
    extra = {"address": options.address} if options.engine == "ray" else {}
    done = threading.Event()
    if options.time_limit is None:
        threading.Thread(target=_tell_silence, args=(progress, done), daemon=True).start()
    try:
        for outcome in ENGINES[options.engine](spec, left, limits, **extra):
            progress.step(records.add(outcome))
    finally:
        done.set()
        progress.end()


def _tell_silence(progress: Progress, done: threading.Event) -> None:
    while not done.wait(1.0):
        if line := progress.silence():
            print("\n" + line if sys.stderr.isatty() else line, file=sys.stderr, flush=True)


def report(options: argparse.Namespace, outcomes: list[Outcome], path: Path, count: int, seconds: float) -> int:
    failed = [one for one in outcomes if not one.is_done]
    for line in summary(outcomes):
        print(line)
    for one in failed:
        print("seed %d failed: %s\n  %s" % (one.seed, one.error, repeating_line(options, one.seed)))
    print("%d ended well, %d failed; %d run now in %.1f s; results in %s" % (
        len(outcomes) - len(failed), len(failed), count, seconds, path))
    return 1 if failed else 0


def main(argv: list[str] | None = None) -> int:
    options = parse(argv)
    # Errors of jobs hold any text.
    cast("TextIOWrapper", sys.stdout).reconfigure(errors="backslashreplace")
    try:
        if options.list:
            list_jobs()
            return 0
        return run(options)
    except BrokenPipeError:
        raise  # of the standard output: rospy_fixes ends the program without a word
    except (JobError, RecordsError, OSError) as error:
        print("batch: %s" % error, file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("batch: stopped; the same command continues", file=sys.stderr)
        return 130
