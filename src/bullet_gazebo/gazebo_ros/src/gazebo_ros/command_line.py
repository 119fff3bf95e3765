# SPDX-License-Identifier: BSD-3-Clause
"""The command line of gzserver, as people's launch files write it into ``args``. ROS-free."""
import argparse

# Options of Gazebo's gzserver: those with a value, and switches that can be ignored without a warning.
_WITHOUT_EFFECT = (
    (("-s", "--server-plugin"), True), (("-g", "--gui-plugin"), True), (("-e", "--physics"), True),
    (("-p", "--play"), True), (("--record_path",), True), (("--record_encoding",), True), (("--record_filter",), True),
    (("--record_period",), True), (("--iters",), True), (("--initial_sim_time",), True), (("-o", "--profile"), True),
    (("-r", "--record"), False), (("--minimal_comms",), False), (("--lockstep",), False))


class CommandLine:
    """The parsed command line: ``world_name`` and ``seed`` or None, ``paused``, ``starts_renderer`` (whether this
    process sees to it that cameras are drawn), and ``ignored``, a list of words.
    """

    def __init__(self, arguments):
        """``arguments``: list of words without the program's name and without ROS's remappings.

        Raises ``ValueError`` that says what is wrong.
        """
        parser = _Parser(add_help=False, allow_abbrev=False)
        parser.add_argument("world_name", nargs="?")
        parser.add_argument("-u", "--pause", action="store_true")
        parser.add_argument("--seed", type=int)
        parser.add_argument("--verbose", action="store_true")
        # Of empty_world.launch, which starts the renderer as a node, or not at all. No parameter: that would stay on
        # the master.
        parser.add_argument("--no-renderer", action="store_true")
        for names, takes_value in _WITHOUT_EFFECT:
            parser.add_argument(*names, dest=names[-1], action="append" if takes_value else "store_true")
        options, unknown = parser.parse_known_args(arguments)
        self.world_name = options.world_name
        self.paused = options.pause
        self.seed = options.seed
        self.starts_renderer = not options.no_renderer
        self.ignored = [names[-1] for names, _ in _WITHOUT_EFFECT if getattr(options, names[-1])] + unknown


class _Parser(argparse.ArgumentParser):
    def error(self, message):
        raise ValueError("the command line of the simulator: %s; expected [WORLD_FILE] [-u] [--seed NUMBER]" % message)
