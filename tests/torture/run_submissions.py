# SPDX-License-Identifier: BSD-3-Clause
"""torture.py submissions: what students could send, read and reported as a grading does, in this process and without a
judge. Whatever raises would have cost a submission with a sentence that nobody has thought of."""
import random
import time
import traceback
import warnings

from submissions import content

from rf_checks import diagnosis, similarity
from rf_checks.submission import decoded
from rf_grading import alike, archives, formats, keys, pages, plan, programs, results
from rf_grading.submissions import PROGRAMS, Submission


def run(options, journal):
    """Read one submission after the other; return figures for the result."""
    warnings.simplefilter("ignore", SyntaxWarning)  # of the programs
    exercises, slowest, read = programs.exercises_of(), (0.0, -1), 0
    for number in range(options.first, options.first + options.messages):
        if options.until is not None and time.monotonic() > options.until:
            break
        name, data = content(random.Random("%d/%d" % (options.seed, number)))
        journal.note(number, "submission", name.encode("unicode_escape").decode(), data)
        begin = time.process_time()
        try:
            read += bool(_read(name, data, exercises))
        except Exception:  # noqa: BLE001  (this is what it looks for)
            journal.fail(traceback.format_exc(limit=-3), options.seed, number, 1)
        slowest = max(slowest, (time.process_time() - begin, number))
    return {"also": {"slowest_s": round(slowest[0], 2), "slowest": slowest[1], "with_programs": read}}


def _read(name, data, exercises):
    """Read and report one submission; returns its programs."""
    one = Submission("li", "li")
    if archives.is_archive(name):
        try:
            one.files, one.others = archives.read(data, name, lambda path: path.lower().endswith(PROGRAMS))
        except archives.BadArchive as error:
            one.refuse("%s %s" % (name, error))
    else:
        one.files = {name: data}
    found = programs.assign(one.files, exercises)
    entry = plan.SubmissionEntry(one)
    for path, text in programs.with_notebooks_as_programs(one.files)[0].items():
        diagnosis.check_syntax(text, path)
        alike.fingerprints(decoded(text))
        similarity.opaque_calls(decoded(text))
        similarity.judges_own(decoded(text))
    for exercise, chosen in found.items():
        if isinstance(chosen, programs.Program):
            keys.key("v", exercise, {}, chosen.path, chosen.files)
            entry.keys[exercise.name], entry.paths[exercise.name] = "key", chosen.path
            entry.notes[exercise.name] = chosen.note
        else:
            entry.problems[exercise.name] = one.problem or str(chosen)
    rows = results.rows_of([entry], exercises, {}, {})
    whole = results.Results("class", tuple(exercises), rows, {"seed": 0, "profile": "sim", "serial": 0}, "v",
                            tuple(one.others))
    for write in (formats.as_json, formats.as_csv, formats.as_junit, formats.as_nbgrader):
        write(whole).encode()
    pages.feedback(whole, rows[0], {}).encode()
    pages.overview(whole, None, lambda row: "feedback/li/feedback.html").encode()
    formats.as_gradescope(rows[0]).encode()
    formats.one_line("; ".join(rows[0].sentences)).encode()
    return one.files
