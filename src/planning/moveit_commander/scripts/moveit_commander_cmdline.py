#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""A shell for planning and moving: commands from the keyboard, or from standard input. `help` lists them."""
import argparse
import contextlib
import readline
import sys

import rospy

from moveit_commander import MoveGroupCommandInterpreter, MoveGroupInfoLevel

COLOURS = {MoveGroupInfoLevel.FAIL: "\033[91m", MoveGroupInfoLevel.WARN: "\033[93m",
           MoveGroupInfoLevel.SUCCESS: "\033[92m", MoveGroupInfoLevel.INFO: "\033[94m",
           MoveGroupInfoLevel.DEBUG: "\033[90m"}
END = "\033[0m"


class Completer:
    """Completes words by what the interpreter knows at that place."""

    def __init__(self, interpreter: MoveGroupCommandInterpreter) -> None:
        self._interpreter = interpreter
        self._found: list[str] = []

    def __call__(self, text: str, state: int) -> str | None:
        if state == 0:
            keywords = self._interpreter.get_keywords()
            before = readline.get_line_buffer()[:readline.get_begidx()].split()
            words = keywords.get(before[0], []) if before else keywords
            self._found = sorted(word for word in words if word.startswith(text))
        return self._found[state] if state < len(self._found) else None


def parse_arguments(argv: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="moveit_commander_cmdline.py", description=__doc__,
                                     epilog="Exit status: 0, or 1 when a command that was read from a file failed.")
    parser.add_argument("-i", "--interactive", action="store_true", help="go on with the keyboard after -f")
    parser.add_argument("-f", "--file", metavar="FILE", help="carry out the commands in a file first")
    parser.add_argument("group_name", nargs="?", help="use this group")
    return parser.parse_args(argv)


def show(level: int, answer: str, coloured: bool) -> None:
    if answer:
        print(COLOURS[level] + answer + END if coloured else answer)


def read_commands(interpreter: MoveGroupCommandInterpreter, prompts: bool) -> bool:
    """Carry out commands until there are no more; return whether all succeeded. prompts: from a keyboard?"""
    fine = True
    while not rospy.is_shutdown():
        group = interpreter.get_active_group()
        try:
            command = input("%s> " % (group.get_name() if group else "") if prompts else "")
        except EOFError:
            break
        level, answer = interpreter.execute(command)
        if answer == "quit":
            break
        show(level, answer, prompts)
        fine = fine and level != MoveGroupInfoLevel.FAIL
    return fine or prompts


def main(argv: list[str]) -> int:
    arguments = parse_arguments(argv)
    rospy.init_node("move_group_interface_cmdline", anonymous=True, disable_signals=True)
    interpreter = MoveGroupCommandInterpreter()
    prompts = sys.stdin.isatty()
    if prompts:
        readline.set_completer(Completer(interpreter))
        readline.parse_and_bind("tab: complete")
    for command in filter(None, [arguments.group_name and "use " + arguments.group_name,
                                 arguments.file and "load " + arguments.file]):
        level, answer = interpreter.execute(command)
        show(level, answer, prompts)
        if level == MoveGroupInfoLevel.FAIL:
            return 1
    if arguments.file and not arguments.interactive:
        return 0
    return 0 if read_commands(interpreter, prompts) else 1


if __name__ == "__main__":
    with contextlib.suppress(KeyboardInterrupt):
        sys.exit(main(rospy.myargv()[1:]))
