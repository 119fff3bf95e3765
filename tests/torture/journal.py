# SPDX-License-Identifier: BSD-3-Clause
"""Records sent messages and failures in files that survive a crash, and prints the command that repeats a failure. No
ROS needed."""
import collections
import json
import time
from pathlib import Path

SHOWN = 160
REMEMBERED = 50


class Skip(Exception):
    """The test cannot run on this machine; the text gives the reason."""


class Journal:
    """Lines of JSON in ``sent.jsonl`` and ``failures.jsonl`` of a folder."""

    def __init__(self, folder, command, echo=print):
        """command: of the run, e.g. "fuzz"; echo: called with the text of each failure."""
        self._folder, self._command, self.echo = Path(folder), command, echo
        self._folder.mkdir(parents=True, exist_ok=True)
        self._sent = (self._folder / "sent.jsonl").open("w", buffering=1, encoding="utf-8")
        self._last = collections.deque(maxlen=REMEMBERED)
        self.failures = []
        self.sent = 0

    def note(self, index, target, style, value):
        """Record a message before it is sent, so that the last line names the message that ended the lab."""
        self.sent += 1
        self._last.append("%s %s" % (target, shortened(value)))
        self._sent.write(json.dumps([index, target, style, shortened(value)]) + "\n")

    def last(self, count):
        """Texts of the last entries, oldest first."""
        return list(self._last)[-count:]

    def fail(self, text, seed, first, count):
        """Record a failure after messages first .. first + count - 1 of a seed."""
        again = "rosrun workspace_tests torture.py %s --seed %d --first %d --messages %d" % (
            self._command, seed, first, count)
        failure = {"text": text, "seed": seed, "first": first, "count": count, "again": again, "time": time.time()}
        self.failures.append(failure)
        with (self._folder / "failures.jsonl").open("a", encoding="utf-8") as stream:
            stream.write(json.dumps(failure) + "\n")
        self.echo("FAILED: %s\n  seed %d, messages %d to %d; again: ./baxter.sh sim %s" % (
            text, seed, first, first + count - 1, again))

    def finish(self, **figures):
        """Write ``result.json`` and return its content."""
        self._sent.close()
        result = {"command": self._command, "sent": self.sent, "failures": self.failures, **figures}
        (self._folder / "result.json").write_text(json.dumps(result, indent=1), encoding="utf-8")
        return result


def shortened(value):
    """A value's text, of bounded length."""
    if isinstance(value, dict):
        return {name: shortened(one) for name, one in value.items()}
    text = repr(value[:SHOWN] if isinstance(value, str | bytes | list | tuple) else value)
    return text if len(text) <= SHOWN else text[:SHOWN] + "…"


def report(result):
    """The last lines of a run's output. result: as `Journal.finish` returns it."""
    hours, sent, failures = result.get("simulated_s", 0.0) / 3600.0, result["sent"], len(result["failures"])
    if failures:
        per_failure = "%d: one in %.0f messages, one in %.2f simulated hours" % (
            failures, sent / failures, hours / failures)
    else:
        per_failure = "none in %d messages and %.2f simulated hours" % (sent, hours)
    lines = ["%s, seed %d: %d messages, %.2f simulated hours" % (result["command"], result["seed"], sent, hours),
             "failures: " + per_failure]
    lines += ["%s: %s" % (name.replace("_", " "), value) for name, value in sorted(result.get("also", {}).items())]
    return "\n".join(lines)
