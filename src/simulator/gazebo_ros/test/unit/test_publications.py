# SPDX-License-Identifier: BSD-3-Clause
"""How often the clock and the snapshot go out: at the requested ticks, and no more often than viewers can use."""
from types import SimpleNamespace

import pytest

from bullet_sim import ContactPoint
from gazebo_ros import publications
from gazebo_ros.pacing import RateMeter

STEP_S = 0.002
TOUCH = ContactPoint("cup", "body", "table", "top", (0.1, 0.2, 0.3), (0.0, 0.0, 1.0), -0.001, 5.0, (1.0, 0.0, 0.0))


class World:
    """The part of the world that SimulationPublications looks at, run at a factor of wall time that the test
    chooses."""

    def __init__(self, monkeypatch, factor, paused=False, asked=None, clock_rate=500.0):
        self.wall_s, self.factor, self.snapshots, self.clocks = 100.0, factor, [], 0
        monkeypatch.setattr(publications.time, "perf_counter", lambda: self.wall_s)
        monkeypatch.setattr(publications, "CollisionNames", lambda world: SimpleNamespace(
            at=lambda model, body, position: "%s::%s::shell" % (model, body)))
        self.simulation = SimpleNamespace(step_s=STEP_S, tick=0, time_ns=0, time_s=0.0, paused=paused, is_stepping=True,
                                          real_time_factor=asked, ticks_at_once=1,
                                          world=SimpleNamespace(models={}, contacts=lambda: [TOUCH, TOUCH]))
        self.contacts = SimpleNamespace(has_listeners=False, publish=lambda message: self.messages.append(message))
        self.messages, self.pauses = [], []
        publisher = SimpleNamespace(has_listeners=False, publish_serialized=self._count)
        ros = SimpleNamespace(publisher=lambda topic, *arguments, **options: (
            self.contacts if topic == "/gazebo/contacts" else publisher))
        self.snapshot = SimpleNamespace(write=self._write, resets=0)
        self.publications = publications.SimulationPublications(self.simulation, ros, self.snapshot, log=None,
                                                                clock_rate=clock_rate)
        self.clocks = 0

    def _count(self, data):
        self.clocks += 1

    def _write(self, tick, time_s, parts, paused):
        self.snapshots.append(tick)
        self.pauses.append(paused)

    def run(self, seconds):
        for _ in range(round(seconds / STEP_S)):
            self.simulation.tick += 1
            self.simulation.time_s = self.simulation.tick * STEP_S
            self.simulation.time_ns = self.simulation.tick * 2000000
            self.wall_s += STEP_S / self.factor
            self.publications.on_tick()


@pytest.mark.parametrize(("clock_rate", "step_s", "ticks"), [
    (500.0, 0.002, (1, 5)), (250.0, 0.002, (2, 5)), (100.0, 0.002, (5, 10)), (50.0, 0.002, (5, 10)),
    (250.0, 0.001, (4, 10)), (1000.0, 0.001, (1, 10)), (100.0, 0.001, (10, 20)), (50.0, 0.01, (1, 2)),
    (20.0, 0.05, (1, 1))])
def test_ticks_follow_each_other_at_once_where_the_clock_has_fewer_messages(monkeypatch, clock_rate, step_s, ticks):
    world = World(monkeypatch, factor=1.0, clock_rate=clock_rate)
    world.simulation.step_s = step_s
    world.publications.step_changed()
    assert world.simulation.turn_lengths == ticks


@pytest.mark.parametrize(("clock_rate", "ticks_at_once", "clocks"), [
    (500.0, 1, 1000), (500.0, 5, 200), (500.0, 10, 100), (100.0, 5, 200), (100.0, 10, 100), (10.0, 10, 20)])
def test_a_late_world_tells_its_time_at_the_end_of_each_turn(monkeypatch, clock_rate, ticks_at_once, clocks):
    world = World(monkeypatch, factor=1.0, asked=1.0, clock_rate=clock_rate)
    world.simulation.ticks_at_once = ticks_at_once
    world.run(2.0)
    assert world.clocks == clocks


def test_longer_turns_of_a_late_world_are_told_once(monkeypatch):
    lines = []
    world = World(monkeypatch, factor=1.0, asked=1.0)
    world.publications._log = SimpleNamespace(info=lines.append)
    world.publications._meter = RateMeter(clock=lambda: world.wall_s)
    world.run(3.0)
    assert lines == []
    world.simulation.ticks_at_once = 5
    world.run(35.0)
    assert lines == [], "a lab that starts is late for as long"
    world.simulation.ticks_at_once = 1
    world.run(100.0)
    assert lines == []
    world.simulation.ticks_at_once = 5
    world.run(20.0)
    world.simulation.ticks_at_once = 10
    world.run(100.0)
    line, = lines
    assert "100 messages a second" in line and "10 ms" in line


def test_in_real_time_every_tick_that_is_due_counts(monkeypatch):
    world = World(monkeypatch, factor=1.7, asked=1.0)  # it catches up after a stall
    world.run(2.0)
    assert world.clocks == 1000
    assert world.snapshots == list(range(5, 1001, 5))


def test_at_full_speed_no_subscriber_gets_more_than_it_can_use(monkeypatch):
    world = World(monkeypatch, factor=20.0, asked=0.0)
    world.run(20.0)
    wall_s = world.wall_s - 100.0
    assert wall_s == pytest.approx(1.0)
    assert 0.8 * publications.MAX_WALL_CLOCK_RATE < world.clocks <= publications.MAX_WALL_CLOCK_RATE + 1
    assert 0.5 * publications.MAX_WALL_SNAPSHOT_RATE < len(world.snapshots) <= publications.MAX_WALL_SNAPSHOT_RATE + 1


def test_in_lock_step_every_state_is_shown(monkeypatch):
    world = World(monkeypatch, factor=50.0, paused=True, asked=1.0)
    world.run(2.0)
    assert world.snapshots == list(range(5, 1001, 5))


def test_a_reset_of_the_time_is_counted_and_shown_at_once(monkeypatch):
    world = World(monkeypatch, factor=50.0, paused=True)
    world.run(0.01)
    world.simulation.tick = world.simulation.time_ns = 0
    world.simulation.time_s = 0.0
    world.publications.time_was_reset()
    assert world.snapshot.resets == 1
    assert world.snapshots == [5, 0]


@pytest.mark.parametrize("paused", [False, True])
def test_the_snapshot_says_whether_the_world_is_paused(monkeypatch, paused):
    world = World(monkeypatch, factor=1.0, paused=paused, asked=1.0)
    world.publications.write_snapshot()
    assert world.pauses == [paused]


def test_contacts_go_out_to_subscribers_only_and_no_more_often_than_they_can_use(monkeypatch):
    world = World(monkeypatch, factor=1.0, asked=1.0)
    world.run(1.0)
    assert world.messages == []
    world.contacts.has_listeners = True
    world.run(1.0)
    assert len(world.messages) == publications.CONTACTS_RATE
    state, = world.messages[-1].states
    assert (state.collision1_name, state.collision2_name) == ("cup::body::shell", "table::top::shell")
    assert len(state.contact_positions) == 2 and state.contact_positions[0].z == 0.3
    assert (state.total_wrench.force.x, state.total_wrench.force.z) == (2.0, 10.0) and state.depths == [0.001, 0.001]
    assert world.messages[-1].header.frame_id == "world"
    fast = World(monkeypatch, factor=50.0, asked=0.0)
    fast.contacts.has_listeners = True
    fast.run(50.0)
    assert 0.9 * publications.CONTACTS_RATE < len(fast.messages) <= 2.0 * publications.CONTACTS_RATE + 1
