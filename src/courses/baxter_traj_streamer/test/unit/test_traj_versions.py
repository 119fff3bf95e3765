# SPDX-License-Identifier: BSD-3-Clause
import pytest
from trajectory_msgs.msg import JointTrajectory

from baxter_traj_streamer import versions

# Of action, action goal, action result and action feedback, as Case Western's own packages have them.
SUMS = {
    "baxter_traj_streamer/traj": ("b0d15a5cdd55880dcc8a737c848768dc", "39105c9ddfcdfce0b589fb95b4dc0284",
                                  "4d6c3be4f6f04d8a1647f168a75b1ed5", "5a6929cb3514eabf286ff2717ef7a5a4"),
    "cwru_action/traj": ("232da7c9699332b585768d22defba609", "a99e83ef6185f9fdd7693efe99623a86",
                         "81348f802f6e037d8f23b2bf2a225aff", "5a6929cb3514eabf286ff2717ef7a5a4"),
}


@pytest.mark.parametrize("name", SUMS)
def test_messages_are_those_of_the_original(name):
    version = versions.version(name)
    parts = version.action()
    assert tuple(part._md5sum for part in (
        parts, parts.action_goal, parts.action_result, parts.action_feedback)) == SUMS[name]
    assert parts._type == name + "Action"
    assert versions.of_goal(version.md5sum) is version


def test_the_id_comes_back_where_there_is_one():
    notes, current = (versions.version(name) for name in SUMS)
    path = JointTrajectory(joint_names=["right_s0"])
    assert notes.make_result(3, notes.make_goal(path, 42)).traj_id == 42
    goal = current.make_goal(path, 42)
    assert goal.trajectory.joint_names == ["right_s0"]
    result = current.make_result(3, goal)
    assert result.return_val == 3
    assert not hasattr(result, "traj_id")


def test_other_versions_are_refused():
    with pytest.raises(ValueError, match="'my_action/traj' is not known; choices are baxter_traj_streamer/traj, cwru"):
        versions.version("my_action/traj")
    assert versions.of_goal("0" * 32) is None
