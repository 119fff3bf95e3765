# SPDX-License-Identifier: BSD-3-Clause
"""The publications of /gazebo itself at each tick: the clock, the states of models and links, the real-time factor, and
the snapshot for viewers."""
from __future__ import annotations

import struct
import time
from typing import TYPE_CHECKING

import rospy
from gazebo_msgs.msg import ContactsState, LinkStates, ModelStates, PerformanceMetrics
from rosgraph_msgs.msg import Clock

from gazebo_ros.contact_messages import CollisionNames, contact_states
from gazebo_ros.convert import msg_from_pose, msg_from_twist
from gazebo_ros.pacing import RateMeter, SlownessWatch, slowness_line, ticks_between
from sim_time.stamps import stamp_ns

if TYPE_CHECKING:
    from gazebo_ros.simulation import Simulation
    from loop_ros.protocol import Log
    from loop_ros.ros_objects import RosObjects
    from world_picture.snapshot import NoSnapshot, SnapshotWriter

_CLOCK_MESSAGE = struct.Struct("<III")
_CLOCK_BYTES = 8
# Faster than real time, the clock and the snapshot go out at most this often per wall second [Hz]. No viewer draws more
# often.
MAX_WALL_CLOCK_RATE = 500.0
MAX_WALL_SNAPSHOT_RATE = 100.0
# The ticks of this time at most follow each other at once, where the clock has fewer messages than ticks [s]. In a
# world that is late they always do, or those of the longer time where they do so anyway; the clock has a message for
# each such time.
MAX_AT_ONCE_S, MAX_LATE_AT_ONCE_S = 0.010, 0.020
# That a world is late is told after so many windows of the meter. It stays late for 30 s at least, and most machines
# are too busy while a lab starts.
TOLD_AFTER_WINDOWS = 45
# Model and link states and the snapshot go out at this rate, in simulation time [Hz].
STATES_RATE = 100.0
# The contacts of the whole world go out at this rate, in simulation time and, faster than real time, at most so often
# per wall second [Hz].
CONTACTS_RATE = 25.0
# Rate of the snapshot in a paused world, where services can still move models [Hz, wall time].
PAUSED_SNAPSHOT_RATE = 20.0


class SimulationPublications:
    """Call :meth:`on_tick` after each tick, :meth:`on_turn` at each turn of the loop."""

    def __init__(self, simulation: Simulation, ros: RosObjects, snapshot: SnapshotWriter | NoSnapshot, log: Log,
                 clock_rate: float) -> None:
        """``clock_rate`` [Hz]: of /clock, rounded to whole ticks; raises ``ValueError`` if it is not positive.

        ``snapshot``: :class:`SnapshotWriter`.
        """
        self._simulation = simulation
        self._clock_rate = clock_rate
        self.step_changed()
        self._snapshot = snapshot
        self._log = log
        self._meter = RateMeter()
        self._watch = SlownessWatch()
        self._rospy_time_changed = rospy.rostime.get_rostime_cond()
        self._clock_sent_at = 0.0
        self._snapshot_written_at = 0.0
        self._snapshot_too_small = False
        self._late_windows = 0  # of the meter
        self._clock = ros.publisher("/clock", Clock, greet=True)
        self._model_states = ros.publisher("/gazebo/model_states", ModelStates)
        self._link_states = ros.publisher("/gazebo/link_states", LinkStates)
        self._contacts = ros.publisher("/gazebo/contacts", ContactsState)
        self._contacts_sent_at = 0.0
        self._collision_names = CollisionNames(simulation.world)
        self._metrics = ros.publisher("/gazebo/performance_metrics", PerformanceMetrics)
        self.publish_clock()

    def step_changed(self) -> None:
        """The length of a tick has changed."""
        tick_rate = 1.0 / self._simulation.step_s
        self._clock_divisor = ticks_between(self._clock_rate, tick_rate)
        # Who gets the time less often than each tick sees no difference; commands wait a little longer.
        most, most_late = (max(1, int(time_s * tick_rate + 1e-6)) for time_s in (MAX_AT_ONCE_S, MAX_LATE_AT_ONCE_S))
        usual = min(self._clock_divisor, most)
        self._simulation.turn_lengths = usual, most if usual < most else most_late
        self._states_divisor = ticks_between(STATES_RATE, tick_rate)
        self._contacts_divisor = ticks_between(CONTACTS_RATE, tick_rate)

    def on_turn(self) -> None:
        """While the world is paused: exclude that time from the measured rate, and show what services change."""
        if self._simulation.is_stepping:
            return
        self._meter.restart(self._simulation.time_s)
        now = time.perf_counter()
        if now - self._snapshot_written_at >= 1.0 / PAUSED_SNAPSHOT_RATE:
            self._snapshot_written_at = now
            self.write_snapshot()

    def on_tick(self) -> None:
        """Publish the messages due at this tick."""
        simulation = self._simulation
        tick = simulation.tick
        now = time.perf_counter()
        paused = simulation.paused
        in_real_time = simulation.real_time_factor == 1.0 and not paused
        clock_may_go = in_real_time or now - self._clock_sent_at >= 1.0 / MAX_WALL_CLOCK_RATE
        # The last of several ticks at once is enough: requests and messages are not handled in between.
        if paused or (clock_may_go and tick % simulation.ticks_at_once == 0):
            self._set_rospy_time()
        if clock_may_go and (tick % max(self._clock_divisor, simulation.ticks_at_once) == 0 or paused):
            self._clock_sent_at = now
            self.publish_clock()
        if tick % self._states_divisor == 0:
            # In lock-step every state counts.
            if in_real_time or paused or now - self._snapshot_written_at >= 1.0 / MAX_WALL_SNAPSHOT_RATE:
                self._snapshot_written_at = now
                self.write_snapshot()
            self._publish_states()
        if tick % self._contacts_divisor == 0 or paused:
            self._publish_contacts(now)
        factor = self._meter.update(simulation.time_s)
        if factor is not None:
            self._report(factor)

    def publish_clock(self) -> None:
        """Publish the time now."""
        seconds, nanoseconds = divmod(self._simulation.time_ns, 10**9)
        self._clock.publish_serialized(_CLOCK_MESSAGE.pack(_CLOCK_BYTES, seconds, nanoseconds))

    def time_was_reset(self) -> None:
        """Simulation time has jumped back."""
        self._meter.restart(self._simulation.time_s)
        self._set_rospy_time()
        self.publish_clock()
        self._snapshot.resets += 1
        self.write_snapshot()

    def write_snapshot(self) -> None:
        """Write the present state to the snapshot."""
        parts = []
        for model in self._simulation.world.models.values():
            pose = model.base_pose()
            parts += (pose.position, pose.quaternion)
            if model.joint_names:
                parts.append(model.read_joints()[0])
            for pose in model.loose_poses():
                parts += (pose.position, pose.quaternion)
        try:
            self._snapshot.write(self._simulation.tick, self._simulation.time_s, parts, self._simulation.paused)
        except ValueError as error:
            if not self._snapshot_too_small:
                self._log.warn("%s; windows and cameras stand still" % error)
            self._snapshot_too_small = True

    def _set_rospy_time(self) -> None:
        # Replaces rospy's own subscription to /clock, which this node does not have.
        rospy.rostime._rostime_current = rospy.Time(*divmod(self._simulation.time_ns, 10**9))
        with self._rospy_time_changed:
            self._rospy_time_changed.notify_all()

    def _publish_states(self) -> None:
        models = self._simulation.world.models
        if self._model_states.has_listeners:
            self._model_states.publish(ModelStates(
                list(models), [msg_from_pose(model.model_pose()) for model in models.values()],
                [msg_from_twist(*model.model_twist()) for model in models.values()]))
        if self._link_states.has_listeners:
            message = LinkStates()
            for model in models.values():
                for link in model.gazebo_links:
                    message.name.append("%s::%s" % (model.name, link))
                    message.pose.append(msg_from_pose(model.link_pose(link)))
                    message.twist.append(msg_from_twist(*model.link_twist(link)))
            self._link_states.publish(message)

    def _publish_contacts(self, now: float) -> None:
        too_soon = now - self._contacts_sent_at < 0.5 / CONTACTS_RATE and not self._simulation.paused
        if self._contacts.has_listeners and not too_soon:
            self._contacts_sent_at = now
            contacts = self._simulation.world.contacts()
            message = ContactsState(states=contact_states(contacts, self._collision_names))
            message.header.stamp, message.header.frame_id = stamp_ns(self._simulation.time_ns), "world"
            self._contacts.publish(message)

    def _report(self, factor: float) -> None:
        simulation = self._simulation
        if self._metrics.has_listeners:
            metrics = PerformanceMetrics(real_time_factor=factor)
            metrics.header.stamp = stamp_ns(simulation.time_ns)
            self._metrics.publish(metrics)
        ticks = simulation.ticks_at_once
        self._late_windows += ticks > simulation.turn_lengths[0]
        if self._late_windows == TOLD_AFTER_WINDOWS:
            self._late_windows += 1
            self._log.info("this machine is busy. To keep real time, /clock has %g messages a second while it is, and "
                           "commands wait up to %g ms for their tick" % (
                               1.0 / (max(ticks, self._clock_divisor) * simulation.step_s),
                               1e3 * ticks * simulation.step_s))
        wanted = simulation.real_time_factor
        news = None if simulation.paused else self._watch.news(factor, wanted)
        if news is not None:
            self._log.warn(slowness_line(wanted, *news))
