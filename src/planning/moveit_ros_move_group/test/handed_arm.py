# SPDX-License-Identifier: BSD-3-Clause
"""The small arm with a hand of one finger, and the parameters of its move_group, which plans sequences, too."""
import rospy
import small_arm
from good_requests import box, joint_goal, plan_request, there
from moveit_msgs.msg import (
    AttachedCollisionObject,
    Grasp,
    MotionSequenceItem,
    MoveGroupSequenceGoal,
    PickupGoal,
    PlaceGoal,
    PlaceLocation,
)
from sensor_msgs.msg import JointState
from small_arm import FREE, SIX
from std_msgs.msg import Header
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

PILZ = "pilz_industrial_motion_planner"
URDF = small_arm.URDF.replace("</robot>", """
  <link name="finger"><collision><geometry><box size="0.02 0.005 0.02"/></geometry></collision></link>
  <joint name="grip" type="prismatic"><origin xyz="0.15 0.03 0"/><parent link="l5"/><child link="finger"/>
    <axis xyz="0 1 0"/><limit lower="0" upper="0.03" effort="1" velocity="1"/></joint></robot>""")
SRDF = small_arm.SRDF.replace("</robot>", """
  <group name="hand"><joint name="grip"/></group>
  <end_effector name="claw" group="hand" parent_link="l5" parent_group="arm"/>
  <disable_collisions link1="l5" link2="finger" reason="Adjacent"/></robot>""")


def parameters(kind="last point"):
    """The parameters of a node for it. kind: how its fake controllers move."""
    tree = small_arm.parameters(kind)
    limits = {name: {"has_acceleration_limits": True, "max_acceleration": 4.0, "has_velocity_limits": True,
                     "max_velocity": 2.0} for name in SIX.joints}
    tree.update(robot_description=URDF, robot_description_semantic=SRDF, robot_description_planning={
        "joint_limits": limits, "cartesian_limits": {"max_trans_vel": 1.0, "max_trans_acc": 2.25, "max_trans_dec": -5.0,
                                                     "max_rot_vel": 1.57}})
    tree["~"].update(default_planning_pipeline="ompl", planning_pipelines={
        "ompl": {"planning_plugin": "ompl_interface/OMPLPlanner"},
        PILZ: {"planning_plugin": PILZ + "::CommandPlanner",
               "capabilities": "%s/MoveGroupSequenceAction %s/MoveGroupSequenceService" % (PILZ, PILZ)}})
    tree["~"]["controller_list"].append({"name": "fingers", "joints": ["grip"], "type": kind, "rate": 100.0})
    return tree


def joint_state():
    """The arm stands still, its hand half open."""
    return JointState(Header(stamp=rospy.Time.now()), [*SIX.joints, "grip"], [*FREE, 0.01], (), ())


def posture(opening):
    return JointTrajectory(joint_names=["grip"], points=[JointTrajectoryPoint(positions=[opening])])


def _along(way, x):
    way.direction.header.frame_id, way.direction.vector.x = SIX.tip, x
    way.desired_distance, way.min_distance = 0.02, 0.005


def thing():
    """The object where the hand goes."""
    ahead = there(SIX)
    return box(SIX, "thing", 0.01, (ahead.pose.position.x, ahead.pose.position.y, ahead.pose.position.z + 0.12))


def held():
    return AttachedCollisionObject(link_name=SIX.tip, object=thing(), touch_links=["finger", SIX.tip])


def good_goals():
    """{action: a goal that is reached}; ``thing`` has to be in the scene for a pickup, and held for a place."""
    grasp = Grasp(id="straight", grasp_pose=there(SIX), grasp_quality=0.5, pre_grasp_posture=posture(0.02),
                  grasp_posture=posture(0.0))
    _along(grasp.pre_grasp_approach, 1.0)
    _along(grasp.post_grasp_retreat, -1.0)
    pick = PickupGoal(target_name="thing", group_name="arm", end_effector="claw", possible_grasps=[grasp],
                      allowed_planning_time=2.0)
    where = PlaceLocation(id="there", place_pose=there(SIX))
    _along(where.pre_place_approach, 1.0)
    _along(where.post_place_retreat, -1.0)
    place = PlaceGoal(attached_object_name="thing", group_name="arm", place_locations=[where], place_eef=True,
                      allowed_planning_time=2.0)
    sequence = MoveGroupSequenceGoal()
    for values in (SIX.aside, SIX.free):
        item = MotionSequenceItem()
        plan_request(SIX, item.req)
        item.req.start_state.joint_state.name, item.req.start_state.joint_state.position = [], []
        item.req.start_state.is_diff = True
        item.req.pipeline_id, item.req.planner_id = PILZ, "PTP"
        item.req.goal_constraints = [joint_goal(SIX, values)]
        sequence.request.items.append(item)
    return {"pickup": pick, "place": place, "sequence_move_group": sequence}
