# SPDX-License-Identifier: BSD-3-Clause
"""The simulation and its objects for pages, in rospy: pause, step, reset, add, move, delete."""
from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import rosgraph
import rospkg
import rospy
from bullet_sim_msgs.srv import AdvanceTicks
from gazebo_msgs.msg import ModelState
from gazebo_msgs.srv import DeleteModel, GetModelState, GetPhysicsProperties, SpawnModel
from geometry_msgs.msg import Point, Pose, Quaternion
from std_srvs.srv import Empty

from gazebo_ros.gazebo_interface import GazeboInterfaceError, call
from lab_web.lab import RobotError
from lab_web.objects import NEW_PLACES, free_name, pose_of

if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from lab_web.task_queue import TaskQueue

# Services that do not answer: the simulator is just ending.
_TIMEOUT_S = 5.0
_SERVICES = {"pause": "pause_physics", "go_on": "unpause_physics", "reset": "reset_world"}
_NOT_OFFERED = ("ground_plane", "sun")


class SimulationControls:
    """``tasks``: :class:`lab_web.task_queue.TaskQueue`; ``bodies()``: {name: whether it is a robot}; ``answer(client,
    operation)``; ``changed({"paused": ...})``.
    """

    def __init__(self, tasks: TaskQueue, bodies: Callable[[], dict[str, bool]],
                 answer: Callable[[int, dict[str, Any]], object], changed: Callable[[dict[str, Any]], object]) -> None:
        self._tasks = tasks
        self._bodies = bodies
        self._answer = answer
        self._changed = changed
        self._paused = None
        self._models = Path(rospkg.RosPack().get_path("model_files")) / "models"
        self._put = rospy.Publisher("/gazebo/set_model_state", ModelState, queue_size=1)
        #: The objects that can be added.
        self.things = sorted(path.parent.name for path in self._models.glob("*/model.sdf")
                             if path.parent.name not in _NOT_OFFERED)

    def operations(self) -> dict[str, Callable[[int, dict[str, Any]], None]]:
        """{operation: method}, for :meth:`lab_web.lab.PageLab.add`."""
        return {"simulation": self.simulation, "spawn": self.spawn, "delete": self.delete, "grab": self.grab,
                "put": self.put}

    def look(self) -> None:
        """Tell the pages whether the simulation is paused. Waits."""
        try:
            paused = rospy.ServiceProxy("/gazebo/get_physics_properties", GetPhysicsProperties)().pause
        except (rospy.ServiceException, rosgraph.MasterException, OSError):
            return
        if paused != self._paused:
            self._paused = paused
            self._changed({"paused": paused})

    def simulation(self, client: int, operation: dict[str, Any]) -> None:
        """``do``: pause, go_on, step, reset. Raises RobotError."""
        do = operation.get("do")
        if do != "step" and (not isinstance(do, str) or do not in _SERVICES):
            raise RobotError("a simulation can %s, step, not %r" % (", ".join(_SERVICES), do))
        self._tasks.add(client, self._do, do)

    def spawn(self, client: int, operation: dict[str, Any]) -> None:
        """Add one of ``things``, by its ``name``, above the table's place. Raises RobotError."""
        thing = operation.get("name")
        if thing not in self.things:
            raise RobotError("there is no object %r to add; there are %s" % (thing, ", ".join(self.things)))
        self._tasks.add(client, self._spawn, thing)

    def delete(self, client: int, operation: dict[str, Any]) -> None:
        """Delete the object ``name``. Raises RobotError."""
        self._tasks.add(client, self._delete, self._object(operation))

    def grab(self, client: int, operation: dict[str, Any]) -> None:
        """Answer where the object ``name`` is: ``position`` [m] and ``orientation`` in the world. Raises RobotError."""
        self._tasks.add(client, self._grab, client, self._object(operation))

    def put(self, _client: int, operation: dict[str, Any]) -> None:
        """Put the object ``name`` at ``position``, ``orientation`` in the world, at rest. Raises RobotError."""
        name = self._object(operation)
        position, orientation = pose_of(operation)
        self._put.publish(ModelState(model_name=name, pose=Pose(Point(*position), Quaternion(*orientation)),
                                     reference_frame="world"))

    def _object(self, operation: dict[str, Any]) -> str:
        name, bodies = operation.get("name"), self._bodies()
        if not isinstance(name, str) or name not in bodies:
            raise RobotError("there is no object %r in the world; there are %s" % (name, ", ".join(bodies)))
        if bodies[name]:
            raise RobotError("%s is the robot" % name)
        return name

    def _do(self, do: str) -> None:
        if do == "step":
            self._require(_called("/gazebo/advance", AdvanceTicks, 1, [], 0.0))
        else:
            _called("/gazebo/" + _SERVICES[do], Empty)
        self.look()

    def _spawn(self, thing: str) -> None:
        bodies = self._bodies()
        place = NEW_PLACES.get(thing, NEW_PLACES[None])
        text = (self._models / thing / "model.sdf").read_text(encoding="utf-8")
        self._require(_called("/gazebo/spawn_sdf_model", SpawnModel, free_name(thing, bodies), text, "",
                              Pose(Point(*place), Quaternion(0.0, 0.0, 0.0, 1.0)), "world"))

    def _delete(self, name: str) -> None:
        self._require(_called("/gazebo/delete_model", DeleteModel, name))

    def _grab(self, client: int, name: str) -> None:
        found = _called("/gazebo/get_model_state", GetModelState, name, "world")
        self._require(found)
        point, turn = found.pose.position, found.pose.orientation
        self._answer(client, {"op": "grabbed", "name": name, "position": [point.x, point.y, point.z],
                              "orientation": [turn.x, turn.y, turn.z, turn.w]})

    @staticmethod
    def _require(answer: Any) -> None:
        if not answer.success:
            raise RobotError(answer.status_message)


def _called(name: str, service: type, *arguments: Any) -> Any:
    try:
        return call(name, service, *arguments, timeout_s=_TIMEOUT_S)
    except (GazeboInterfaceError, rosgraph.MasterException) as error:
        raise RobotError(str(error)) from None
    except OSError as error:
        raise RobotError("the ROS master does not answer (%s): start the lab again" % error.strerror) from None
