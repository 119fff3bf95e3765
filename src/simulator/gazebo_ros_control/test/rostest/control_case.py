# SPDX-License-Identifier: BSD-3-Clause
"""A robot of two joints in the running simulator, its controller manager, and helpers for tests."""
import contextlib
import os
import signal
import subprocess
import unittest

import rospy
from controller_manager_msgs.srv import (
    ListControllers,
    ListControllerTypes,
    LoadController,
    ReloadControllerLibraries,
    SwitchController,
    UnloadController,
)
from gazebo_msgs.srv import DeleteModel, GetWorldProperties, SetModelConfiguration, SpawnModel
from geometry_msgs.msg import Point, Pose, Quaternion
from rosgraph_msgs.msg import Log
from sensor_msgs.msg import JointState
from std_srvs.srv import Empty

from lab_testing.waiting import wait_until

BEST_EFFORT, STRICT = 1, 2
DEADLINE_S = 90.0
POSITION = "hardware_interface::PositionJointInterface"


class Manager:
    """The services of one robot's controller manager."""

    def __init__(self, namespace):
        self.namespace = namespace
        for name, srv_class in (("list_controllers", ListControllers), ("list_controller_types", ListControllerTypes),
                                ("load_controller", LoadController), ("unload_controller", UnloadController),
                                ("switch_controller", SwitchController),
                                ("reload_controller_libraries", ReloadControllerLibraries)):
            proxy = rospy.ServiceProxy("%s/controller_manager/%s" % (namespace, name), srv_class)
            proxy.wait_for_service(DEADLINE_S)
            setattr(self, "_" + name, proxy)

    def load(self, name):
        return self._load_controller(name).ok

    def unload(self, name):
        return self._unload_controller(name).ok

    def switch(self, start=(), stop=(), strictness=STRICT, timeout=0.0):
        return self._switch_controller(list(start), list(stop), strictness, False, timeout).ok

    def listing(self):
        return self._list_controllers().controller

    def states(self):
        return {controller.name: controller.state for controller in self.listing()}

    def types(self):
        return self._list_controller_types()

    def reload(self, force):
        return self._reload_controller_libraries(force).ok


class Joints:
    """The newest message on a robot's joint_states."""

    def __init__(self, namespace):
        self.newest, self.count = None, 0
        self._topic = namespace + "/joint_states"
        self._subscriber = rospy.Subscriber(self._topic, JointState, self._take)

    def _take(self, message):
        self.newest, self.count = message, self.count + 1

    def at(self, tolerance=0.002, **wanted):
        """Wait until joints are at the positions given by name."""
        wait_until(lambda: self.newest and all(
            abs(dict(zip(self.newest.name, self.newest.position, strict=True))[name] - position) < tolerance
            for name, position in wanted.items()), lambda: "%s at %s (last %s)" % (self._topic, wanted, self.newest))

    def close(self):
        self._subscriber.unregister()


class ControlCase(unittest.TestCase):
    """Each test has the robot `one`, freshly spawned, and leaves an empty world."""

    @classmethod
    def setUpClass(cls):
        for name, srv_class in (("spawn_urdf_model", SpawnModel), ("delete_model", DeleteModel),
                                ("get_world_properties", GetWorldProperties), ("pause_physics", Empty),
                                ("unpause_physics", Empty), ("reset_world", Empty), ("reset_simulation", Empty),
                                ("set_model_configuration", SetModelConfiguration)):
            proxy = rospy.ServiceProxy("/gazebo/" + name, srv_class)
            proxy.wait_for_service(DEADLINE_S)
            setattr(cls, name, staticmethod(proxy))
        cls.urdf = rospy.get_param("/robot_description")
        cls.log = []
        cls._rosout = rospy.Subscriber("/rosout", Log, cls.log.append)

    def setUp(self):
        self._publishers = {}
        self._cleanups_of_test = contextlib.ExitStack()
        self.spawn("one")
        self.one = Manager("/one")

    def tearDown(self):
        self._cleanups_of_test.close()
        self.unpause_physics()
        for name in self.get_world_properties().model_names:
            if name != "ground_plane":
                self.delete_model(name)

    def spawn(self, name, urdf=None):
        xml = (urdf or self.urdf).replace("/one<", "/%s<" % name)
        response = self.spawn_urdf_model(name, xml, "/", Pose(Point(0, 0, 0), Quaternion(0, 0, 0, 1)), "")
        self.assertTrue(response.success, response.status_message)

    def joints(self, namespace="/one"):
        joints = Joints(namespace)
        self._cleanups_of_test.callback(joints.close)
        return joints

    def send(self, topic, message):
        if topic not in self._publishers:
            publisher = rospy.Publisher(topic, type(message), queue_size=1)
            self._publishers[topic] = publisher
            self._cleanups_of_test.callback(publisher.unregister)
            wait_until(publisher.get_num_connections, "a listener on " + topic)
        self._publishers[topic].publish(message)

    def said(self, *words):
        """Wait for one line in the log that has all ``words``."""
        return wait_until(lambda: [m.msg for m in self.log if all(word in m.msg for word in words)],
                        "a log line with %s" % (words,))[0]

    def start(self, *names, manager=None):
        manager = manager or self.one
        for name in names:
            self.assertTrue(manager.load(name), name)
        self.assertTrue(manager.switch(names))

    @contextlib.contextmanager
    def process(self, *command, namespace="/one"):
        """Run a tool in a namespace; it gets SIGINT afterwards and must end."""
        process = subprocess.Popen(["rosrun", "controller_manager", *command], stdout=subprocess.PIPE, text=True,
                                   stderr=subprocess.STDOUT, env={**os.environ, "ROS_NAMESPACE": namespace},
                                   start_new_session=True)
        try:
            yield process
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGINT)
            try:
                process.communicate(timeout=DEADLINE_S)
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signal.SIGKILL)
                raise

    def tool(self, *command, namespace="/one"):
        """(exit code, output) of a tool that ends by itself."""
        done = subprocess.run(["rosrun", "controller_manager", *command], capture_output=True, text=True,
                              env={**os.environ, "ROS_NAMESPACE": namespace}, timeout=DEADLINE_S)
        return done.returncode, done.stdout + done.stderr
