# SPDX-License-Identifier: BSD-3-Clause
"""The doctor's facts: plain data, gathered by probe.py, judged by checks.py. None: unknown."""

from dataclasses import dataclass, field


@dataclass(frozen=True)
class Master:
    """Data from the ROS master. error is empty if it answered."""

    error: str = ""
    use_sim_time: bool = False
    publishers: dict[str, list[str]] = field(default_factory=dict)  # topic -> nodes
    # Simulator nodes that are registered and do not answer.
    dead_nodes: list[str] = field(default_factory=list)
    # Nodes that accept connections and have not answered in time.
    slow_nodes: list[str] = field(default_factory=list)
    clock_offset_s: float | None = None  # the master's host minus this machine


@dataclass(frozen=True)
class TopicFacts:
    """Messages on the robot's topics while we listened."""

    clock_messages: int = 0
    clock_advanced: bool = False
    robot_state: dict[str, bool | int] | None = None  # fields of baxter_core_msgs/AssemblyState
    # Problems that the simulator reports on /diagnostics: (name, level, message).
    troubles: list[tuple[str, int, str]] = field(default_factory=list)
    error: str = ""


@dataclass(frozen=True)
class ControllerFacts:
    """An entry of move_group's controller_list: its action, its joints, whether the action has a server, and what would
    help where it has none."""

    action: str
    joints: list[str]
    answers: bool
    remedy: str = ""


@dataclass(frozen=True)
class Sensor:
    """A sensor for move_group's octomap: its topic, its publishers, and whether a message has arrived."""

    topic: str
    publishers: list[str]
    heard: bool


@dataclass(frozen=True)
class MoveGroupFacts:
    """Facts from a running move_group and its parameters. error: why it did not answer, empty if it did."""

    node: str
    error: str = ""
    robot: str = ""
    executes: bool = True  # ~allow_trajectory_execution
    groups: dict[str, list[str]] = field(default_factory=dict)  # joints that move, without those that mimic others
    controllers: list[ControllerFacts] = field(default_factory=list)
    joint_topic: str = ""
    silent_joints: list[str] = field(default_factory=list)  # the robot's joints that no message on joint_topic has
    joints_out_of_bounds: list[str] = field(default_factory=list)  # sentences
    contacts: list[tuple[str, str]] = field(default_factory=list)  # bodies in contact at the present posture
    sensors: list[Sensor] = field(default_factory=list)


@dataclass(frozen=True)
class PythonFacts:
    """The Python that runs nodes: its path, the version of each import, and the error of each that failed."""

    executable: str = ""
    versions: dict[str, str] = field(default_factory=dict)
    errors: dict[str, str] = field(default_factory=dict)
    debian_numpy: str = ""  # the version of Debian's own


@dataclass(frozen=True)
class SetUp:
    """A set-up that has not ended: its step, the last line of that step's log, and whether it runs or was cut off.

    place: the step's, as "6 of 9"; since_s: the time since the step began; title: what set-up calls it.
    """

    step: str
    last_line: str = ""
    is_running: bool = True
    place: str = ""
    since_s: int = 0
    title: str = ""


@dataclass(frozen=True)
class SetupFailure:
    """The error that ended the last set-up, and the step in which it did."""

    step: str
    cause: str


@dataclass(frozen=True)
class OtherMaster:
    """A ROS master of this machine at another port than ROS_MASTER_URI's."""

    uri: str
    has_simulator: bool


@dataclass(frozen=True)
class Listener:
    """A process that accepts connections from other machines."""

    process: str
    pid: int
    address: str
    port: int


@dataclass(frozen=True)
class Facts:
    root: str
    variables: dict[str, str]
    # host name or address -> (resolved address or None, whether that address belongs to this machine)
    addresses: dict[str, tuple[str | None, bool]] = field(default_factory=dict)
    master: Master | None = None
    topics: TopicFacts | None = None
    move_group: MoveGroupFacts | None = None  # also None if no move_group runs
    is_built: bool = False
    own_packages: list[str] = field(default_factory=list)  # sentences about their package.xml
    is_fresh: bool | None = None
    set_up: SetUp | None = None  # None: the last one ended, or there was none
    was_set_up: bool = True  # whether a set-up has been completed
    failure: SetupFailure | None = None
    python: PythonFacts | None = None
    # Path of `python3` outside the lab's environment, if it is not the system's.
    users_python: str = ""
    other_masters: list[OtherMaster] = field(default_factory=list)
    # Nodes that answer calls and take no connections any more.
    deaf_nodes: list[str] = field(default_factory=list)
    # Questions that were not answered in time: names of the fields above.
    timed_out: frozenset[str] = frozenset()
    listeners: list[Listener] | None = None
    display: str = ""
