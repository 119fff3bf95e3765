# SPDX-License-Identifier: BSD-3-Clause
"""The words that launch files hand to gzserver."""
import pytest

from gazebo_ros.command_line import CommandLine


def said(*words):
    line = CommandLine(list(words))
    return line.world_name, line.paused, line.seed, line.ignored


@pytest.mark.parametrize(("words", "meant"), [
    ((), (None, False, None, [])),
    (("lab.world",), ("lab.world", False, None, [])),
    (("-u", "lab.world", "--verbose"), ("lab.world", True, None, [])),
    (("--pause", "--seed", "3"), (None, True, 3, [])),
    (("-s", "libgazebo_ros_init.so", "-e", "ode", "lab.world"), ("lab.world", False, None,
                                                                  ["--server-plugin", "--physics"])),
    (("lab.world", "--shine", "-r"), ("lab.world", False, None, ["--record", "--shine"])),
])
def test_what_words_mean(words, meant):
    assert said(*words) == meant


@pytest.mark.parametrize("words", [("--seed", "x"), ("--seed",), ("-s",)])
def test_what_is_wrong_is_said_in_one_line(words):
    with pytest.raises(ValueError, match="command line of the simulator: .*expected .WORLD_FILE") as raised:
        said(*words)
    assert "\n" not in str(raised.value)


def test_the_launch_file_that_has_a_renderer_says_so():
    assert CommandLine([]).starts_renderer
    line = CommandLine(["--no-renderer", "lab.world"])
    assert (line.starts_renderer, line.world_name, line.ignored) == (False, "lab.world", [])
