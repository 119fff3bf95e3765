# SPDX-License-Identifier: BSD-3-Clause
"""Unexpected exceptions in the robot's code, at every place where a message or a tick enters."""
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
import roslib.message
from baxter_core_msgs.msg import EndEffectorCommand, EndEffectorProperties, EndEffectorState
from bullet_sim_msgs.srv import PressRequest
from std_msgs.msg import Bool, Empty, Float64

from baxter_sim_hardware.robot_state import BaxterState
from baxter_sim_hardware.topics import interface
from gazebo_ros.simulation import HostedPlugin, Simulation
from loop_ros.faults import Faults
from loop_ros.request_queue import RequestQueue

TICK_S = 0.002
INPUTS = [(row, name) for row in interface.TOPICS if not row.is_published for _, name in row.names()]
OUTPUTS = [name for row in interface.TOPICS if row.is_published and row.rate != interface.LATCHED
           for _, name in row.names()]


class Loop:
    """The simulator's loop with an enabled robot in it."""

    def __init__(self, lab):
        self.lab, self.log = lab, lab.log
        world = SimpleNamespace(time_step_s=TICK_S, step=lab.world.step, reset_models=lab.world.reset_models,
                                reset_time=lab.world.reset_time)
        self.simulation = Simulation(world, RequestQueue(), lab.log, Faults(lab.log), paused=True)
        self.hosted = HostedPlugin(lab.plugin, lab.context, "baxter", "libbaxter.so")
        self.simulation.host(self.hosted)
        self.simulation.tick = lab.world.tick
        self.path = []

    @property
    def plugin(self):
        return self.hosted.plugin

    def run(self, seconds):
        for _ in range(round(seconds / TICK_S)):
            self.simulation.do_tick()
            self.path.append(self.lab.position)

    def state(self):
        self.run(0.02)
        state = self.lab.last("state")
        return state.ready, state.enabled, state.stopped, state.error, state.estop_button, state.estop_source

    def obeys(self, by=0.05):
        """Whether a command is still obeyed."""
        target = self.lab.position + by
        self.lab.command(1, target)
        self.run(0.6)
        return np.abs(self.lab.position - target).max() < 2e-3


ENABLED, DISABLED = (True, True, False, False, 0, 0), (False, False, False, False, 0, 0)
FAILED = (False, False, True, True, 0, 3)


@pytest.fixture
def loop(lab):
    return Loop(lab)


def fail(*arguments, **options):
    raise RecursionError("broken on purpose")


def fail_in(loop, monkeypatch, times):
    """Make the robot's tick raise this many times."""
    left, real = [None] * times, type(loop.plugin._baxter).update

    def update(self, *arguments):
        if left:
            left.pop()
            fail()
        return real(self, *arguments)

    monkeypatch.setattr(type(loop.plugin._baxter), "update", update)


BAD_ARGS = ('{"a":' * 5000, '{"velocity": %s}' % ("9" * 400), '{"velocity": 1e400}', '{"velocity": NaN}',
            '{"velocity": Infinity}', "\0" * 1000, "[" * 10**6, "\ud800")


def test_no_gripper_command_ends_the_robot(loop):
    for command in ("configure", "set", "go", "grip", "calibrate", "x" * 10**6):
        for args in BAD_ARGS:
            for side in ("left", "right"):
                loop.lab.send("end_effector/%s_gripper/command" % side, EndEffectorCommand(command=command, args=args))
            loop.run(TICK_S)
    assert loop.hosted.failures == 0 and loop.lab.faults == []
    assert loop.state() == ENABLED
    assert all(len(line) < 2000 for line in loop.log.lines)


def test_a_handler_that_raises_costs_its_message_only(loop):
    topics, send = loop.plugin._handling._topics, loop.lab.send
    for queue, entry in list(topics.items()):
        topics[queue] = entry._replace(handler=fail)
    for row, topic in INPUTS:
        loop.lab.faults.clear()
        send(topic, roslib.message.get_message_class(row.type)())
        loop.run(TICK_S)
        (where, error), = loop.lab.faults
        assert where == loop.lab.context.resolve(topic) and isinstance(error, RecursionError)
    assert loop.hosted.failures == 0
    assert loop.state() == ENABLED


def test_a_message_that_cannot_be_made_leaves_the_others(loop):
    publishing, groups = loop.plugin._publishing, loop.plugin._publishing._groups
    for topic in OUTPUTS:
        name = loop.lab.context.resolve(topic)
        publishing._groups = {
            rate: (schedule, [(fail if publisher.topic == name else function, component, publisher)
                              for function, component, publisher in topics])
            for rate, (schedule, topics) in groups.items()}
        for publisher in loop.lab.publishers.values():
            publisher.messages.clear()
            publisher.has_listeners = True
        loop.lab.faults.clear()
        for rate, (schedule, _) in groups.items():
            publishing.set_rate(rate, schedule.rate_hz)  # as if nothing had been published so far
        loop.run(TICK_S)
        assert [where for where, _ in loop.lab.faults] == ["publishing " + name]
        assert [name for name in OUTPUTS if not loop.lab.publishers[name].messages] == [topic]
    assert loop.hosted.failures == 0


def test_who_subscribes_in_a_paused_world_gets_the_state_also_before_the_first_tick(make_lab):
    lab = make_lab()
    for ticks in range(2):
        for topic in OUTPUTS:
            publisher = lab.publishers[topic]
            publisher.has_listeners = True
            message, = publisher.present()
            publisher.publish(message)
            assert isinstance(publisher.messages[-1], publisher.msg_class), topic
        states = lab.publishers["joint_states"].messages[-1]
        assert states.header.stamp.to_sec() == pytest.approx(lab.world.time_s) and lab.world.time_s == ticks * TICK_S
        assert states.position == pytest.approx(lab.model.read_joints()[0][lab.model.index(states.name)])
        lab.run(TICK_S)
    assert lab.faults == []


def test_joints_that_were_put_elsewhere_in_a_paused_world_feel_nothing(make_lab):
    lab = make_lab()

    def felt():
        wrench = lab.publishers["limb/left/endpoint_state"].present()[0].wrench
        force = lab.publishers["accelerometer/left_accelerometer/state"].present()[0].linear_acceleration
        return np.linalg.norm([wrench.force.x, wrench.force.y, wrench.force.z]), np.linalg.norm(
            [force.x, force.y, force.z])

    assert felt() == pytest.approx((0.0, 9.81), abs=1e-6)
    lab.command(1, lab.position + 0.3)
    lab.run(0.1)
    before = lab.publishers["joint_states"].renewed
    lab.model.set_joint_positions(lab.arm, lab.position + 0.5)
    lab.plugin.joints_set()
    assert felt() == pytest.approx((0.0, 9.81), abs=1e-6)
    assert lab.publishers["joint_states"].renewed == before + 1


def stamps(messages):
    return [message.header.stamp.to_sec() for message in messages]


def test_no_state_is_newer_than_one_on_its_way(make_lab):
    lab = make_lab(parameters={"profile": "robot"})
    publisher = lab.publishers["joint_states"]
    publisher.has_listeners = False
    lab.run(0.1)
    assert stamps(publisher.present()) == pytest.approx([lab.world.time_s] * 2)
    publisher.has_listeners = True
    for _ in range(50):
        lab.run(TICK_S)
        on_way = [message for ready in lab.plugin._publishing._late.waiting() for to, message in ready
                  if to is publisher]
        for present in stamps(publisher.present()):
            assert present <= min(stamps(on_way), default=present)
    assert publisher.present()
    lab.plugin.joints_set()
    assert stamps(publisher.present()) == pytest.approx([lab.world.time_s] * 2)


def test_a_state_that_cannot_be_made_is_counted_and_left_out(loop):
    publisher = loop.lab.publishers["joint_states"]
    publisher.present = partial(publisher.present.func, fail, *publisher.present.args[1:])
    assert publisher.present() == ()
    (where, error), = loop.lab.faults
    assert where == "publishing " + publisher.topic and isinstance(error, RecursionError)


@pytest.mark.parametrize("mode, values", [(1, 0.3), (2, 0.5), (3, 3.0), (4, 0.01)])
def test_a_tick_that_raises_brings_the_arms_to_rest_and_the_robot_goes_on(loop, monkeypatch, mode, values):
    lab = loop.lab
    for _ in range(100):
        lab.command(mode, (lab.position if mode in (1, 4) else 0.0) + np.full(14, values))
        loop.run(TICK_S)
    fail_in(loop, monkeypatch, 1)
    before = loop.plugin
    loop.path.clear()
    loop.run(1.0)
    assert loop.plugin is not before and loop.hosted.failures == 1
    path = np.array(loop.path)
    # Never a jump: the arms slow down from where and as fast as they were. From full speed of all joints at once, the
    # joints that stop first push the shoulder slightly beyond its stopping point.
    limit = lab.model.max_velocity[lab.arm]
    assert (np.abs(np.diff(path, axis=0)) <= 1.25 * limit * TICK_S).all()
    assert np.abs(path[-1] - path[0]).max() < 0.4
    assert np.abs(path[-1] - path[len(path) // 2]).max() < 1e-3
    assert loop.state() == ENABLED
    assert loop.obeys(by=-0.05)
    assert len(lab.publishers["sim/started"].messages) == 1


def test_a_resting_robot_does_not_move_when_it_restarts(loop, monkeypatch):
    loop.run(0.5)
    start = loop.lab.model.read_joints()[0]
    for _ in range(2):
        fail_in(loop, monkeypatch, 1)
        loop.run(0.3)
    assert loop.hosted.failures == 2
    assert np.abs(loop.lab.model.read_joints()[0] - start).max() < 1e-3
    assert len(loop.lab.model._gears) == 2


@pytest.mark.parametrize("message, state", [
    (("set_super_enable", Bool(False)), BaxterState.DISABLED), (("set_super_stop", Empty()), BaxterState.STOPPED)])
def test_a_robot_that_was_not_enabled_is_not_afterwards(loop, monkeypatch, message, state):
    loop.lab.send(*message)
    loop.run(0.5)
    fail_in(loop, monkeypatch, 1)
    loop.run(0.1)
    assert loop.hosted.failures == 1 and loop.plugin._baxter.state.state is state


def test_an_emergency_stop_outlasts_a_beginning(loop, monkeypatch):
    loop.lab.services["sim/press"](PressRequest(component="estop", action="press"))
    fail_in(loop, monkeypatch, 1)
    loop.run(0.1)
    assert loop.plugin._baxter.state.state is BaxterState.ESTOP_PRESSED


REVIVALS = {
    "reset_world": lambda loop: loop.simulation.reset(time_too=False),
    "reset_simulation": lambda loop: loop.simulation.reset(time_too=True),
    "set_super_reset": lambda loop: loop.lab.send("set_super_reset", Empty()),
}


@pytest.mark.parametrize("revival, moving", [("reset_world", True), ("reset_simulation", False),
                                             ("set_super_reset", True)])
def test_a_robot_that_fails_three_times_shows_it_holds_still_and_comes_back(loop, monkeypatch, revival, moving):
    lab = loop.lab
    for _ in range(100 if moving else 0):
        lab.command(3, np.full(14, 3.0))
        loop.run(TICK_S)
    fail_in(loop, monkeypatch, 3)
    loop.path.clear()
    loop.run(0.01)
    assert loop.hosted.has_failed
    assert loop.state() == FAILED
    lab.send("set_super_enable", Bool(True))
    lab.command(1, lab.position + 0.3)
    loop.run(1.0)
    assert loop.state() == FAILED
    path = np.array(loop.path)
    assert np.abs(path - path[0]).max() < 0.05
    assert np.abs(path[-1] - path[len(path) // 2]).max() < 1e-3
    # It still publishes its joints and its error.
    assert lab.last("joint_states").header.stamp.to_sec() > lab.world.time_s - 0.03
    assert lab.last("/diagnostics").status[0].level == 2 and lab.last("limb/left/state").error

    REVIVALS[revival](loop)
    loop.run(0.01)
    assert not loop.hosted.has_failed
    assert loop.state() == DISABLED
    still = lab.position
    loop.run(0.3)
    assert np.abs(lab.position - still).max() < 1e-3
    lab.send("set_super_enable", Bool(True))
    loop.run(TICK_S)
    assert loop.state() == ENABLED and loop.obeys()


def test_a_client_sends_books_and_the_robot_repeats_none(make_lab, robot):
    lab = make_lab()
    for side in ("left", "right"):
        lab.send("end_effector/%s_gripper/command" % side, EndEffectorCommand(command="no_op", sender="x" * 10**6))
        lab.send("end_effector/%s_gripper/rsdk/set_state" % side, EndEffectorState(state="x" * 10**6))
        lab.send("end_effector/%s_gripper/rsdk/set_properties" % side, EndEffectorProperties(product="x" * 10**6))
    lab.run(0.02)
    for side in ("left", "right"):
        assert len(str(lab.last("end_effector/%s_gripper/state" % side))) < 2000
        assert len(str(lab.last("end_effector/%s_gripper/properties" % side))) < 2000


def test_arms_that_are_taken_over_at_speed_slow_down_within_what_they_can(lab):
    lab.command(2, np.full(14, 0.5))
    lab.send("limb/left/set_speed_ratio", Float64(0.5))
    lab.run(0.15)
    lab.plugin = lab.plugin.restarted()
    positions, velocities, _ = lab.record(0.4)
    assert np.abs(velocities[0]).max() > 0.3 and np.abs(velocities[-1]).max() < 0.01
    assert (np.sign(velocities[0]) * (positions[-1] - positions[0]) > -1e-3).all()
