# SPDX-License-Identifier: BSD-3-Clause
"""Which controllers may run: one test for each rule of loading, unloading and switching."""
import subprocess
import sys

import pytest
from std_msgs.msg import Empty

from controller_manager import (
    EFFORT,
    JOINT_STATE,
    POSITION,
    VELOCITY,
    Controller,
    ControllerError,
    Refused,
    SwitchResult,
)
from controller_manager.manager import BEST_EFFORT, STRICT, ControllerManager
from controller_manager.testing import FakeHardware, fake_context
from loop_ros.testing import FakeLog

DT = 0.002
ROS = ("rospy", "actionlib", "sensor_msgs", "std_msgs", "controller_manager_msgs", "control_msgs")


class Recorder(Controller):
    """Writes down what is called. Parameters: ``position``, ``velocity``, ``effort`` joints, ``fails_in``."""

    def __init__(self, name, hardware, context):
        super().__init__(name, hardware, context)
        for key, interface in (("position", POSITION), ("velocity", VELOCITY), ("effort", EFFORT)):
            if context.param(key):
                self.claim(interface, context.param(key))
        if not self.claims:
            self.observe(JOINT_STATE)
        self.calls = []
        self._note("init")

    def _note(self, call):
        if self.context.param("fails_in") == call:
            raise self.context.param("error", ValueError)("broken on purpose")
        self.calls.append(call)

    def starting(self, time_s):
        self._note("starting")

    def update(self, time_s, dt):
        self._note("update")
        for interface, joints in self.claims.items():
            if interface != JOINT_STATE:
                self.hardware.command[interface][self.hardware.index(interface, joints, self.name)] = 1.0

    def stopping(self, time_s):
        self._note("stopping")

    def close(self):
        self._note("close")


class SlowHardware(FakeHardware):
    """Hardware that needs its time to change controllers."""

    def __init__(self, joints):
        super().__init__(joints)
        self.prepares = True
        self.result = SwitchResult.DONE
        self.ready = set()
        self.switches, self.held, self.released = [], [], []
        self.fails = False

    def hold(self, claims):
        super().hold(claims)
        self.held.append(claims)

    def let_go(self, claims):
        self.released.append(claims)

    def prepare_switch(self, start, stop):
        return self.prepares

    def do_switch(self, start, stop):
        self.switches.append((len(start), len(stop)))
        if self.fails:
            raise ZeroDivisionError

    def switch_result(self, claims=None):
        if claims is not None and self.ready.intersection(*claims.values()):
            return SwitchResult.DONE
        return self.result


class Robot:
    """A manager on joints a, b (position), v (velocity), e (effort), and queries for the tests."""

    def __init__(self):
        self.hardware = SlowHardware({"a": (POSITION,), "b": (POSITION,), "v": (VELOCITY,), "e": (EFFORT,)})
        self.log = FakeLog()
        self.manager = ControllerManager(self.hardware, self.log)
        self.ros, self.parameters = {}, {}
        self.time_s = 0.0

    def load(self, name, **parameters):
        self.parameters[name] = parameters
        context, self.ros[name] = fake_context(name, parameters, log=self.log)
        context.publisher("open", Empty)
        self.manager.load(name, "test/Recorder", Recorder, context)
        return self.find(name).controller

    def find(self, name):
        return {loaded.name: loaded for loaded in self.manager.loaded}[name]

    def has_closed(self, name):
        """Whether the topics of a controller are closed."""
        return self.ros[name].publishers == {}

    def state(self, name):
        return self.find(name).state

    def update(self, ticks=1, **options):
        for _ in range(ticks):
            self.manager.update(self.time_s, DT, **options)
            self.time_s += DT

    def switch(self, start=(), stop=(), strictness=STRICT, **options):
        future = self.manager.switch(list(start), list(stop), strictness, **options)
        self.update()
        return future

    def refused(self, start=(), stop=(), strictness=STRICT):
        """The text of a refusal; nothing must have changed."""
        before = [(loaded.name, loaded.state) for loaded in self.manager.loaded]
        with pytest.raises(Refused) as refusal:
            self.manager.switch(list(start), list(stop), strictness)
        self.update()
        assert [(loaded.name, loaded.state) for loaded in self.manager.loaded] == before
        return str(refusal.value)


@pytest.fixture
def robot():
    return Robot()


def test_core_loads_without_ros():
    """The core must import on a machine that has no ROS at all."""
    block = "import sys; sys.modules.update(dict.fromkeys(%r)); " % (ROS,)
    modules = ", ".join("controller_manager" + part for part in ("", ".manager", ".limits", ".transmissions"))
    subprocess.run([sys.executable, "-c", block + "import " + modules], check=True)


# -- load, unload ---------------------------------------------------------------------------------------------------


def test_a_loaded_controller_does_not_run(robot):
    calls = robot.load("one", position=["a"]).calls
    robot.update(3)
    assert robot.state("one") == "initialized" and calls == ["init"]


def test_controllers_are_listed_in_the_order_of_loading(robot):
    for name in ("zebra", "ape", "mole"):
        robot.load(name)
    assert [loaded.name for loaded in robot.manager.loaded] == ["zebra", "ape", "mole"]


def test_a_name_is_loaded_once(robot):
    robot.load("one")
    with pytest.raises(Refused, match="'one'.*already loaded"):
        robot.load("one")


@pytest.mark.parametrize(("parameters", "text"), [
    ({"position": ["nobody"]}, "joint 'nobody'.*no transmission.*a, b"),
    ({"effort": ["a"]}, "joint 'a' cannot be used through .*Effort.*another hardware interface.*: e"),
    ({"fails_in": "init"}, "ValueError: broken on purpose"),
])
def test_a_refusing_constructor_leaves_nothing_behind(robot, parameters, text):
    with pytest.raises(Refused, match=text):
        robot.load("one", **parameters)
    assert robot.manager.loaded == [] and robot.has_closed("one")
    robot.load("one")


def test_an_interface_that_no_joint_has_is_named():
    robot = Robot()
    robot.manager.hardware = FakeHardware({"a": (POSITION,)})
    with pytest.raises(Refused, match="EffortJointInterface, which no joint of this robot has .*transmissions"):
        robot.load("one", effort=["a"])


def test_unload_closes_and_forgets(robot):
    calls = robot.load("one").calls
    robot.manager.unload("one")
    assert robot.manager.loaded == [] and calls == ["init", "close"] and robot.has_closed("one")


def test_a_running_controller_cannot_be_unloaded(robot):
    robot.load("one")
    robot.switch(["one"])
    with pytest.raises(Refused, match="running; stop it first"):
        robot.manager.unload("one")
    robot.switch(stop=["one"])
    robot.manager.unload("one")


def test_an_unknown_controller_cannot_be_unloaded(robot):
    robot.load("one")
    with pytest.raises(Refused, match="'two'.*loaded are: one"):
        robot.manager.unload("two")


# -- switch ---------------------------------------------------------------------------------------------------------


def test_start_and_stop(robot):
    calls = robot.load("one", position=["a"]).calls
    assert robot.switch(["one"]).done() and robot.state("one") == "running"
    assert calls == ["init", "starting"], "the first update is one tick later"
    robot.update(2)
    assert robot.switch(stop=["one"]).done() and robot.state("one") == "stopped"
    robot.update(2)
    assert calls == ["init", "starting", "update", "update", "update", "stopping"]
    robot.switch(["one"])
    assert robot.state("one") == "running"


def test_without_updates_a_switch_waits(robot):
    robot.load("one")
    future = robot.manager.switch(["one"], [], STRICT)
    assert not future.done() and robot.state("one") == "initialized"
    robot.update()
    assert future.done()


def test_strict_refuses_unknown_names(robot):
    robot.load("one")
    assert "'two'" in robot.refused(start=["one", "two"])
    assert "'two'" in robot.refused(stop=["two"])


def test_best_effort_skips_unknown_names(robot):
    robot.load("one")
    robot.switch(["one", "two"], ["three"], BEST_EFFORT)
    assert robot.state("one") == "running"


def test_strictness_0_is_best_effort_with_a_warning(robot):
    robot.load("one")
    robot.switch(["one", "two"], strictness=0)
    assert robot.state("one") == "running" and "strictness 0" in robot.log.of("warn")[0]


def test_strict_refuses_to_stop_what_does_not_run(robot):
    robot.load("one")
    assert "initialized, not running" in robot.refused(stop=["one"])


def test_best_effort_ignores_to_stop_what_does_not_run(robot):
    robot.load("one")
    robot.load("two")
    robot.switch(["two"], ["one"], BEST_EFFORT)
    assert (robot.state("one"), robot.state("two")) == ("initialized", "running")


def test_strict_refuses_to_start_what_runs(robot):
    robot.load("one")
    robot.switch(["one"])
    assert "already running" in robot.refused(start=["one"])


def test_best_effort_starts_what_runs_again(robot):
    calls = robot.load("one").calls
    robot.switch(["one"])
    robot.switch(["one"], strictness=BEST_EFFORT)
    assert robot.state("one") == "running" and calls.count("starting") == 2 and "stopping" not in calls
    assert robot.hardware.switches == [(1, 0), (0, 0)], "it does not count as a new start"


@pytest.mark.parametrize("strictness", [BEST_EFFORT, STRICT])
def test_one_call_cannot_restart(robot, strictness):
    robot.load("one")
    robot.switch(["one"])
    assert "conflicting switching command" in robot.refused(["one"], ["one"], strictness)


@pytest.mark.parametrize("strictness", [BEST_EFFORT, STRICT])
def test_two_controllers_cannot_share_a_joint(robot, strictness):
    robot.load("one", position=["a", "b"])
    robot.load("two", position=["b"])
    assert "joint 'b' is claimed by one and two" in robot.refused(["one", "two"], (), strictness)
    robot.switch(["one"])
    assert "joint 'b'" in robot.refused(["two"], (), strictness)


def test_a_conflict_counts_across_interfaces():
    robot = Robot()
    robot.manager.hardware = robot.hardware = FakeHardware({"a": (POSITION, EFFORT)})
    robot.load("one", position=["a"])
    robot.load("two", effort=["a"])
    assert "joint 'a'" in robot.refused(["one", "two"])


def test_a_joint_changes_hands_in_one_switch(robot):
    robot.load("one", position=["a"])
    robot.load("two", position=["a"])
    robot.switch(["one"])
    robot.switch(["two"], ["one"])
    assert (robot.state("one"), robot.state("two")) == ("stopped", "running")


def test_readers_never_conflict(robot):
    robot.load("one")
    robot.load("two")
    robot.switch(["one", "two"])
    assert robot.state("one") == robot.state("two") == "running"


def test_claimed_resources(robot):
    robot.load("reader")
    robot.load("arm", position=["b", "a"], effort=["e"])
    assert robot.find("reader").claimed_resources == [("hardware_interface::JointStateInterface", [])]
    assert robot.find("arm").claimed_resources == [
        ("hardware_interface::PositionJointInterface", ["a", "b"]), ("hardware_interface::EffortJointInterface", ["e"])]


def test_unprepared_hardware_refuses(robot):
    robot.load("one")
    robot.hardware.prepares = False
    assert "hardware refuses to start [one]" in robot.refused(["one"])


def test_running_controllers_update_before_others_stop_and_start(robot):
    order = []
    for name in ("old", "new"):
        controller = robot.load(name)
        for method in ("starting", "update", "stopping"):
            setattr(controller, method, lambda *_, call=(name, method): order.append(call))
    robot.switch(["old"])
    robot.switch(["new"], ["old"])
    assert order == [("old", "starting"), ("old", "update"), ("old", "stopping"), ("new", "starting")]


def test_hardware_that_needs_time_keeps_all_waiting(robot):
    robot.load("one", position=["a"])
    robot.load("two", position=["b"])
    robot.hardware.result = SwitchResult.ONGOING
    robot.hardware.ready = {"a"}
    future = robot.switch(["one", "two"])
    assert (robot.state("one"), robot.state("two"), future.done()) == ("waiting", "waiting", False)
    robot.hardware.result = SwitchResult.DONE
    robot.update()
    assert (robot.state("one"), robot.state("two"), future.done()) == ("running", "running", True)
    assert len(robot.hardware.switches) == 1, "the hardware is told once"


def test_asap_starts_each_when_its_own_joints_are_ready(robot):
    robot.load("one", position=["a"])
    robot.load("two", position=["b"])
    robot.hardware.result = SwitchResult.ONGOING
    robot.hardware.ready = {"a"}
    future = robot.switch(["one", "two"], start_asap=True)
    assert (robot.state("one"), robot.state("two"), future.done()) == ("running", "waiting", False)
    robot.hardware.ready = {"a", "b"}
    robot.update()
    assert (robot.state("two"), future.done()) == ("running", True)


def test_hardware_error_aborts_the_start(robot):
    robot.load("one")
    robot.hardware.result = SwitchResult.ERROR
    assert robot.switch(["one"]).done() and robot.state("one") == "aborted"
    robot.hardware.result = SwitchResult.DONE
    robot.switch(["one"])
    assert robot.state("one") == "running", "an aborted controller can be started"


def test_a_start_that_takes_too_long_is_aborted_and_the_switch_ends(robot):
    robot.load("one")
    robot.hardware.result = SwitchResult.ONGOING
    future = robot.switch(["one"], timeout_s=0.01)
    robot.update(4)
    assert robot.state("one") == "waiting" and not future.done()
    robot.update(3)
    assert robot.state("one") == "aborted" and future.done()


def test_an_abandoned_switch_changes_nothing(robot):
    robot.load("one")
    future = robot.manager.switch(["one"], [], STRICT)
    robot.manager.abandon_switch(future)
    robot.update(2)
    assert robot.state("one") == "initialized"
    robot.switch(["one"])
    assert robot.state("one") == "running"


# -- update ---------------------------------------------------------------------------------------------------------


def test_reset_restarts_running_controllers_before_the_update(robot):
    running, idle = robot.load("one").calls, robot.load("two").calls
    robot.switch(["one"])
    robot.update(reset_controllers=True)
    assert running == ["init", "starting", "stopping", "starting", "update"] and idle == ["init"]


@pytest.mark.parametrize("error", [ValueError, RecursionError, SystemExit])
@pytest.mark.parametrize("where", ["starting", "update", "stopping"])
def test_a_failing_controller_is_reported_and_its_joints_are_held(robot, where, error):
    good = robot.load("good", position=["a"]).calls
    bad = robot.load("bad", fails_in=where, error=error, effort=["e"], position=["b"])
    robot.switch(["good", "bad"])
    robot.hardware.command[EFFORT][:] = 5.0
    robot.hardware.command[POSITION][1], robot.hardware.position[1] = 7.0, 0.25
    robot.update()
    if where == "stopping":
        robot.switch(stop=["bad"])
    robot.update()
    assert robot.state("bad") == "aborted" and robot.state("good") == "running" and good.count("update") >= 2
    assert len(robot.log.of("error")) == 1 and "'bad' failed in %s()" % where in robot.log.of("error")[0]
    assert "its joints are held" in robot.log.of("error")[0]
    assert robot.hardware.held == [bad.claims]
    if where != "starting":
        assert robot.hardware.command[EFFORT][3] == 0.0, "no effort is left behind"
        assert robot.hardware.command[POSITION][1] == 0.25, "nor a position"
    if where == "update":
        assert bad.calls[-1] == "stopping", "a client that waits for a goal is told"
    robot.parameters["bad"]["fails_in"] = None
    robot.switch(["bad"])
    robot.update()
    assert robot.state("bad") == "running" and robot.hardware.released[-1] is bad.claims


def test_hardware_that_fails_in_a_change_is_an_error_of_that_change(robot):
    good = robot.load("good", position=["a"]).calls
    robot.load("new", position=["b"])
    robot.switch(["good"])
    robot.hardware.fails = True
    future = robot.switch(["new"])
    with pytest.raises(Refused, match="the hardware failed .*ZeroDivisionError"):
        future.result(0)
    assert robot.state("new") == "aborted" and robot.state("good") == "running"
    robot.hardware.fails = False
    assert robot.switch(["new"]).result(0) is None and robot.state("new") == "running"
    before = good.count("update")
    robot.update()
    assert good.count("update") == before + 1


def test_close_releases_who_waits(robot):
    robot.load("one")
    robot.update()
    switch = robot.manager.switch(["one"], [], STRICT)
    robot.manager.close()
    assert switch.cancelled() and robot.has_closed("one")
    with pytest.raises(Refused, match="ended"):
        robot.load("two")


# -- parameters -----------------------------------------------------------------------------------------------------


def test_parameters_are_looked_up_in_both_namespaces():
    context, _ = fake_context("arm", {"joint": "a", "gains": {"a": {"p": 3}}})
    assert context.param("gains/a/p") == 3 and context.root_param("arm/joint") == "a"
    assert context.resolve("command") == "/robot/arm/command"
    assert context.in_root("joint_states") == "/robot/joint_states"
    assert context.entry("gains/b/p") == (None, "/robot/arm/gains/b/p")


@pytest.mark.parametrize(("read", "text"), [
    (lambda c: c.text("joint", "the name of a joint"), "/robot/arm/joint is missing; give the name of a joint"),
    (lambda c: c.text("rate", "a name"), "/robot/arm/rate is 50, expected a name"),
    (lambda c: c.texts("rate", "a list of names"), "is 50, expected a list of names"),
    (lambda c: c.texts("twice", "names"), "only once"),
    (lambda c: c.number("name"), "is 'x', expected a number"),
    (lambda c: c.number("nothing"), "/robot/arm/nothing is missing"),
    (lambda c: c.flag("rate", True), "expected true or false"),
])
def test_wrong_parameters_are_named(read, text):
    context, _ = fake_context("arm", {"rate": 50, "twice": ["a", "a"], "name": "x"})
    with pytest.raises(ControllerError, match=text):
        read(context)
