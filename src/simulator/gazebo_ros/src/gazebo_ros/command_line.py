# SPDX-License-Identifier: BSD-3-Clause
"""The command line of gzserver, as people's launch files write it into ``args``. ROS-free."""
from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import NoReturn

_DESCRIPTION = """The simulator: physics, /clock and the services under /gazebo.

Publishes: /clock, ~model_states, ~link_states, ~contacts, ~parameter_updates, /diagnostics, and what the models'
plugins publish.
Subscribes: ~set_model_state, ~set_link_state, ~drag, and what the plugins subscribe to.
Services: ~spawn_urdf_model, ~spawn_sdf_model, ~delete_model, ~get_model_state, ~set_model_state, ~pause_physics,
~unpause_physics, ~reset_world, ~advance and others; rosservice list /gazebo shows them all.
Parameters: ~world_name, ~paused, ~seed, ~clock_rate [Hz], ~real_time_factor (0: as fast as possible), ~model_plugins (a
table of further plugins). It sets ~snapshot and, where it is not set, /use_sim_time.
"""
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

    def __init__(self, arguments: Sequence[str]) -> None:
        """``arguments``: list of words without the program's name and without ROS's remappings.

        Raises ``ValueError`` that says what is wrong.
        """
        parser = _Parser(description=_DESCRIPTION, formatter_class=argparse.RawDescriptionHelpFormatter,
                         allow_abbrev=False, epilog="Gazebo's other options are accepted, without effect.")
        parser.add_argument("world_name", nargs="?", help="a world file (SDF); default: the parameter's")
        parser.add_argument("-u", "--pause", action="store_true", help="start paused")
        parser.add_argument("--seed", type=int, help="seed of the world's random numbers")
        parser.add_argument("--verbose", action="store_true", help=argparse.SUPPRESS)
        # Of empty_world.launch, which starts the renderer as a node, or not at all. No parameter: that would stay on
        # the master.
        parser.add_argument("--no-renderer", action="store_true", help="start no sensor_renderer for the first camera")
        for names, takes_value in _WITHOUT_EFFECT:
            parser.add_argument(*names, dest=names[-1], action="append" if takes_value else "store_true",
                                help=argparse.SUPPRESS)
        options, unknown = parser.parse_known_args(arguments)
        self.world_name = options.world_name
        self.paused = options.pause
        self.seed = options.seed
        self.starts_renderer = not options.no_renderer
        self.ignored = [names[-1] for names, _ in _WITHOUT_EFFECT if getattr(options, names[-1])] + unknown


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise ValueError("the command line of the simulator: %s; expected [WORLD_FILE] [-u] [--seed NUMBER]" % message)
