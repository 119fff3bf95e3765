# SPDX-License-Identifier: BSD-3-Clause
"""Waiting is one line: it counts on a terminal, and is permanent in a log."""
import io

from command_line.waiting_line import WaitingLine


class Terminal(io.StringIO):
    def isatty(self):
        return True


def wait(line, what, seconds):
    for tenth in range(10 * seconds):
        line.say(what, tenth / 10.0)


def test_on_a_terminal_one_line_counts_and_goes():
    terminal = Terminal()
    line = WaitingLine(terminal)
    wait(line, "a master", 3)
    wait(line, "a robot", 2)
    assert "\n" not in terminal.getvalue()
    shown = terminal.getvalue().split("\r\033[K")[1:]
    # Halves are rounded to even numbers.
    assert shown[:3] == ["waiting for a master: 0 s", "waiting for a master: 1 s", "waiting for a master: 2 s"]
    assert shown[-1].startswith("waiting for a robot: ") and len(shown) <= 7
    line.end()
    assert terminal.getvalue().endswith("\r\033[K")
    before = terminal.getvalue()
    line.end()
    assert terminal.getvalue() == before


def test_elsewhere_one_line_stays_however_much_there_is_to_wait_for():
    now_s = [0.0]
    stream = io.StringIO()
    line = WaitingLine(stream, again_after_s=30.0, now=lambda: now_s[0])
    for what in ("a master", "a robot", "a parameter"):
        wait(line, what, 3)
        line.end()
        now_s[0] += 3.0
    assert stream.getvalue() == "waiting for a master ...\n"
    now_s[0] = 31.0
    wait(line, "the clock", 3)
    assert stream.getvalue() == "waiting for a master ...\nwaiting for the clock ...\n"
