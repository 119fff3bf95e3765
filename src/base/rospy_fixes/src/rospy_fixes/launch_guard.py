# SPDX-License-Identifier: BSD-3-Clause
"""Makes roslaunch refuse a second simulator on a master, before it changes anything.

roslaunch sets parameters first and starts nodes in any order, and each node shuts down an older node of the same name.
Before the second simulator itself could refuse, the first lab would lose its nodes. So we read the launch file. If it
contains a simulator, and another one runs or starts on the master, roslaunch ends at once.
"""
from __future__ import annotations

import contextlib
import sys
from typing import Any

import roslaunch.pmon
from rosgraph.names import ns_join

from master_calls.single_instance import Claim, refusal, refusal_while_starting, running_instance

_PACKAGE, _TYPES = "gazebo_ros", ("gzserver", "gazebo")


def amend(module: Any) -> None:
    """Make every ``ROSLaunchParent`` of the module roslaunch.parent check before it starts anything."""
    parent = module.ROSLaunchParent
    load_config, start_monitor = parent._load_config, parent._start_pm

    def load_and_look(launch):
        load_config(launch)
        launch.simulators = _Simulators(launch.config)
        reason = launch.simulators.reason_against()
        if reason:
            print(reason, file=sys.stderr)
            sys.exit(1)

    def start_and_listen(launch):
        start_monitor(launch)
        if launch.simulators is not None:
            launch.pm.add_process_listener(launch.simulators)

    parent.simulators = None  # unchanged for rostest, which loads its files itself and starts its own masters
    parent._load_config, parent._start_pm = load_and_look, start_and_listen


class _Simulators(roslaunch.pmon.ProcessListener):
    """The simulators in a launch file, and this process's claims to start them."""

    def __init__(self, config: Any) -> None:
        self._master_uri = config.master.uri
        self._nodes = {ns_join(node.namespace, node.name): node for node in config.nodes
                       if node.package == _PACKAGE and node.type in _TYPES}
        self._claims = {name: Claim(name, self._master_uri) for name in self._nodes}

    def reason_against(self) -> str:
        """The message to the user if there is a simulator already; else "", and this process then holds the claim."""
        for name, claim in self._claims.items():
            found = None
            with contextlib.suppress(OSError):  # no master yet: roslaunch starts one
                found = running_instance(name, "/roslaunch_look_up", self._master_uri)
            if found is not None:
                return refusal(name, *found, self._master_uri)
            holder = claim.take()
            if holder is not None:
                return refusal_while_starting(name, holder, self._master_uri)
        return ""

    def process_died(self, process_name: str, exit_code: int) -> None:
        """Release the claim of a simulator that has ended while its launch goes on."""
        name = "/" + process_name.rpartition("-")[0]
        if name in self._claims and not self._nodes[name].respawn:
            self._claims[name].release()
