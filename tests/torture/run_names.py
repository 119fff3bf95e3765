# SPDX-License-Identifier: BSD-3-Clause
"""torture.py names: hostile names in every text of the requests to Gazebo's services, in this process and without ROS.

Each request is answered, by an error where the name is wrong, and no name comes to the ROS master that is none. What
Gazebo takes is taken: models are called anything.
"""
import os
import random
import threading
import time

import genpy
import rospkg
import rospy
from gazebo_msgs.srv import SpawnModelRequest
from hostile import hostile_text
from rosgraph.names import is_legal_name

from bullet_sim import World
from gazebo_ros import gazebo_services
from gazebo_ros.plugin_table import PluginTable
from gazebo_ros.simulation import Simulation
from gazebo_ros.spawning import Spawner, SpawnLookups
from gazebo_ros.world_lights import WorldLights
from loop_ros.request_queue import RequestQueue
from loop_ros.testing import FakeLog, FakeRos
from model_files.resources import ResourceFinder, model_folders
from sdf_model import ModelFolders

BATCH = 500
#: Names of models in Gazebo, and namespaces, that no request may be refused for.
GOOD_NAMES = ("box", "unit box 1", "a::b", "Würfel", "模型", "box-2", "1", "a/b", "$(arg x)")
GOOD_NAMESPACES = ("", "/", "arm", "/arm", "lab//one/", "/1")
WRONG = ("a\x01b", "\x1b[31m", "a\nb", "a\rb", "\x7f", "a b", "a-b", "~a", "//", "/a/../b", "a" * 3000, "::", "a::",
         "::a", "box::", "box::link::x", "world", "/", "%s", "{}", "\ufffe", "a\u2028b", "{0.__class__}")
URDF = """<robot name="r"><link name="link"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0"
iyz="0"/></inertial></link>%s</robot>"""
PLUGIN = """<gazebo><plugin name="c" filename="libgazebo_ros_p3d.so"><bodyName>link</bodyName>
<topicName>%s</topicName><frameName>%s</frameName></plugin></gazebo>"""
# Of all services: the two that wait for ticks, and those whose effect is not about names.
LEFT_OUT = ("/gazebo/advance", "/gazebo/spawn_urdf_model", "/gazebo/spawn_sdf_model")


class _Ros(FakeRos):
    """Also keeps the class of each service."""

    def __init__(self):
        super().__init__()
        self.classes = {}

    def service(self, name, srv_class, handler):
        self.classes[name] = srv_class
        return super().service(name, srv_class, handler)


class Gazebo:
    """Gazebo's services on a world, with a thread as the loop."""

    def __init__(self):
        packages = rospkg.RosPack()
        self.ros, log, self._requests = _Ros(), FakeLog(), RequestQueue()
        self._world, self._ends = World(), False
        simulation = Simulation(self._world, self._requests, log, self.ros.faults)
        config = os.path.join(packages.get_path("gazebo_ros"), "config", "model_plugins.yaml")
        folders = ModelFolders(model_folders(packages))
        spawner = Spawner(simulation, SpawnLookups(PluginTable.from_yaml(config), ResourceFinder(packages), folders),
                          self.ros, log, on_change=lambda: None)
        gazebo_services._parameters = dict  # there is no master
        gazebo_services.GazeboServices(simulation, spawner, WorldLights([]), self.ros, log)
        self._log, self.spawned = log, 0
        self._loop = threading.Thread(target=self._run, daemon=True)
        self._loop.start()
        self.kinds = [name for name in self.ros.classes if name not in LEFT_OUT]

    def _run(self):
        while not self._ends:
            self._requests.run_pending()
            self._requests.wait(0.01)

    def close(self):
        self._ends = True
        self._loop.join(60.0)
        self._world.close()

    def ask(self, name, request):
        """The response, by the loop where the service is one of the loop. Raises ``rospy.ServiceException``."""
        answer = self.ros.services[name]
        return answer(request) if name in LEFT_OUT else self._requests.call(answer, request)

    def spawn(self, choose):
        """Spawn a model and delete it again; returns what is wrong with the answers."""
        name, namespace, frame = (hostile(choose, good) for good in (GOOD_NAMES, GOOD_NAMESPACES, ("", "world")))
        has_plugin = choose.random() < 0.7
        topic = hostile(choose, ("pose", "/pose"))
        plugin = PLUGIN % tuple(map(escaped, (topic, hostile(choose, ("map", "world"))))) if has_plugin else ""
        request = SpawnModelRequest(model_name=name, model_xml=URDF % plugin, robot_namespace=namespace,
                                    reference_frame=frame)
        request.initial_pose.orientation.w = 1.0
        response = self.ask("/gazebo/spawn_urdf_model", request)
        said = "%r in %r, frame %r, topic %r: %s" % (name, namespace, frame, topic, response.status_message)
        found = [said for open_name in (*self.ros.publishers, *self.ros.subscriptions, *self.ros.services)
                 if not is_legal_name(open_name)]
        is_good = name in GOOD_NAMES and frame in ("", "world") and (
            not has_plugin or namespace in GOOD_NAMESPACES)
        if is_good and not response.success and topic in ("pose", "/pose"):
            found.append("refused: " + said)
        if not response.success and len(response.status_message) < 30:
            found.append("no reason: " + said)
        if response.success:
            self.spawned += 1
            request = self.ros.classes["/gazebo/delete_model"]._request_class(name)
            if not self.ask("/gazebo/delete_model", request).success:
                found.append("cannot be deleted: " + said)
        return found

    def other(self, choose):
        """A request to another service; returns what is wrong with the answer."""
        service = choose.choice(self.kinds)
        request = self.ros.classes[service]._request_class()
        fill(request, choose)
        response = self.ask(service, request)
        if getattr(response, "success", True) or response.status_message:
            return []
        return ["%s answers nothing to %s" % (service, str(request)[:300])]

    def take(self):
        """Faults that were noted in the log since the last call."""
        noted = ["%s: %s: %s" % (place, type(error).__name__, error) for place, error in self.ros.faults.noted]
        self.ros.faults.noted.clear()
        self._log.lines.clear()
        return noted


def hostile(choose, good):
    """A name, of which half are good."""
    if choose.random() < 0.5:
        return choose.choice(good)
    if choose.random() < 0.5:
        return choose.choice(WRONG)
    found = hostile_text(choose)
    # As the reader of messages gives it.
    return (found if isinstance(found, bytes) else found.encode("utf-8", "replace")).decode("utf-8", "replace")[:5000]


def escaped(text):
    """A text inside of XML, which has no control characters."""
    text = "".join(sign for sign in text if sign.isprintable() or sign in "\n\t")
    return text.replace("&", "&amp;").replace("<", "&lt;")


def fill(message, choose):
    """Give every text of a message a name."""
    for field, kind in zip(message.__slots__, message._slot_types, strict=True):
        value = getattr(message, field)
        if kind == "string":
            setattr(message, field, hostile(choose, GOOD_NAMES))
        elif kind == "string[]":
            setattr(message, field, [hostile(choose, GOOD_NAMES) for _ in range(choose.choice((0, 1, 3)))])
        elif isinstance(value, genpy.Message):
            fill(value, choose)


def run(options, journal):
    """Send the requests; return figures for the result."""
    gazebo, began = Gazebo(), time.monotonic()
    last = options.first + options.messages
    for first in range(options.first, last, BATCH):
        if options.until is not None and time.monotonic() > options.until:
            break
        count, problems = min(BATCH, last - first), []
        for index in range(first, first + count):
            choose = random.Random("%d/%d" % (options.seed, index))
            ask = gazebo.spawn if choose.random() < 0.1 else gazebo.other
            journal.note(index, ask.__name__, "hostile", "")
            try:
                problems += ask(choose)
            except (rospy.ServiceException, Exception) as error:  # noqa: BLE001  (a request is always answered)
                problems.append("%s: %s" % (type(error).__name__, error))
        problems += gazebo.take()
        if problems:
            journal.fail("; ".join(problems[:5]), options.seed, first, count)
            break
    gazebo.close()
    return {"also": {"services": len(gazebo.kinds) + 1, "models_spawned": gazebo.spawned,
                     "seconds": round(time.monotonic() - began, 1)}}
