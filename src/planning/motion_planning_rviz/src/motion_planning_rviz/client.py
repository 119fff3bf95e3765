# SPDX-License-Identifier: BSD-3-Clause
"""The way to a running move_group, ours or MoveIt's: its public actions, services and topics."""
from __future__ import annotations

import threading
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any, NamedTuple

import actionlib
import numpy as np
import rospy
from moveit_msgs import msg, srv
from moveit_msgs.msg import MoveItErrorCodes, PlanningSceneComponents
from shape_msgs.msg import SolidPrimitive
from std_msgs.msg import String

from motion_planning.errors import PlanningError
from motion_planning_rviz.interaction import group_values
from motion_planning_rviz.messages import code_name, goal_constraints, pose_message, state_message, state_values

if TYPE_CHECKING:
    from actionlib import ClientGoalHandle

    from motion_planning.model import PlanningModel, State
    from motion_planning_rviz.drawing import Colour
    from motion_planning_rviz.interaction import Handle, PanelQuery

SERVICES = {"apply_planning_scene": srv.ApplyPlanningScene, "check_state_validity": srv.GetStateValidity,
            "compute_ik": srv.GetPositionIK, "get_planning_scene": srv.GetPlanningScene,
            "query_planner_interface": srv.QueryPlannerInterfaces}
ACTIONS = {"move_group": msg.MoveGroupAction, "execute_trajectory": msg.ExecuteTrajectoryAction}
#: Time limit for a service that does not exist yet [s].
SERVICE_WAIT_S = 2.0


class NoAnswer(PlanningError):
    """move_group does not answer, or refuses."""


class NoPosture(PlanningError):
    """Inverse kinematics found nothing. code: the name of MoveIt's error code."""

    def __init__(self, code: str) -> None:
        super().__init__(code)
        self.code = code


class BodyTouch(NamedTuple):
    """Two bodies that touch, by name. links: those of them that are links of the robot; held: those that it holds;
    point (3,) in ``frame``."""

    a: str
    b: str
    links: tuple[str, ...]
    held: tuple[str, ...]
    point: tuple[float, float, float]
    frame: str


class SceneSnapshot(NamedTuple):
    """values: {joint: value} of the robot; objects: CollisionObjects; attached: AttachedCollisionObjects; colours:
    {object: r g b a}; is_measured: whether move_group has heard from the joints, which otherwise stand at their
    defaults."""

    values: dict[str, float]
    objects: list[msg.CollisionObject]
    attached: list[msg.AttachedCollisionObject]
    colours: dict[str, Colour]
    is_measured: bool = True


class ActionOutcome(NamedTuple):
    """How an action ended. text: of its server, or the error code's name; trajectory: the RobotTrajectory of a plan;
    seconds: planning time."""

    success: bool
    text: str
    trajectory: msg.RobotTrajectory | None = None
    seconds: float = 0.0


class MoveGroupClient:
    """Calls and goals. model: PlanningModel; planning_time_s: allowed for a plan."""

    def __init__(self, model: PlanningModel, planning_time_s: float) -> None:
        self._model, self._planning_time_s = model, planning_time_s
        self._proxies: dict[str, rospy.ServiceProxy] = {}
        self._clients = {name: actionlib.ActionClient(name, kind) for name, kind in ACTIONS.items()}
        self._event = rospy.Publisher("trajectory_execution_event", String, queue_size=5)
        self._lock = threading.Lock()
        self._handles = set()

    # -- questions ----------------------------------------------------------------------------------------------

    def snapshot(self) -> SceneSnapshot:
        """Return a SceneSnapshot of the present scene. Raises NoAnswer."""
        parts = PlanningSceneComponents
        scene = self._call("get_planning_scene", parts(
            parts.ROBOT_STATE | parts.ROBOT_STATE_ATTACHED_OBJECTS | parts.WORLD_OBJECT_NAMES
            | parts.WORLD_OBJECT_GEOMETRY | parts.OBJECT_COLORS)).scene
        colours = {entry.id: (entry.color.r, entry.color.g, entry.color.b, entry.color.a)
                   for entry in scene.object_colors}
        return SceneSnapshot(state_values(scene.robot_state), list(scene.world.collision_objects),
                             list(scene.robot_state.attached_collision_objects), colours,
                             not scene.robot_state.joint_state.header.stamp.is_zero())

    def posture(self, handle: Handle, pose: np.ndarray, state: State, avoid: bool) -> dict[str, float]:
        """Return {joint: value} that put a handle's link to ``pose`` (4, 4) in the root link, near ``state``.

        Raises NoPosture and NoAnswer.
        """
        request = msg.PositionIKRequest(group_name=handle.group, ik_link_name=handle.link, avoid_collisions=avoid,
                                        robot_state=state_message(state.positions))
        request.pose_stamped.header.frame_id = self._model.root
        request.pose_stamped.pose = pose_message(pose)
        answer = self._call("compute_ik", request)
        if answer.error_code.val != MoveItErrorCodes.SUCCESS:
            raise NoPosture(code_name(answer.error_code.val))
        return state_values(answer.solution)

    def validity(self, group: str, state: State) -> tuple[bool, list[BodyTouch]]:
        """Return (whether move_group takes ``state``, [BodyTouch ...]). Raises NoAnswer."""
        answer = self._call("check_state_validity", state_message(state.positions), group, msg.Constraints())
        return answer.valid, [_touch(contact) for contact in answer.contacts]

    def planners(self, group: str) -> tuple[tuple[str, str], ...]:
        """Return ((pipeline, planner), ...) for a group. Raises NoAnswer."""
        found = []
        for interface in self._call("query_planner_interface").planner_interfaces:
            for name in interface.planner_ids:
                # "arm[RRTConnect]" are the settings of a planner for one group.
                owner, bracket, rest = name.partition("[")
                if bracket and owner != group:
                    continue
                found.append((interface.pipeline_id, rest.rstrip("]") if bracket else name))
        return tuple(dict.fromkeys(found))

    def _call(self, name: str, *values: object) -> Any:
        """Return a service's response. Connections stay open: a marker that is dragged calls often."""
        for attempt in (1, 2):
            try:
                if name not in self._proxies:
                    rospy.wait_for_service(name, SERVICE_WAIT_S)
                    self._proxies[name] = rospy.ServiceProxy(name, SERVICES[name], persistent=True)
                return self._proxies[name](*values)
            except (rospy.ROSException, rospy.ServiceException) as error:
                proxy = self._proxies.pop(name, None)
                if proxy is not None:
                    proxy.close()
                if proxy is None or attempt == 2:
                    raise NoAnswer("service %s does not answer: %s" % (rospy.resolve_name(name), error)) from None
        raise AssertionError("not reached")

    # -- the scene ----------------------------------------------------------------------------------------------

    def add_box(self, name: str, size: float, pose: np.ndarray) -> None:
        """Put a cube with sides of ``size`` [m] at ``pose`` (4, 4) in the root link. Raises NoAnswer."""
        box = msg.CollisionObject(id=name, operation=msg.CollisionObject.ADD,
                                  primitives=[SolidPrimitive(SolidPrimitive.BOX, [size] * 3)],
                                  primitive_poses=[pose_message(pose)])
        box.header.frame_id = self._model.root
        self._apply(objects=[box])

    def remove(self, name: str) -> None:
        """Take an object out of the world. Raises NoAnswer."""
        self._apply(objects=[msg.CollisionObject(id=name, operation=msg.CollisionObject.REMOVE)])

    def attach(self, name: str, link: str, touch_links: Iterable[str]) -> None:
        """Fix an object of the world to a link. Raises NoAnswer."""
        held = msg.AttachedCollisionObject(link_name=link, touch_links=list(touch_links))
        held.object.id, held.object.operation = name, msg.CollisionObject.ADD
        self._apply(attached=[held])

    def detach(self, name: str, link: str) -> None:
        """Put what a link holds back into the world. Raises NoAnswer."""
        held = msg.AttachedCollisionObject(link_name=link)
        held.object.id, held.object.operation = name, msg.CollisionObject.REMOVE
        self._apply(attached=[held])

    def _apply(self, objects: Iterable[msg.CollisionObject] = (),
               attached: Iterable[msg.AttachedCollisionObject] = ()) -> None:
        scene = msg.PlanningScene(is_diff=True)
        scene.robot_state.is_diff = True
        scene.world.collision_objects, scene.robot_state.attached_collision_objects = list(objects), list(attached)
        if not self._call("apply_planning_scene", scene).success:
            raise NoAnswer("move_group refuses the change of the scene; its log says why")

    # -- motions ------------------------------------------------------------------------------------------------

    def plan(self, query: PanelQuery, execute: bool, done: Callable[[ActionOutcome], None]) -> None:
        """Plan for an interaction.PanelQuery, and ``execute`` it at once where that is true; ``done(ActionOutcome)`` is
        called in a thread of actionlib's. Raises NoAnswer."""
        goal = msg.MoveGroupGoal()
        request, options = goal.request, goal.planning_options
        request.group_name, request.pipeline_id, request.planner_id = query.group, query.pipeline, query.planner
        request.allowed_planning_time, request.num_planning_attempts = self._planning_time_s, 1
        request.max_velocity_scaling_factor = request.max_acceleration_scaling_factor = query.speed
        request.start_state = state_message({} if query.start is None else query.start.positions)
        request.goal_constraints = [goal_constraints(group_values(self._model, query.goal, query.group))]
        options.plan_only = not execute
        options.planning_scene_diff.is_diff = options.planning_scene_diff.robot_state.is_diff = True
        self._send("move_group", goal, done)

    def execute(self, trajectory: msg.RobotTrajectory, done: Callable[[ActionOutcome], None]) -> None:
        """Follow a RobotTrajectory; ``done(ActionOutcome)`` as in :meth:`plan`. Raises NoAnswer."""
        self._send("execute_trajectory", msg.ExecuteTrajectoryGoal(trajectory), done)

    def stop(self) -> None:
        """Stop all planning and execution, also that of other clients."""
        with self._lock:
            handles = tuple(self._handles)
        for handle in handles:
            handle.cancel()
        self._event.publish("stop")

    def _send(self, name: str, goal: rospy.Message, done: Callable[[ActionOutcome], None]) -> None:
        client = self._clients[name]
        # A duration below 0 checks once: the client's own wait never ends while simulation time is paused.
        if not client.wait_for_server(rospy.Duration(0, -1)):
            raise NoAnswer("move_group is not there: nobody serves the action %s" % rospy.resolve_name(name))

        ended = threading.Event()

        def transition(handle: ClientGoalHandle) -> None:
            if handle.get_comm_state() == actionlib.CommState.DONE:
                ended.set()
                with self._lock:
                    self._handles.discard(handle)
                done(_outcome(handle))

        # Sent without our lock: actionlib holds its own lock while it calls transition, which needs ours.
        handle = client.send_goal(goal, transition_cb=transition)
        with self._lock:
            # actionlib forgets a handle without a reference.
            if not ended.is_set():
                self._handles.add(handle)


def _touch(contact: msg.ContactInformation) -> BodyTouch:
    bodies = ((contact.contact_body_1, contact.body_type_1), (contact.contact_body_2, contact.body_type_2))
    kinds = msg.ContactInformation
    return BodyTouch(contact.contact_body_1, contact.contact_body_2,
                     tuple(name for name, kind in bodies if kind == kinds.ROBOT_LINK),
                     tuple(name for name, kind in bodies if kind == kinds.ROBOT_ATTACHED),
                     (contact.position.x, contact.position.y, contact.position.z), contact.header.frame_id)


def _outcome(handle: ClientGoalHandle) -> ActionOutcome:
    result, text = handle.get_result(), handle.get_goal_status_text()
    if result is None:
        return ActionOutcome(False, text or "no result came")
    success = result.error_code.val == MoveItErrorCodes.SUCCESS
    return ActionOutcome(success, text or code_name(result.error_code.val), getattr(result, "planned_trajectory", None),
                         getattr(result, "planning_time", 0.0))
