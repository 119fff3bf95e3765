# SPDX-License-Identifier: BSD-3-Clause
"""Straight lines of a link: where the points are, how far they get, and why they end."""
import numpy as np
import pytest

from motion_planning.cartesian import CartesianError, Line, Steps, cartesian_path
from urdf_model.transforms import axis_rotation, rigid, rotation_angle

READY = {"joint_1": 0.0, "joint_2": 0.0, "joint_3": 0.0, "joint_4": 0.0, "joint_5": 0.6, "joint_6": 0.0}
NEUTRAL = {"s0": 0.0, "s1": -0.55, "e0": 0.0, "e1": 0.75, "w0": 0.0, "w1": 1.26, "w2": 0.0}


class Robot:
    """One of the lab's arms at a posture from which lines go in all directions."""

    def __init__(self, model, group, link, values):
        self.model, self.group, self.link = model, group, link
        self.start = model.state(values)
        self.indices = model.groups[group].indices

    def pose(self, q=None):
        whole = self.start.q if q is None else self.start.with_q(q, self.indices).q
        return self.model.frame_of(whole, self.link, self.start.base)

    def moved(self, x=0.0, y=0.0, z=0.0, turn=None):
        """The link's pose, moved in the planning frame and turned about an axis of its own."""
        pose = self.pose().copy()
        pose[:3, 3] += x, y, z
        if turn is not None:
            pose[:3, :3] = pose[:3, :3] @ turn
        return pose

    def path(self, waypoints, max_step=0.01, jump_threshold=0.0, **options):
        return cartesian_path(self.model, self.group, self.start, self.link, waypoints,
                              Steps(max_step, jump_threshold, **options))


@pytest.fixture(params=["probot", "left", "right"])
def robot(request):
    if request.param == "probot":
        return Robot(request.getfixturevalue("probot"), "manipulator", "tool0", READY)
    values = {"%s_%s" % (request.param, joint): value for joint, value in NEUTRAL.items()}
    return Robot(request.getfixturevalue("baxter"), request.param + "_arm", request.param + "_gripper", values)


def test_points_lie_on_the_lines(robot):
    waypoints = [robot.moved(z=-0.05), robot.moved(z=-0.05, x=-0.06), robot.moved(x=-0.06, turn=axis_rotation(
        (0.0, 0.0, 1.0), 0.4))]
    path = robot.path(waypoints)
    assert path.reason is None and path.fraction == 1.0
    assert np.allclose(path.joints[0], robot.start.q[robot.indices])
    assert np.abs(robot.pose(path.joints[-1]) - waypoints[-1]).max() < 1e-4
    ends = np.array([robot.pose()[:3, 3]] + [waypoint[:3, 3] for waypoint in waypoints])
    before = robot.pose()[:3, 3]
    for a, b in zip(path.joints, path.joints[1:], strict=False):
        assert np.linalg.norm(robot.pose(b)[:3, 3] - before) < 0.0101
        before = robot.pose(b)[:3, 3]
        for share in (0.25, 0.5, 0.75):
            assert off_lines(robot.pose(a + share * (b - a))[:3, 3], ends) < 1.2e-3


def off_lines(point, ends):
    distances = []
    for a, b in zip(ends, ends[1:], strict=False):
        along = np.clip((point - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
        distances.append(np.linalg.norm(point - a - along * (b - a)))
    return min(distances)


def test_coarse_steps_are_halved_until_the_line_is_kept(robot):
    coarse = robot.path([robot.moved(z=-0.08)], max_step=1.0)
    assert coarse.fraction == 1.0 and len(coarse.joints) > 2
    ends = np.array([robot.pose()[:3, 3], robot.moved(z=-0.08)[:3, 3]])
    for a, b in zip(coarse.joints, coarse.joints[1:], strict=False):
        assert off_lines(robot.pose(0.5 * (a + b))[:3, 3], ends) < 1.2e-3


def test_turning_in_place_is_a_path(robot):
    goal = robot.moved(turn=axis_rotation((0.0, 0.0, 1.0), 1.0))
    path = robot.path([goal], max_step=0.01)
    assert path.fraction == 1.0 and len(path.joints) >= 1.0 / 0.035
    assert rotation_angle(goal[:3, :3].T @ robot.pose(path.joints[-1])[:3, :3]) < 1e-4


def test_out_of_reach_ends_with_the_reason(robot):
    path = robot.path([robot.moved(z=-0.02), robot.moved(z=3.0)])
    assert 0.5 <= path.fraction < 0.9
    assert "on the way to waypoint 2 of 2" in path.reason
    assert "arm" in path.reason or "limit" in path.reason or "reached" in path.reason
    assert len(path.joints) >= 3


def test_what_is_not_accepted_ends_with_its_sentence(robot):
    height = robot.pose()[2, 3]

    def accept(q):
        return "'gripper' touches 'table'" if robot.pose(q)[2, 3] < height - 0.031 else None

    path = robot.path([robot.moved(z=-0.06)], accept=accept)
    assert 0.4 < path.fraction < 0.51
    assert path.reason.startswith("'gripper' touches 'table', on the way to waypoint 1 of 1, after 50 %")
    assert robot.pose(path.joints[-1])[2, 3] >= height - 0.0311


def test_stop_ends_it(robot):
    asked = []
    path = robot.path([robot.moved(z=-0.06)], stop=lambda: asked.append(1) or len(asked) > 3)
    assert path.fraction == 0.5 and path.reason.startswith("stopped")


def test_jumps_are_seen(robot):
    """A turn on one spot makes steps that are many times those of a tiny motion before."""
    waypoints = [robot.moved(z=-0.0002 * i) for i in range(1, 21)] + [robot.moved(z=-0.004, turn=axis_rotation(
        (0.0, 0.0, 1.0), 0.3))]
    assert robot.path(waypoints, max_step=0.1).fraction == 1.0
    cut = robot.path(waypoints, max_step=0.1, jump_threshold=3.0)
    assert cut.fraction < 1.0 and "above the jump threshold 3" in cut.reason


def test_no_waypoints_are_no_way(robot):
    path = robot.path([])
    assert path.fraction == 1.0 and len(path.joints) == 1


@pytest.mark.parametrize("options, sentence", [
    ({"max_step": 0.0}, "must be above 0"),
    ({"max_step": float("nan")}, "must be above 0"),
    ({"max_step": 1e-9}, "make the steps larger"),
    ({"jump_threshold": -1.0}, "0 or more"),
])
def test_bad_numbers_are_refused(robot, options, sentence):
    with pytest.raises(CartesianError, match=sentence):
        robot.path([robot.moved(z=-0.05)], **options)


def test_bad_waypoints_and_links_are_refused(robot):
    with pytest.raises(CartesianError, match="waypoint 2 is not a pose"):
        robot.path([robot.moved(z=-0.05), np.full((4, 4), np.nan)])
    robot.link = robot.model.root
    with pytest.raises(CartesianError, match="moves link"):
        robot.path([np.eye(4)])
    robot.link = "nose"
    with pytest.raises(CartesianError, match="no link 'nose'"):
        robot.path([np.eye(4)])


def test_half_turns_have_an_axis(robot):
    """About each axis; a line of poses is one turn about it, in one of the two directions."""
    for axis in np.concatenate([np.eye(3), np.random.default_rng(5).normal(size=(20, 3))]):
        axis = axis / np.linalg.norm(axis)
        for angle in (np.pi, np.pi - 1e-5, np.pi - 5e-4, 3.0, 1e-7):
            end = rigid(axis_rotation(axis, angle), (0.0, 0.0, 0.0))
            line = Line(np.eye(4), end)
            assert np.abs(line.at(1.0) - end).max() < 1e-6
            assert abs(rotation_angle(line.at(0.5)[:3, :3]) - 0.5 * angle) < 1e-6


def test_a_link_inside_the_arm_may_be_led(baxter):
    robot = Robot(baxter, "both_arms", "left_gripper", {"left_" + k: v for k, v in NEUTRAL.items()})
    path = robot.path([robot.moved(z=-0.05)])
    assert path.fraction == 1.0
    left = [baxter.groups["both_arms"].joints.index(joint) for joint in baxter.groups["left_arm"].joints]
    still = np.delete(path.joints, left, axis=1)
    assert (still == still[0]).all() and np.ptp(path.joints[:, left], axis=0).max() > 0.01
