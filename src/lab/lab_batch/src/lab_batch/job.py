# SPDX-License-Identifier: BSD-3-Clause
"""A job: a class of which each instance runs episodes, one for each seed."""
from __future__ import annotations

import errno
import importlib
import inspect
import json
import resource
import time
import traceback
from dataclasses import dataclass, field
from typing import Any

from . import keeping

# sys.exit() in a job, or in a library that it calls, ends an episode and not its worker.
_OF_JOBS = (Exception, SystemExit)
# Of an array of NumPy that becomes a list: all results of a batch are in memory.
MAX_NUMBERS = 1_000_000


class ResultError(Exception):
    """run() returned what no file of results can hold; the text says what, and what would have been right."""


class JobError(Exception):
    """A job cannot be found, or cannot start; the text says why."""


class Job:
    """Base class of jobs; one instance lives in each worker process.

    A subclass takes its parameters as named arguments of __init__, with defaults. The result of an episode must depend
    on parameters and seed alone, because seeds are given to workers in any order.
    """

    def start(self) -> None:
        """Prepare what all episodes share, such as a model or compiled code. Called once, before the first episode."""

    def run(self, seed: int) -> dict[str, Any]:
        """Run one episode; return its results as {name: value that JSON can hold}. seed: int >= 0.

        Numbers and arrays of NumPy count as numbers and lists.
        An exception makes the episode a failed one; the worker continues with the next seed.
        """
        raise NotImplementedError

    def end(self) -> None:
        """Release what start() took. Not called in a worker that died or was stopped."""


@dataclass(frozen=True)
class Spec:
    """Which job: "package.module:Class", and its parameters as {name: value that JSON can hold}."""

    name: str
    parameters: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Outcome:
    """How one episode ended. result is {} and error says why where it failed. seconds: wall time. is_out_of_memory: its
    worker should run no other one."""

    seed: int
    result: dict[str, Any]
    error: str = ""
    seconds: float = 0.0
    is_out_of_memory: bool = False

    @property
    def is_done(self) -> bool:
        return not self.error


def class_of(name: str) -> type[Job]:
    """The class of "package.module:Class". Raises JobError."""
    module, colon, attribute = name.partition(":")
    if not (module and colon and attribute):
        raise JobError("a job is named package.module:Class or by a name of --list, not %r" % name)
    try:
        found = importlib.import_module(module)
    # Code of others, and any text as its name.
    except _OF_JOBS as error:
        raise JobError("job %s: cannot import %s: %s" % (name, module, _text_of(error))) from error
    try:
        found = getattr(found, attribute)
    except AttributeError:
        raise JobError("job %s: module %s has no %s" % (name, module, attribute)) from None
    if not (inspect.isclass(found) and issubclass(found, Job)):
        raise JobError("job %s: %s is no class that derives from lab_batch.Job" % (name, attribute))
    return found


def parameters_of(kind: type[Job]) -> dict[str, Any]:
    """{name: default} of a job's parameters."""
    return {name: one.default for name, one in inspect.signature(kind).parameters.items()
            if one.kind in (one.POSITIONAL_OR_KEYWORD, one.KEYWORD_ONLY)}


def check(spec: Spec) -> type[Job]:
    """Return the class of a job that has these parameters. Raises JobError."""
    kind = class_of(spec.name)
    known = parameters_of(kind)
    unknown = sorted(set(spec.parameters) - set(known))
    if unknown:
        raise JobError("job %s has no parameter %s; it has %s" % (
            spec.name, ", ".join(unknown), ", ".join(known) or "none"))
    return kind


def load(spec: Spec) -> Job:
    """Return an instance of the job that is ready for run(). Raises JobError."""
    kind = check(spec)
    try:
        job = kind(**spec.parameters)
        job.start()
    except _OF_JOBS as error:
        raise JobError("job %s cannot start: %s" % (spec.name, _text_of(error))) from error
    return job


def run_episode(job: Job, seed: int) -> Outcome:
    """Return the Outcome of one episode; an exception of the job is its error, with the line where it was raised."""
    started = time.monotonic()
    is_out_of_memory = False
    try:
        result, text = plain(job.run(seed)), ""
    except ResultError as error:
        result, text = {}, str(error)
    except _OF_JOBS as error:
        text, is_out_of_memory = _text_of(error), _is_of_memory(error)
        if is_out_of_memory:
            # The job may still hold all of it.
            keeping.raise_limit()
        where = traceback.extract_tb(error.__traceback__)[-1]
        result, text = {}, "%s (%s, line %d)" % (text, where.filename, where.lineno)
    return Outcome(seed, result, text, time.monotonic() - started, is_out_of_memory)


def plain(result: dict[Any, Any] | None) -> dict[str, Any]:
    """Return what run() returned as JSON gives it back: tuples are lists, arrays of NumPy as well.

    So a batch that was interrupted has the same results as one that was not. Raises ResultError.
    """
    if not isinstance(result, dict):
        raise ResultError("run() returned %s; a dictionary of results was expected" % type(result).__name__)
    return {name: _plain(name, value) for name, value in result.items()}


def _plain(name: Any, value: Any) -> Any:
    if not isinstance(name, str):
        raise ResultError("run() named a result %r; names are texts, such as 'error_m'" % (name,))
    try:
        return json.loads(json.dumps(value, allow_nan=False, default=_of_numpy))
    except (TypeError, RecursionError) as error:
        text = str(error)
    except ValueError as error:
        text = "%s; None can stand for a number that is NaN or infinite" % error
    raise ResultError("result %r cannot be written as JSON: %s" % (name, text))


def _of_numpy(value: Any) -> Any:
    if getattr(value, "size", 0) > MAX_NUMBERS:
        raise TypeError("it is an array of %d numbers; the most is %d, so write it to a file and return the file's name"
                        % (value.size, MAX_NUMBERS))
    if hasattr(value, "tolist"):
        return value.tolist()
    raise TypeError("it has an object of type %s; numbers, texts, None, lists and dictionaries were expected"
                    % type(value).__name__)


def _text_of(error: BaseException) -> str:
    try:
        text = "%s: %s" % (type(error).__name__, error)
    # A job's exception may have a __str__ that fails.
    except Exception:
        text = type(error).__name__
    limit = resource.getrlimit(resource.RLIMIT_DATA)[0]
    if _is_of_memory(error) and limit != resource.RLIM_INFINITY:
        text = "%s; the limit of memory is %s" % (text.removesuffix(": "), gigabytes(limit))
    return text


def _is_of_memory(error: BaseException) -> bool:
    return isinstance(error, MemoryError) or getattr(error, "errno", None) == errno.ENOMEM


def gigabytes(count: int) -> str:
    """A number of bytes as text: 2.5 GB."""
    return "%.3g GB" % (count / 1e9)
