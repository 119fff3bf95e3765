# SPDX-License-Identifier: BSD-3-Clause
"""A batch's messages while it runs: how far it is, and that nothing has ended for long."""
import io

from lab_batch import Outcome, command


class Terminal(io.StringIO):
    def isatty(self):
        return True


def progress_of(stream, step_s, count=4):
    """The text that Progress writes when an episode ends every ``step_s`` [s]; the second one fails."""
    now = iter(step_s * k for k in range(count + 1))
    progress = command.Progress(count, stream, lambda: next(now))
    for seed in range(count):
        progress.step(Outcome(seed, {}, "bad" * (seed == 1)))
    progress.end()
    return stream.getvalue()


def test_a_terminal_shows_a_bar_with_rate_and_time_left():
    shown = progress_of(Terminal(), 100.0).split("\r\x1b[K")[1:]
    assert shown[0] == "[%s%s] 1/4, 0 failed, 0.01/s, 05:00 left" % ("#" * 7, "." * 23)
    assert shown[-1] == "[%s] 4/4, 1 failed, 0.01/s, 00:00 left\n" % ("#" * 30)
    # Episodes of 1 ms: the last one alone is shown.
    assert progress_of(Terminal(), 1e-3).count("\r") == 1


def test_a_file_gets_a_line_of_progress_now_and_then():
    lines = progress_of(io.StringIO(), 20.0).splitlines()
    assert lines == ["2/4, 1 failed, 0.05/s, 00:40 left", "4/4, 1 failed, 0.05/s, 00:00 left"]
    assert not progress_of(io.StringIO(), 1.0)


def test_a_long_silence_is_told_in_ever_longer_periods():
    now = [0.0]
    progress = command.Progress(3, io.StringIO(), lambda: now[0])

    def told(until_s):
        lines = []
        while now[0] < until_s:
            now[0] += 1.0
            lines += [(now[0], line) for line in [progress.silence()] if line]
        return lines

    (first, line), (second, _) = told(150.0)
    assert (first, second) == (60.0, 120.0)
    assert line.startswith("batch: no episode has ended for 01:00. If one hangs, --time-limit SECONDS gives it up")
    progress.step(Outcome(0, {}, ""))
    assert [at for at, _ in told(1200.0)] == [900.0], "the first one took 150 s"


def test_durations_have_hours_where_needed():
    assert [command.duration(s) for s in (0.4, 59.6, 123, 3723)] == ["00:00", "01:00", "02:03", "1:02:03"]
