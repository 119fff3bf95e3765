#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Runs the message generators of a configured catkin build in a few processes, instead of one for each file.

catkin starts Python three times for each message: to check what it names, for C++ and for Python. That is most of the
time of a first build. This program reads the same commands from the build folder, and runs those whose results are
missing or old. `make` then finds them done. What fails here is left to `make`, which repeats it with its error.
"""

from __future__ import annotations

import multiprocessing
import os
import re
import runpy
import shlex
import sys
from dataclasses import dataclass, field
from pathlib import Path

RULE = re.compile(r"^(/\S+): (/\S+)$")
COMMAND = re.compile(r"^\tcd \S+ && \S*env_cached\.sh \S+ (/\S+/(gen\w+)\.py (.*))$")
CHECK = "genmsg_check_deps"
# The first line of the build's environment script, and what makes it pass over checks that have been made.
SHEBANG = "#!/usr/bin/env sh\n"
SKIP = 'case "$2" in */genmsg_check_deps.py) exit 0 ;; esac  # tools/generate_messages.py has checked them\n'


@dataclass(frozen=True)
class GeneratorCommand:
    """One generator's command line, its result, and the files that this is made of."""

    words: tuple[str, ...]
    result: str = ""
    sources: tuple[str, ...] = field(default=())

    @property
    def is_for_a_whole_package(self) -> bool:
        return "--initpy" in self.words

    def is_due(self) -> bool:
        """Whether the result is missing or older than a source; a check has no result."""
        if not self.result:
            return True
        try:
            made = os.path.getmtime(self.result)
            return any(os.path.getmtime(source) > made for source in self.sources)
        except OSError:
            return True


def commands_of(build: Path) -> list[GeneratorCommand]:
    """All generators' commands in the makefiles of a build folder."""
    found = []
    for makefile in build.rglob("*_generate_messages_*.dir/build.make"):
        rules: dict[str, list[str]] = {}
        result = ""
        for line in makefile.read_text(encoding="utf-8").splitlines():
            if rule := RULE.match(line):
                result = rule[1]
                rules.setdefault(result, []).append(rule[2])
            elif command := COMMAND.match(line):
                words = tuple(shlex.split(command[1].replace("$$", "$")))
                found.append(GeneratorCommand(words) if command[2] == CHECK
                             else GeneratorCommand(words, result, tuple(rules.get(result, ()))))
    return found


def succeeds(command: GeneratorCommand) -> bool:
    """Run a generator's script in this process."""
    sys.argv = list(command.words)
    # It numbers the variables of the code that it makes, and expects one message a process.
    if generator := sys.modules.get("genpy.generator"):
        generator.reset_var()
    if command.result:
        os.makedirs(os.path.dirname(command.result), exist_ok=True)
    try:
        runpy.run_path(command.words[0], run_name="__main__")
    except SystemExit as ending:
        if ending.code:
            return False
    except Exception:
        return False
    return True


def be_silent() -> None:
    """Write nothing, not even by the template engine, which replaces sys.stdout: make repeats what fails."""
    nothing = os.open(os.devnull, os.O_WRONLY)
    for stream in (1, 2):
        os.dup2(nothing, stream)


def main(build: Path) -> int:
    environment = build / "catkin_generated" / "env_cached.sh"
    due = [command for command in commands_of(build) if command.is_due()]
    failed = 0
    with multiprocessing.Pool(len(os.sched_getaffinity(0)), be_silent) as pool:
        for is_last in (False, True):
            turn = [command for command in due if command.is_for_a_whole_package == is_last]
            for command, is_done in zip(turn, pool.imap(succeeds, turn, chunksize=8), strict=True):
                if not is_done:
                    failed += 1
                    print(f"left to make: {shlex.join(command.words)}")
                    # make must not take a half-written result as finished.
                    if command.result:
                        Path(command.result).unlink(missing_ok=True)
    print(f"{len(due) - failed} of {len(due)} message generators run")
    text = environment.read_text(encoding="utf-8")
    if not failed and text.startswith(SHEBANG) and SKIP not in text:
        environment.write_text(text.replace(SHEBANG, SHEBANG + SKIP, 1), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
