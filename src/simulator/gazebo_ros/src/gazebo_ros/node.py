# SPDX-License-Identifier: BSD-3-Clause
"""The /gazebo node: reads its parameters, builds the loop and its parts, runs it, cleans up."""
from __future__ import annotations

import contextlib
import gc
import logging
import os
import signal
import sys
import threading
import time
from typing import TYPE_CHECKING

import rosgraph
import roslib.packages
import rospkg
import rospy

from bullet_sim import BulletSimError, World
from gazebo_ros.command_line import CommandLine
from gazebo_ros.diagnostics import Diagnostics
from gazebo_ros.gazebo_services import GazeboServices
from gazebo_ros.model_plugin import PluginError
from gazebo_ros.pacing import wake_on_time
from gazebo_ros.picture_process import PictureProcess
from gazebo_ros.plugin_table import PluginTable
from gazebo_ros.publications import SimulationPublications
from gazebo_ros.simulation import Simulation
from gazebo_ros.spawning import Spawner, SpawnLookups
from gazebo_ros.world_file import WorldFileError, find_world, read_world
from gazebo_ros.world_lights import WorldLights
from loop_ros.faults import Faults
from loop_ros.log import LoopLog
from loop_ros.publisher import PublisherHub
from loop_ros.request_queue import RequestQueue
from loop_ros.ros_objects import RosObjects
from loop_ros.subscriber import SubscriberHub
from master_calls.single_instance import refusal, running_instance
from model_files.resources import ResourceFinder, model_folders, model_sizes, plugin_tables, resource_folders
from rospy_nodes.start import limit_ports
from sdf_model import ModelFolders
from world_picture import snapshot
from world_picture.snapshot import SnapshotError

if TYPE_CHECKING:
    from rospy_fixes.ports.threads import ThreadFaults

# How long threads may hold the interpreter [s]. PyBullet holds it during a step. With the default of 5 ms, one busy
# thread would take more than half of the loop's time.
_SWITCH_INTERVAL_S = 0.0005
# How long the threads of rospy get to end after the loop has [s].
_THREADS_END_S = 0.3


def main(argv: list[str] | None = None) -> int:
    """Run the simulator until a signal or a shutdown request ends it; returns the exit code."""
    argv = sys.argv if argv is None else argv
    try:
        line = CommandLine(rospy.myargv(argv)[1:])
    except ValueError as error:
        print(error, file=sys.stderr)
        return 2
    name = rosgraph.names.load_mappings(argv).get("__name", "gazebo")
    namespace = rosgraph.names.get_ros_namespace(argv=argv)
    node_name = rosgraph.names.ns_join(namespace, name)
    try:
        found = running_instance(node_name)
    except OSError as error:
        print("No ROS master at %s (%s): start roscore or use roslaunch." % (rosgraph.get_master_uri(), error),
              file=sys.stderr)
        return 1
    if found is not None:
        print(refusal(node_name, *found), file=sys.stderr)
        return 1

    ending = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: ending.set())
    threads = limit_ports(publishes=False)  # the loop publishes for them
    rospy.init_node(name, argv=argv, disable_rostime=True, disable_signals=True)
    rospy.rostime._set_rostime(rospy.Time(0, 0))
    if not rospy.has_param("/use_sim_time"):
        rospy.set_param("/use_sim_time", True)

    sys.setswitchinterval(_SWITCH_INTERVAL_S)
    log = LoopLog({"info": rospy.loginfo, "warn": rospy.logwarn, "error": rospy.logerr})
    code = 1
    try:
        with contextlib.ExitStack() as cleanup:
            simulation = _build(log, cleanup, line, threads)
            gc.freeze()
            wake_on_time()
            simulation.run(lambda: ending.is_set() or rospy.is_shutdown())
            code = 0
    except (WorldFileError, PluginError, BulletSimError, ValueError) as error:
        log.error(str(error))
    finally:
        _end(log, code)
    return code


def _build(log: LoopLog, cleanup: contextlib.ExitStack, line: CommandLine, threads: ThreadFaults) -> Simulation:
    """Build everything, from the parameters to a simulation that is ready to run; clean-up functions go on ``cleanup``.

    ``line``: :class:`CommandLine`, which overrides the parameters; ``threads``: what rospy's threads meet.
    """
    if line.ignored:
        log.warn("these words of the command line have no effect here: %s" % " ".join(line.ignored))
    packages = rospkg.RosPack()
    share = packages.get_path("gazebo_ros")
    world_name = line.world_name or rospy.get_param("~world_name", "worlds/empty.world")
    folders = ModelFolders(model_folders(packages), model_sizes(packages))
    description = read_world(find_world(world_name, [share, *resource_folders(packages)]), folders)
    if description.warning:
        log.warn(description.warning)
    for problem in description.problems:
        log.error(problem)
    table = PluginTable.from_yaml(os.path.join(share, "config", "model_plugins.yaml"),
                                  rospy.get_param("~model_plugins", None), plugin_tables(packages), log.warn)
    finder = ResourceFinder(packages)

    writer = _snapshot_writer(log)
    cleanup.callback(writer.close)
    seed = rospy.get_param("~seed", 0) if line.seed is None else line.seed
    world = World(time_step_s=description.time_step_s, gravity=description.gravity, seed=int(seed), find_mesh=finder,
                  warn=log.warn, error=log.error)
    cleanup.callback(world.close)

    publisher_hub, subscriber_hub, requests = PublisherHub(), SubscriberHub(), RequestQueue()
    cleanup.callback(requests.close)
    cleanup.callback(subscriber_hub.close)
    faults = Faults(log)
    ros = RosObjects(publisher_hub, subscriber_hub, requests, log, faults)
    simulation = Simulation(world, requests, log, faults,
                            real_time_factor=float(rospy.get_param("~real_time_factor", 1.0)),
                            paused=line.paused or bool(rospy.get_param("~paused", False)), deliveries=ros.deliveries)
    publications = SimulationPublications(simulation, ros, writer, log,
                                          clock_rate=float(rospy.get_param("~clock_rate",
                                                                           1.0 / description.time_step_s)))
    lights = WorldLights(description.lights, description.scene)

    pictures = _picture_process(line, log)
    cleanup.callback(pictures.close)

    def tell_viewers():
        if any(spawner.sensors.values()):
            pictures.want()
        try:
            writer.write_scene(spawner.listed(), lights.listed())
        except SnapshotError as error:
            log.error_throttle(60.0, str(error))
        publications.write_snapshot()

    library = SpawnLookups(table, finder, folders)
    spawner = Spawner(simulation, library, ros, log, on_change=tell_viewers, folder=writer.folder)
    services = GazeboServices(simulation, spawner, lights, ros, log)
    spawner.spawn_world(description.models)
    tell_viewers()
    lights.on_change = tell_viewers
    if writer.folder is not None:
        rospy.set_param("~snapshot", str(writer.folder))
    ros.flush()

    diagnostics = Diagnostics(simulation, faults, threads, ros)

    def send():
        publisher_hub.service(is_paused=not simulation.is_stepping)

    parts = (("sending messages", send), ("reading messages", subscriber_hub.service),
             ("publishing", publications.on_turn), ("services under /gazebo", services.take_commands))

    def on_turn():
        for what, part in parts:
            # One by one: if one fails, the others are still served.
            faults.guarded(what, part)

    def on_tick():
        publications.on_tick()
        diagnostics.on_tick()

    simulation.on_turn = on_turn
    simulation.read_messages = subscriber_hub.service
    simulation.before_step = services.push
    simulation.on_tick = on_tick
    def on_step_change():
        publications.step_changed()
        diagnostics.step_changed()

    simulation.on_step_change = on_step_change
    simulation.on_time_reset = publications.time_was_reset
    cleanup.callback(simulation.unhost)
    return simulation


def _picture_process(line: CommandLine, log: LoopLog) -> PictureProcess:
    """The process that draws cameras, where the launch file does not start it (``line.starts_renderer``)."""
    def runs_already():
        if not line.starts_renderer:
            return True
        try:
            return running_instance("/sensor_renderer") is not None
        except OSError:
            return False

    nodes = roslib.packages.find_node("sensor_renderer", "sensor_renderer")
    return PictureProcess([sys.executable, *nodes[:1], "--end-with-input", "__ns:=/"],
                          runs_already, log)


def _snapshot_writer(log: LoopLog) -> snapshot.SnapshotWriter | snapshot.NoSnapshot:
    """A new snapshot; if there is no space for it, the lab goes on without pictures."""
    snapshot.remove_stale()
    try:
        return snapshot.SnapshotWriter()
    except SnapshotError as error:
        log.error("%s until there is room and the simulator is started again; everything else works" % error)
        return snapshot.NoSnapshot()


def _end(log: LoopLog, code: int) -> None:
    """Leave the ROS graph and end the process, even if threads of rospy still wait."""
    rospy.signal_shutdown("the simulator ends")
    log.close()
    deadline = time.monotonic() + _THREADS_END_S
    for thread in threading.enumerate():
        if thread is not threading.main_thread() and not thread.daemon:
            thread.join(max(0.0, deadline - time.monotonic()))
    logging.shutdown()
    sys.stdout.flush()
    sys.stderr.flush()
    # Otherwise, a subscription that still connects to a node that does not answer would keep the process alive for a
    # minute.
    os._exit(code)
