# SPDX-License-Identifier: BSD-3-Clause
"""Point to point, lines, arcs and sequences: where the link really is, between the points too, and what is refused."""
import math
import time
from dataclasses import replace

import numpy as np
import pytest

from motion_planning.constraints import ConstraintSet, JointTarget, OrientationTarget, PositionTarget
from motion_planning.exact import ExactChecker
from motion_planning.industrial import Auxiliary, CartesianLimits, IndustrialCommand, plan, plan_sequence
from motion_planning.industrial.profile import WINDOW_S, Profile
from motion_planning.pipeline import Code, PlanningFailure, PlanQuery, Tools
from motion_planning.scene import Scene, WorldObject
from urdf_model import Box, Sphere
from urdf_model.transforms import axis_rotation, rigid, rotation_angle

GROUP, TIP = "manipulator", "link_6"
# The tool in front of the arm, with room on all sides.
BENT = np.array([0.0, -0.8, 0.0, 0.0, 0.6, 0.0])
LIMITS = CartesianLimits(0.25, 0.5, 1.0, 1.57)
# The link is this near its way, wherever one looks [m].
NEAR_M = 1e-3


class Lab:
    """PROBOT in an empty scene."""

    def __init__(self, model, meshes):
        self.model, self.exact = model, ExactChecker(model, meshes)
        self.scene = Scene(model, model.state(dict(zip(model.variables, BENT, strict=True))))
        self.tools = Tools(self.exact, None, None, time.monotonic)

    def command(self, planner, goal, scene=None, auxiliary=None, **options):
        options = {"velocity_scaling": 0.5, "acceleration_scaling": 0.5, **options}
        velocities = options.pop("start_velocities", ())
        query = PlanQuery(scene or self.scene, options.pop("group", GROUP), [goal], planner_id=planner, **options)
        return IndustrialCommand(query, auxiliary, velocities)

    def plan(self, *arguments, **options):
        return plan(self.command(*arguments, **options), self.tools, LIMITS).timed

    def pose(self, q=BENT):
        return self.model.frame_of(np.asarray(q, dtype=float), TIP)

    def poses(self, timed, count=400):
        return np.array([self.pose(q) for q in timed.sampled(np.linspace(0.0, timed.duration, count))[0]])

    def refused(self, code, sentence, *arguments, **options):
        with pytest.raises(PlanningFailure, match=sentence) as info:
            self.plan(*arguments, **options)
        assert info.value.code == code


@pytest.fixture(scope="module")
def lab(probot, meshes):
    return Lab(probot, meshes)


def at(pose, link=TIP):
    """A goal: the link's pose."""
    return ConstraintSet("", (), [PositionTarget(link, [(Sphere(1e-4), rigid(np.eye(3), pose[:3, 3]))])],
                         [OrientationTarget(link, pose[:3, :3])])


def joints(values):
    return ConstraintSet("", [JointTarget("joint_%d" % (i + 1), value) for i, value in enumerate(values)])


def shifted(pose, x=0.0, y=0.0, z=0.0, turn=0.0):
    return rigid(pose[:3, :3] @ axis_rotation(np.array([0.0, 0.0, 1.0]), turn), pose[:3, 3] + (x, y, z))


def keeps_limits(model, timed, times=2000):
    _, velocity, acceleration = timed.sampled(np.linspace(0.0, timed.duration, times))
    assert (np.abs(velocity).max(axis=0) <= model.velocity + 1e-9).all()
    assert (np.abs(acceleration).max(axis=0) <= model.acceleration + 1e-9).all()


def from_line(points, a, b):
    along = (b - a) / np.linalg.norm(b - a)
    away = points - a
    return np.linalg.norm(away - np.outer(away @ along, along), axis=1)


def link_speed(lab, timed, count=4000):
    """Speeds and accelerations of the link by differences."""
    step = timed.duration / (count - 1)
    points = lab.poses(timed, count)[:, :3, 3]
    return (np.linalg.norm(np.diff(points, axis=0), axis=1) / step,
            np.linalg.norm(np.diff(points, 2, axis=0), axis=1) / step**2)


# -- profile --------------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("limits", [(0.5, 1.0, 2.0), (5.0, 1.0, 3.0), (1e-3, 1.0, 1.0)])
def test_profile_is_a_trapezoid_within_its_limits(limits):
    profile = Profile(*limits)
    times = np.linspace(-0.1, profile.duration + 0.1, 20001)
    way, speed, rate = profile.at(times)
    assert way[0] == 0.0 and way[-1] == pytest.approx(1.0, abs=1e-9)
    assert speed.max() <= limits[0] + 1e-12 and rate.max() <= limits[1] + 1e-9 and rate.min() >= -limits[2] - 1e-9
    assert np.gradient(way, times)[5:-5] == pytest.approx(speed[5:-5], abs=1e-4)
    assert np.abs(np.diff(rate)).max() < 1e-3 + max(limits) * (times[1] - times[0]) / WINDOW_S * 2.0
    assert profile.at(np.array([profile.time_at(0.3)]))[0][0] == pytest.approx(0.3, abs=1e-9)


# -- PTP ------------------------------------------------------------------------------------------------------------

def test_ptp_joints_start_and_arrive_together(lab):
    goal = np.array([0.8, -0.5, 0.2, 0.5, 0.6, -0.3])
    timed = lab.plan("PTP", joints(goal))
    assert timed.positions[-1] == pytest.approx(goal, abs=1e-9)
    moved = goal != BENT
    states = timed.sampled(np.linspace(0.0, timed.duration, 50))[0]
    shares = (states - BENT)[:, moved] / (goal - BENT)[moved]
    assert np.ptp(shares, axis=1).max() < 1e-6
    keeps_limits(lab.model, timed)
    # 0.8 rad at 0.5 of 1 rad/s^2 and of 3 rad/s: up and down without a stretch at full speed.
    assert timed.duration == pytest.approx(2.0 * math.sqrt(0.8 / 0.5) + WINDOW_S, rel=0.01)


def test_ptp_to_a_pose_takes_a_posture_near_the_start(lab):
    pose = shifted(lab.pose(), y=0.1, z=0.05)
    timed = lab.plan("PTP", at(pose))
    assert lab.pose(timed.positions[-1]) == pytest.approx(pose, abs=1e-4)
    assert np.abs(timed.positions[-1] - BENT).max() < 1.0


def test_ptp_where_it_is_has_one_point(lab):
    assert len(lab.plan("PTP", joints(BENT)).times) == 1


# -- LIN ------------------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("scaling", [1.0, 0.05])
def test_lin_keeps_to_its_line_between_points_too(lab, scaling):
    begin = lab.pose()
    goal = shifted(begin, x=-0.06, y=0.12, z=0.03, turn=0.4)
    timed = lab.plan("LIN", at(goal), velocity_scaling=scaling, acceleration_scaling=scaling)
    poses = lab.poses(timed)
    assert from_line(poses[:, :3, 3], begin[:3, 3], goal[:3, 3]).max() < NEAR_M
    assert poses[-1] == pytest.approx(goal, abs=1e-4)
    # The rotation is in step with the way.
    shares = np.linalg.norm(poses[:, :3, 3] - begin[:3, 3], axis=1) / np.linalg.norm(goal[:3, 3] - begin[:3, 3])
    turns = np.array([rotation_angle(begin[:3, :3].T @ pose[:3, :3]) for pose in poses]) / 0.4
    assert np.abs(shares - turns).max() < 0.01
    keeps_limits(lab.model, timed)
    speeds, accelerations = link_speed(lab, timed)
    assert speeds.max() <= scaling * LIMITS.trans_velocity * 1.01
    assert accelerations.max() <= scaling * LIMITS.trans_deceleration * 1.05
    assert timed.times[1] < 0.11 and timed.velocities[-1] == pytest.approx(np.zeros(6), abs=1e-6)


def test_lin_turns_on_the_spot(lab):
    goal = shifted(lab.pose(), turn=1.0)
    timed = lab.plan("LIN", at(goal), velocity_scaling=0.4)
    poses = lab.poses(timed)
    assert np.linalg.norm(poses[:, :3, 3] - lab.pose()[:3, 3], axis=1).max() < NEAR_M
    assert timed.duration >= 1.0 / (0.4 * LIMITS.rot_velocity)


def test_lin_to_joints_goes_to_their_pose(lab):
    goal = BENT + (0.2, 0.1, -0.1, 0.0, 0.1, 0.2)
    timed = lab.plan("LIN", joints(goal))
    assert lab.pose(timed.positions[-1]) == pytest.approx(lab.pose(goal), abs=1e-4)
    assert from_line(lab.poses(timed)[:, :3, 3], lab.pose()[:3, 3], lab.pose(goal)[:3, 3]).max() < NEAR_M


def test_lin_with_seven_joints_is_smooth(baxter):
    scene = Scene(baxter, baxter.state(baxter.groups["left_arm"].states["left_neutral"]))
    begin = baxter.frame_of(scene.state.q, "left_gripper")
    goal = shifted(begin, x=-0.1, y=-0.1, z=0.15)
    query = PlanQuery(scene, "left_arm", [at(goal, "left_gripper")], planner_id="LIN", velocity_scaling=0.3,
                      acceleration_scaling=0.3)
    timed = plan(IndustrialCommand(query), Tools(_Free(), None, None, time.monotonic), LIMITS).timed
    group = baxter.groups["left_arm"]
    states, _, accelerations = timed.sampled(np.linspace(0.0, timed.duration, 500))
    poses = np.array([baxter.frame_of(scene.state.with_q(q, group.indices).q, "left_gripper") for q in states])
    assert from_line(poses[:, :3, 3], begin[:3, 3], goal[:3, 3]).max() < NEAR_M
    assert np.abs(accelerations).max() <= baxter.acceleration[group.indices].max()


# -- CIRC -----------------------------------------------------------------------------------------------------------

def circle(lab, radius, angle):
    """(centre, pose on the circle in the plane of x = const at ``angle`` from the start's)."""
    begin = lab.pose()
    centre = begin[:3, 3] - (0.0, radius, 0.0)
    return centre, rigid(begin[:3, :3], centre + radius * np.array([0.0, math.cos(angle), math.sin(angle)]))


@pytest.mark.parametrize(("kind", "angle", "sweep"), [
    ("center", 1.2, 1.2), ("center", -2.0, 2.0), ("interim", 1.2, 1.2), ("interim", math.pi, math.pi),
    ("interim", 4.5, 4.5), ("center", 4.5, 2.0 * math.pi - 4.5)])
def test_circ_has_its_radius_and_way(lab, kind, angle, sweep):
    radius = 0.05
    centre, goal = circle(lab, radius, angle)
    point = centre if kind == "center" else circle(lab, radius, 0.4 * angle)[1][:3, 3]
    timed = lab.plan("CIRC", at(goal), auxiliary=Auxiliary(kind, point), velocity_scaling=0.3)
    poses = lab.poses(timed)
    assert np.abs(np.linalg.norm(poses[:, :3, 3] - centre, axis=1) - radius).max() < NEAR_M
    assert np.abs(poses[:, 0, 3] - centre[0]).max() < NEAR_M
    assert poses[-1] == pytest.approx(goal, abs=1e-4)
    length = np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1).sum()
    assert length == pytest.approx(radius * sweep, rel=0.01)
    keeps_limits(lab.model, timed)


@pytest.mark.parametrize(("kind", "offset", "sentence"), [
    ("center", (0.0, 0.0, 0.02), "m from the centre"), ("middle", (0.0, 0.0, 0.0), "not 'middle'"),
    ("interim", None, "on one line"), ("center", None, "on one line")])
def test_circ_refuses_what_is_no_circle(lab, kind, offset, sentence):
    centre, goal = circle(lab, 0.05, 1.2)
    point = centre + offset if offset else 0.5 * (lab.pose() + goal)[:3, 3]
    lab.refused(Code.INVALID_MOTION_PLAN, sentence, "CIRC", at(goal), auxiliary=Auxiliary(kind, point))


def test_circ_without_a_point(lab):
    lab.refused(Code.INVALID_MOTION_PLAN, "'center' or 'interim'", "CIRC", at(circle(lab, 0.05, 1.2)[1]))


# -- what is refused ------------------------------------------------------------------------------------------------

def test_refusals_have_codes_and_reasons(lab):
    pose = shifted(lab.pose(), y=0.1)
    lab.refused(Code.PLANNING_FAILED, "no planner 'SPLINE'", "SPLINE", at(pose))
    lab.refused(Code.INVALID_GROUP_NAME, "no group 'hand'", "PTP", at(pose), group="hand")
    lab.refused(Code.INVALID_MOTION_PLAN, "max_velocity_scaling_factor is 0", "PTP", at(pose), velocity_scaling=0.0)
    lab.refused(Code.INVALID_MOTION_PLAN, "max_acceleration_scaling_factor is 1.5", "LIN", at(pose),
                acceleration_scaling=1.5)
    lab.refused(Code.INVALID_ROBOT_STATE, "velocity 0.2 at joint 'joint_2'", "LIN", at(pose),
                start_velocities=(0.0, 0.2))
    lab.refused(Code.INVALID_GOAL_CONSTRAINTS, "one position and one orientation", "LIN",
                ConstraintSet("", (), at(pose).positions))
    lab.refused(Code.INVALID_GOAL_CONSTRAINTS, "got both", "PTP", at(pose).merged(joints(BENT)))
    lab.refused(Code.INVALID_GOAL_CONSTRAINTS, "needs all 6", "LIN", joints(BENT[:3]))
    lab.refused(Code.INVALID_GOAL_CONSTRAINTS, "limits are", "PTP", joints((9.0,)))
    lab.refused(Code.INVALID_LINK_NAME, "finger", "PTP", at(pose, "finger"))
    far = shifted(lab.pose(), y=3.0)
    lab.refused(Code.NO_IK_SOLUTION, "no posture", "PTP", at(far))
    lab.refused(Code.NO_IK_SOLUTION, "LIN ends after", "LIN", at(far))


def test_ptp_into_a_collision_is_an_invalid_plan_as_for_pilz(lab):
    """Its inverse kinematics looks at the robot alone; the scene is looked at when the motion is there."""
    goal = shifted(lab.pose(), y=0.1)
    before = lab.scene
    try:
        for at_goal in (True, False):
            place = goal if at_goal else lab.pose()
            lab.scene = before.with_object(WorldObject("wall", rigid(np.eye(3), place[:3, 3]),
                                                       ((Box((0.06, 0.06, 0.06)), np.eye(4)),)))
            lab.refused(Code.INVALID_MOTION_PLAN, "wall", "PTP", at(goal))
    finally:
        lab.scene = before


def test_lin_too_fast_for_a_joint_is_slower(lab):
    command = lab.command("LIN", at(shifted(lab.pose(), x=-0.1, y=0.2)), velocity_scaling=1.0, acceleration_scaling=1.0)
    timed = plan(command, lab.tools, CartesianLimits(3.0, 30.0, 30.0, 20.0)).timed
    keeps_limits(lab.model, timed)
    assert max((np.abs(timed.velocities) / lab.model.velocity).max(),
               (np.abs(timed.accelerations) / lab.model.acceleration).max()) > 0.9


def test_lin_far_too_fast_for_a_joint_is_refused(lab):
    with pytest.raises(PlanningFailure, match="cannot keep up with link 'link_6'.*times slower") as info:
        plan(lab.command("LIN", at(shifted(lab.pose(), x=-0.1, y=0.2))), lab.tools,
             CartesianLimits(300.0, 3000.0, 3000.0, 2000.0))
    assert info.value.code == Code.PLANNING_FAILED


def test_what_stands_in_the_way_is_named_and_not_planned_around(lab):
    goal = shifted(lab.pose(), y=0.2)
    block = WorldObject("block", shifted(lab.pose(), y=0.12), [(Box((0.05, 0.02, 0.05)), np.eye(4))])
    lab.refused(Code.INVALID_MOTION_PLAN, "collision on the way.*block", "LIN", at(goal),
                scene=lab.scene.with_object(block))


def test_a_broken_path_constraint_makes_the_plan_invalid(lab):
    held = ConstraintSet("", [JointTarget("joint_1", 0.0, 0.1, 0.1)])
    lab.refused(Code.INVALID_MOTION_PLAN, "path constraints: joint 'joint_1'", "PTP", joints((0.5, *BENT[1:])),
                path_constraints=held)


def test_a_stop_ends_the_planning(lab):
    tools = replace(lab.tools, stop=lambda: True)
    with pytest.raises(PlanningFailure) as info:
        plan(lab.command("LIN", at(shifted(lab.pose(), y=0.1))), tools, LIMITS)
    assert info.value.code == Code.PREEMPTED


# -- sequences ------------------------------------------------------------------------------------------------------

def corner(lab):
    begin = lab.pose()
    return begin, shifted(begin, y=0.12), shifted(begin, y=0.12, z=0.12)


@pytest.mark.parametrize("radius", [0.0, 0.02, 0.05])
@pytest.mark.parametrize("scaling", [0.2, 1.0])
def test_a_corner_of_two_lines_is_left_within_its_sphere_alone(lab, radius, scaling):
    begin, middle, end = corner(lab)
    options = {"velocity_scaling": scaling, "acceleration_scaling": scaling}
    commands = [lab.command("LIN", at(pose), **options) for pose in (middle, end)]
    (group, plan), = plan_sequence(commands, [radius, 0.0], lab.tools, LIMITS)
    timed = plan.timed
    assert group == GROUP
    assert (np.diff(timed.times) > 0.0).all()
    poses = lab.poses(timed, 1500)
    points = poses[:, :3, 3]
    off = np.minimum(from_line(points, begin[:3, 3], middle[:3, 3]), from_line(points, middle[:3, 3], end[:3, 3]))
    outside = np.linalg.norm(points - middle[:3, 3], axis=1) > radius
    assert off[outside].max() < NEAR_M
    nearest = np.linalg.norm(points - middle[:3, 3], axis=1).min()
    # The middle of a parabola that leaves both lines at ``radius`` is sqrt(2) / 4 of it away. At full speed joints are
    # too slow, and more so on one line than on the other: the slower one turns while the other is nearly in the corner.
    share = 1.0 if scaling < 1.0 else 0.4
    assert share * radius * math.sqrt(2.0) / 4.0 - NEAR_M <= nearest <= radius * math.sqrt(2.0) / 4.0 + NEAR_M
    # Neither turns the tool in the corner, nor leaves the plane of both lines.
    assert max(rotation_angle(begin[:3, :3].T @ pose[:3, :3]) for pose in poses) < 1e-4
    assert np.abs(points[:, 0] - begin[0, 3]).max() < 1e-4
    keeps_limits(lab.model, timed)
    speeds, accelerations = link_speed(lab, timed)
    assert speeds.max() <= scaling * LIMITS.trans_velocity * 1.02
    assert accelerations.max() <= scaling * LIMITS.trans_deceleration * 1.1
    inner = speeds[np.linalg.norm(points[0] - points[-1]) and len(speeds) // 10:-len(speeds) // 10]
    assert (inner.min() > 0.02 * scaling) == (radius > 0.0)
    assert poses[-1] == pytest.approx(end, abs=1e-4)


def test_a_rounded_corner_saves_time(lab):
    _, middle, end = corner(lab)
    commands = [lab.command("LIN", at(pose)) for pose in (middle, end)]
    stop, pass_over = (plan_sequence(commands, [radius, 0.0], lab.tools, LIMITS)[0][1].timed.duration
                       for radius in (0.0, 0.05))
    assert pass_over < 0.95 * stop


def test_a_corner_of_lines_that_joints_are_too_slow_for(lab):
    _, middle, end = corner(lab)
    commands = [lab.command("LIN", at(pose), velocity_scaling=1.0, acceleration_scaling=1.0) for pose in (middle, end)]
    for radius in (0.01, 0.03, 0.05):
        (_, plan), = plan_sequence(commands, [radius, 0.0], lab.tools, CartesianLimits())
        keeps_limits(lab.model, plan.timed)


def test_ptp_lin_and_circ_follow_each_other(lab):
    begin, middle, end = corner(lab)
    centre = shifted(end, y=-0.04)[:3, 3]
    last = rigid(end[:3, :3], centre + (0.0, 0.0, 0.04))
    commands = [lab.command("PTP", at(middle)), lab.command("LIN", at(end)),
                lab.command("CIRC", at(last), auxiliary=Auxiliary("center", centre))]
    (_, plan), = plan_sequence(commands, [0.03, 0.02, 0.0], lab.tools, LIMITS)
    keeps_limits(lab.model, plan.timed)
    points = lab.poses(plan.timed, 2000)[:, :3, 3]
    assert points[-1] == pytest.approx(last[:3, 3], abs=1e-4)
    assert 1e-3 < np.linalg.norm(points - middle[:3, 3], axis=1).min() < 0.03
    assert np.linalg.norm(points - end[:3, 3], axis=1).min() < 0.02
    assert link_speed(lab, plan.timed)[0][400:-400].min() > 0.01  # it stops nowhere
    # No jump: what is commanded is smooth.
    q, velocity, _ = plan.timed.sampled(np.linspace(0.0, plan.timed.duration, 5001))
    assert np.abs(np.gradient(q, plan.timed.duration / 5000, axis=0) - velocity)[2:-2].max() < 0.02


def test_two_groups_make_two_trajectories(baxter):
    scene = Scene(baxter, baxter.default_state())
    commands = []
    for side in ("left", "right", "right"):
        values = ConstraintSet("", [JointTarget(side + "_w2", 0.3 if not commands else -0.1 * len(commands))])
        commands.append(IndustrialCommand(PlanQuery(scene, side + "_arm", [values], planner_id="PTP")))
    tools = Tools(_Free(), None, None, time.monotonic)
    plans = plan_sequence(commands, [0.05, 0.0, 0.0], tools, LIMITS)
    assert [group for group, _ in plans] == ["left_arm", "right_arm"]
    assert plans[1][1].start.positions["left_w2"] == pytest.approx(0.3)
    assert plans[1][1].timed.positions[-1][-1] == pytest.approx(-0.2)


class _Free:
    """A checker for whom nothing ever touches."""

    def first_blocked(self, *_):
        return None


@pytest.mark.parametrize(("radii", "sentence"), [
    ((-0.1, 0.0, 0.0), "blend_radius of command 1 is -0.1"), ((0.0, 0.0, 0.1), "of the last command"),
    ((0.07, 0.07, 0.0), "overlap"), ((0.2, 0.0, 0.0), "within the blend radius"),
    ((float("nan"), 0.0, 0.0), "expected 0 or more")])
def test_radii_that_cannot_be(lab, radii, sentence):
    begin, middle, end = corner(lab)
    commands = [lab.command("LIN", at(pose)) for pose in (middle, end, shifted(end, y=-0.12))]
    with pytest.raises(PlanningFailure, match=sentence) as info:
        plan_sequence(commands, radii, lab.tools, LIMITS)
    assert info.value.code == Code.INVALID_MOTION_PLAN


def test_a_failing_command_is_named(lab):
    commands = [lab.command("PTP", at(corner(lab)[1])), lab.command("LIN", at(shifted(lab.pose(), y=3.0)))]
    with pytest.raises(PlanningFailure, match="command 2 of 2: LIN ends") as info:
        plan_sequence(commands, [0.0, 0.0], lab.tools, LIMITS)
    assert info.value.code == Code.NO_IK_SOLUTION


# -- limits ---------------------------------------------------------------------------------------------------------

def test_cartesian_limits_of_a_file():
    limits, complaints = CartesianLimits.from_mapping(
        {"max_trans_vel": 1, "max_trans_acc": 2.25, "max_trans_dec": -4, "max_rot_vel": True})
    assert limits == CartesianLimits(1.0, 2.25, 4.0, 1.57)
    assert len(complaints) == 1 and "max_rot_vel is True" in complaints[0]
