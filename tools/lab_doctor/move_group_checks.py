# SPDX-License-Identifier: BSD-3-Clause
"""Problems that keep a running move_group from planning or moving. Pure, like the other checks."""

from collections.abc import Iterable, Iterator

from lab_doctor.facts import MoveGroupFacts
from lab_doctor.findings import Finding, Level

TOPIC = "move_group"
# Number of names that a line lists.
SHOWN = 6


def examine(move_group: MoveGroupFacts) -> list[Finding]:
    if move_group.error:
        what = f"{move_group.node} does not answer: {move_group.error}"
        return [Finding(TOPIC, Level.WRONG, what, f"rosnode ping {move_group.node}; restart it if it does not answer")]
    wrong = [finding for check in (_controllers, _joint_states, _start_state, _octomap)
             for finding in check(move_group)]
    if wrong:
        return wrong
    answering = sum(controller.answers for controller in move_group.controllers)
    what = f"{move_group.node} plans for {_listed(move_group.groups)}; {answering} controllers answer"
    return [Finding(TOPIC, Level.OK, what)]


def _controllers(move_group: MoveGroupFacts) -> Iterator[Finding]:
    if not move_group.executes:
        yield Finding(TOPIC, Level.NOTE, f"{move_group.node} only plans: allow_trajectory_execution is false",
                      "roslaunch its move_group.launch with allow_trajectory_execution:=true")
        return
    for controller in move_group.controllers:
        if not controller.answers:
            what = f"no controller serves {controller.action}, which should move {_listed(controller.joints)}"
            yield Finding(TOPIC, Level.WRONG, what, controller.remedy)
    moved = {joint for controller in move_group.controllers for joint in controller.joints}
    orphans = {}
    for group, joints in move_group.groups.items():
        for joint in joints:
            if joint not in moved:
                orphans.setdefault(joint, group)
    if orphans:
        what = f"no controller moves {_listed(orphans)} of group {_listed(dict.fromkeys(orphans.values()))}: plans for "
        yield Finding(TOPIC, Level.WRONG, what + "it cannot be executed",
                      f"enter the joints in controller_list of {move_group.node}")


def _joint_states(move_group: MoveGroupFacts) -> Iterator[Finding]:
    silent = move_group.silent_joints
    if silent:
        what = f"no message on {move_group.joint_topic} has {_listed(silent)}: the robot's posture is unknown"
        fix = "start a publisher of joint states, or remap joint_states of move_group to its topic"
        yield Finding(TOPIC, Level.WRONG, what, fix)


def _start_state(move_group: MoveGroupFacts) -> Iterator[Finding]:
    for sentence in move_group.joints_out_of_bounds:
        what = f"no plan can start here: {sentence}"
        yield Finding(TOPIC, Level.WRONG, what, "move the joint back by hand or by a program")
    pairs = [f"{a} and {b}" for a, b in move_group.contacts]
    if pairs:
        what = f"no plan can start here: {_listed(pairs)} touch"
        fix = ("move the robot; remove the object (rosservice call /apply_planning_scene); or allow the pair to touch "
               "(disable_collisions in the SRDF)")
        yield Finding(TOPIC, Level.WRONG, what, fix)


def _octomap(move_group: MoveGroupFacts) -> Iterator[Finding]:
    for sensor in move_group.sensors:
        if not sensor.publishers:
            yield Finding(TOPIC, Level.WRONG, f"the octomap gets no data: no node publishes {sensor.topic}",
                          "start the camera, or correct the topic in sensors_3d.yaml")
        elif not sensor.heard:
            yield Finding(TOPIC, Level.WRONG, f"the octomap gets no data: nothing arrives on {sensor.topic} of "
                          f"{_listed(sensor.publishers)}", f"rostopic hz {sensor.topic}; check the camera's node")


def _listed(names: Iterable[str]) -> str:
    names = list(names)
    more = len(names) - SHOWN
    return ", ".join(names[:SHOWN]) + (f" and {more} more" if more > 0 else "")
