# SPDX-License-Identifier: BSD-3-Clause
"""From facts to findings: one function for each kind of problem in a lab. Pure: no clock, no network, no ROS."""

from collections.abc import Iterator
from urllib.parse import urlparse

from lab_doctor import move_group_checks
from lab_doctor.facts import Facts, Master
from lab_doctor.findings import Finding, Level

# tf refuses to look up transforms this far in the future or the past of its buffer; well before that, arms lag visibly.
MAX_CLOCK_OFFSET_S = 0.25
# Topics that exactly one node may publish: two simulators, or a simulator on the robot's own master.
SIMULATOR_TOPICS = ("/clock", "/robot/joint_states")
# Largest number of processes named in a line.
NAMES_SHOWN = 3
ERROR_LEVEL = 2  # of a diagnostic_msgs/DiagnosticStatus
START_LINE = "./baxter.sh sim roslaunch baxter_gazebo baxter_world.launch"


def is_loopback(host: str) -> bool:
    return host in ("localhost", "::1") or host.startswith("127.")


def master_host(facts: Facts) -> str:
    return urlparse(facts.variables.get("ROS_MASTER_URI", "")).hostname or ""


def _entry(facts: Facts) -> str:
    """The command that enters the workspace for this master."""
    host = master_host(facts)
    return "./baxter.sh sim" if not host or is_loopback(host) else f"./baxter.sh {host}"


#: What needs the build, while it is made.
_LATER = "not checked: set-up is running", "ask again when it has ended"


def _busy(topic: str, what: str) -> Finding:
    """A question without an answer in time gives no other finding."""
    return Finding(topic, Level.BUSY, f"not checked: {what}", "the machine is busy; try again when it is idle")


def _is_setting_up(facts: Facts) -> bool:
    return facts.set_up is not None and facts.set_up.is_running


def check_build(facts: Facts) -> Iterator[Finding]:
    if facts.set_up is not None:
        log = f"{facts.root}/.baxter/logs/{facts.set_up.step}.log"
    if facts.set_up is not None and facts.set_up.is_running:
        place = f" ({facts.set_up.place}, since {facts.set_up.since_s} s)" if facts.set_up.place else ""
        line = facts.set_up.last_line or "it has just begun"
        what = f"set-up is running, in step '{facts.set_up.title or facts.set_up.step}'{place}: {line}"
        yield Finding("build", Level.BUSY, what, f"wait until it has ended; tail -f {log} shows what it does")
    elif facts.set_up is not None:
        what = f"the last set-up was cut off in step '{facts.set_up.step}' (log: {log})"
        yield Finding("build", Level.WRONG, what, "./baxter.sh setup")
    elif facts.failure is not None and not facts.was_set_up:
        what = f"the last set-up failed in step '{facts.failure.step}': {facts.failure.cause}"
        yield Finding("build", Level.WRONG, what, "mend that, then ./baxter.sh setup")
    elif not facts.is_built:
        what = "the workspace is not built" if facts.was_set_up else "the workspace has not been set up yet"
        yield Finding("build", Level.WRONG, what, "./baxter.sh setup")
    elif "is_fresh" in facts.timed_out:
        yield _busy("build", "reading all packages takes too long")
    elif not facts.was_set_up:
        what = "no set-up has been completed with the present packages"
        yield Finding("build", Level.WRONG, what, "./baxter.sh setup")
    elif facts.is_fresh is False:
        what = "packages, messages, requirements or inner loops have changed since the last set-up"
        yield Finding("build", Level.WRONG, what, "./baxter.sh setup")
    else:
        yield Finding("build", Level.OK, f"{facts.root} is built and up to date")


def check_own_packages(facts: Facts) -> Iterator[Finding]:
    for sentence in facts.own_packages:
        yield Finding("packages", Level.WRONG, sentence.partition(". Mend")[0], "mend that file")


def check_python(facts: Facts) -> Iterator[Finding]:
    python = facts.python
    if facts.users_python:
        what = (f"outside ./baxter.sh, python3 is {facts.users_python}: programs started there find no rospy")
        yield Finding("python", Level.NOTE, what, f"start them with {_entry(facts)}, or source devel/setup.bash first")
    if not facts.is_built or facts.set_up is not None:
        return  # set-up, which the missing build asks for, makes Python's environment, too
    if "python" in facts.timed_out:
        yield _busy("python", "python3 has not finished importing what nodes import")
        return
    if python is None:
        yield Finding("python", Level.WRONG, "python3 cannot be run", "./baxter.sh setup")
        return
    expected = f"{facts.root}/.venv/bin/python3"
    if python.executable != expected:
        what = f"nodes run on {python.executable or 'no python3'}, not on {expected}"
        yield Finding("python", Level.WRONG, what, "./baxter.sh setup, then enter with ./baxter.sh")
        return
    for module, error in python.errors.items():
        yield Finding("python", Level.WRONG, f"cannot import {module}: {error}", "./baxter.sh setup")
    numpy = python.versions.get("numpy", "")
    if numpy and python.debian_numpy and numpy.split(".")[0] != python.debian_numpy.split(".")[0]:
        what = f"numpy is {numpy}; cv_bridge here is compiled for Debian's own, {python.debian_numpy}"
        yield Finding("python", Level.WRONG, what, "pip uninstall numpy, then ./baxter.sh setup")
    elif not python.errors:
        yield Finding("python", Level.OK, f"{expected}, numpy {numpy}")


def check_network(facts: Facts) -> Iterator[Finding]:
    """ROS_MASTER_URI, ROS_HOSTNAME, ROS_IP: can other machines connect to the address that we announce?"""
    uri = facts.variables.get("ROS_MASTER_URI", "")
    parts = urlparse(uri)
    try:
        port = parts.port
    except ValueError:
        port = None
    if parts.scheme != "http" or not parts.hostname or not port:
        what = f"ROS_MASTER_URI is '{uri}', which is not of the form http://HOST:PORT"
        yield Finding("network", Level.WRONG, what, "export ROS_MASTER_URI=http://localhost:11311, or ./baxter.sh HOST")
        return
    robot = parts.hostname
    name = facts.variables.get("ROS_HOSTNAME", "")
    ip = facts.variables.get("ROS_IP", "")
    if name and ip:
        what = f"ROS_HOSTNAME={name} and ROS_IP={ip} are both set; ROS uses ROS_HOSTNAME"
        yield Finding("network", Level.NOTE, what, "unset the one that you do not mean")
    variable, announced = ("ROS_HOSTNAME", name) if name else ("ROS_IP", ip)
    if robot in facts.addresses and facts.addresses[robot][0] is None:
        what = f"the master's host name {robot} does not resolve"
        fix = f"add a line 'ADDRESS {robot}' to /etc/hosts, or ./baxter.sh ADDRESS"
        yield Finding("network", Level.WRONG, what, fix)
    if not announced:
        what = "neither ROS_IP nor ROS_HOSTNAME is set: nodes announce this machine's name, and others must resolve it"
        yield Finding("network", Level.NOTE, what, f"{_entry(facts)} sets the right one")
        return
    address, is_ours = facts.addresses.get(announced, (None, False))
    if is_loopback(announced) and not is_loopback(robot):
        what = f"{variable}={announced}, but the master is on {robot}, which cannot call this machine by that name"
        yield Finding("network", Level.WRONG, what, f"unset {variable}, then {_entry(facts)}")
    elif address is None:
        what = f"{variable}={announced} does not resolve to an address: messages will not arrive"
        yield Finding("network", Level.WRONG, what, f"unset {variable}, then {_entry(facts)}")
    elif not is_ours:
        what = f"{variable}={announced} is {address}, which is not an address of this machine: messages will not arrive"
        yield Finding("network", Level.WRONG, what, f"unset {variable}, then {_entry(facts)}")
    else:
        yield Finding("network", Level.OK, f"{variable}={announced} is this machine")


def check_master(facts: Facts) -> Iterator[Finding]:
    uri = facts.variables.get("ROS_MASTER_URI", "")
    if not master_host(facts):
        return  # check_network says so
    if "master" in facts.timed_out and is_loopback(master_host(facts)):
        what = f"a program listens at {uri} and has not answered"
        yield Finding("master", Level.BUSY, what, "a stopped or hung master, or a busy machine: try again")
    elif is_loopback(master_host(facts)) and (facts.master is None or facts.master.error) and not facts.is_built:
        yield Finding("master", Level.NOTE, f"{uri} does not answer: no lab runs yet", "first set up")
    elif facts.master is None:
        yield Finding("master", Level.WRONG, f"{uri} did not answer in time", _master_fix(facts))
    elif facts.master.error:
        yield Finding("master", Level.WRONG, f"{uri} does not answer: {facts.master.error}", _master_fix(facts))
    else:
        yield Finding("master", Level.OK, f"{uri} answers")
        labs = [other.uri for other in facts.other_masters if other.has_simulator]
        if labs and not any(facts.master.publishers.get(topic) for topic in SIMULATOR_TOPICS):
            what = f"no simulator runs at this master; one runs at {', '.join(labs)}"
            yield Finding("master", Level.NOTE, what, f"ROS_MASTER_URI={labs[0]} ./baxter.sh sim")


def _master_fix(facts: Facts) -> str:
    host = master_host(facts)
    if is_loopback(host):
        others = sorted(facts.other_masters, key=lambda other: not other.has_simulator)
        if others:
            kind = "a lab" if others[0].has_simulator else "a master"
            uri = others[0].uri
            return f"there is {kind} at {uri}: ROS_MASTER_URI={uri} ./baxter.sh sim; or {START_LINE}"
        return f"start the lab: {START_LINE}"
    return f"is {host} on, and does `ping {host}` answer? For the simulator on this machine: ./baxter.sh sim"


def _answering(facts: Facts) -> Master | None:
    """The master, None where it does not answer."""
    return None if facts.master is None or facts.master.error else facts.master


def check_clock(facts: Facts) -> Iterator[Finding]:
    master = _answering(facts)
    if master is None:
        return
    offset = master.clock_offset_s
    if offset is not None and abs(offset) > MAX_CLOCK_OFFSET_S:
        ahead = "ahead of" if offset > 0 else "behind"
        what = f"the clock of {master_host(facts)} is {abs(offset):.1f} s {ahead} this one's: tf will refuse its data"
        fix = "let both use one time server: sudo timedatectl set-ntp true, or chrony"
        yield Finding("clock", Level.WRONG, what, fix)
    topics = facts.topics
    if topics is None or topics.error:
        return
    if master.use_sim_time and not topics.clock_messages:
        what = "use_sim_time is true and nothing arrives on /clock: every node that sleeps or waits hangs"
        fix = f"start the simulator ({START_LINE}), or without one: rosparam set use_sim_time false"
        yield Finding("clock", Level.WRONG, what, fix)
    elif master.use_sim_time and not topics.clock_advanced:
        what = "simulation time stands still: the simulator is paused"
        yield Finding("clock", Level.WRONG, what, "rosservice call /gazebo/unpause_physics")
    elif master.use_sim_time:
        yield Finding("clock", Level.OK, "simulation time advances")
    elif topics.clock_messages:
        what = "a simulator publishes /clock, but use_sim_time is not set: nodes mix two kinds of time"
        yield Finding("clock", Level.WRONG, what, "rosparam set use_sim_time true, and start the nodes again")
    else:
        yield Finding("clock", Level.OK, "wall time")


def check_simulators(facts: Facts) -> Iterator[Finding]:
    master = _answering(facts)
    if master is None:
        return
    for topic in SIMULATOR_TOPICS:
        nodes = master.publishers.get(topic, [])
        if len(nodes) > 1:
            what = f"{len(nodes)} nodes publish {topic}: {', '.join(sorted(nodes))}"
            fix = f"keep one of them and stop the others: rosnode kill {sorted(nodes)[-1]}"
            yield Finding("simulator", Level.WRONG, what, fix)
    for node in master.slow_nodes:
        yield _busy("simulator", f"{node} has not answered")
    for node in master.dead_nodes:
        what = f"{node} is registered at the master and does not answer: it died without signing off"
        yield Finding("simulator", Level.WRONG, what, "rosnode cleanup (answer y), or stop the lab and start it again")


def check_nodes(facts: Facts) -> Iterator[Finding]:
    for node in facts.deaf_nodes:
        what = f"{node} runs and takes no connections any more: no new subscriber, no call of a service"
        yield Finding("nodes", Level.WRONG, what, f"rosnode kill {node}, then start it, or the lab, again")


def check_troubles(facts: Facts) -> Iterator[Finding]:
    """Errors that the lab survived: a failed plugin is stopped; a dropped message, or a thread that was restarted, does
    no harm."""
    if facts.topics is None:
        return
    for name, level, message in facts.topics.troubles:
        failed = level >= ERROR_LEVEL
        level = Level.WRONG if failed else Level.NOTE
        fix = "rosservice call /gazebo/reset_world {}" if failed else "rostopic echo -n 1 /diagnostics says which"
        yield Finding("simulator", level, f"{name}: {message}", fix)


def check_robot(facts: Facts) -> Iterator[Finding]:
    if _answering(facts) is None:
        return
    if "topics" in facts.timed_out:
        yield _busy("robot", "the program that reads /clock and /robot/state has not started in time")
    if facts.topics is None:
        return
    state = facts.topics.robot_state
    if facts.topics.error and _is_setting_up(facts):
        yield Finding("robot", Level.BUSY, *_LATER)
    elif facts.topics.error:
        yield Finding("robot", Level.WRONG, f"cannot listen: {facts.topics.error}", "./baxter.sh setup")
    elif state is None and facts.move_group is not None and facts.move_group.robot not in ("", "baxter"):
        return  # another robot, which has no such topic
    elif state is None:
        what = "nothing arrives on /robot/state: no robot and no simulator, or none that can call this machine"
        yield Finding("robot", Level.WRONG, what, f"fix the problems above, or start the lab: {START_LINE}")
    elif state["stopped"] and state["error"]:
        what = "the robot has failed and is stopped: its own program, or a motor board"
        yield Finding("robot", Level.WRONG, what, "rosrun baxter_tools enable_robot.py -r, then -e")
    elif state["stopped"]:
        what = "the robot was stopped (emergency stop, or enable_robot.py -S)"
        fix = "release the stop button, then rosrun baxter_tools enable_robot.py -r, and -e"
        yield Finding("robot", Level.WRONG, what, fix)
    elif state["error"]:
        what = "the robot reports an error"
        yield Finding("robot", Level.WRONG, what, "rosrun baxter_tools enable_robot.py -r, then -e")
    elif not state["enabled"]:
        what = "the robot is not enabled: it ignores motion commands"
        yield Finding("robot", Level.NOTE, what, "rosrun baxter_tools enable_robot.py -e")
    else:
        yield Finding("robot", Level.OK, "enabled")


def check_move_group(facts: Facts) -> Iterator[Finding]:
    if "move_group" in facts.timed_out:
        yield _busy("move_group", "move_group, or a service of it, has not answered")
    if facts.move_group is not None and facts.move_group.error and _is_setting_up(facts):
        yield Finding("move_group", Level.BUSY, *_LATER)
    elif facts.move_group is not None:
        yield from move_group_checks.examine(facts.move_group)


def check_ports(facts: Facts) -> Iterator[Finding]:
    """Only if everything should stay on this machine; a robot must be able to reach us."""
    if not is_loopback(master_host(facts)):
        return
    if "listeners" in facts.timed_out:
        yield _busy("ports", "listing all ports takes too long")
    if facts.listeners is None:
        return
    if not facts.listeners:
        yield Finding("ports", Level.OK, "no ROS process listens beyond this machine")
        return
    names = sorted({one.process for one in facts.listeners})
    more = len(names) - NAMES_SHOWN
    shown = ", ".join(names[:NAMES_SHOWN]) + (f" and {more} more" if more > 0 else "")
    what = f"other machines can reach {shown}; docs/security.md says why, and has the firewall's line"
    yield Finding("ports", Level.NOTE, what)


def check_display(facts: Facts) -> Iterator[Finding]:
    if not facts.display:
        what = "DISPLAY is not set: rviz cannot start, and the lab goes on without its window"
        yield Finding("display", Level.NOTE, what, "work in a desktop session, or log in with ssh -X")


CHECKS = (
    check_build,
    check_own_packages,
    check_python,
    check_network,
    check_master,
    check_clock,
    check_simulators,
    check_nodes,
    check_troubles,
    check_robot,
    check_move_group,
    check_ports,
    check_display,
)


def examine(facts: Facts) -> list[Finding]:
    return [finding for check in CHECKS for finding in check(facts)]
