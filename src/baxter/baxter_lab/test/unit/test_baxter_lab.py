# SPDX-License-Identifier: BSD-3-Clause
"""The library's front door. docs/python.md, which picks up a block, is tested with the pages."""
import subprocess
import zipfile

import numpy as np
import pytest

from baxter_lab import BaxterState, CommandRefused, Lab, LabError, Mode, NoSolution, NotReached, Options, meshes, pose
from baxter_lab.descriptions import baxter_srdf


@pytest.fixture(scope="module")
def lab():
    with Lab(Options(with_meshes=False), warn=pytest.fail) as made:
        yield made


def test_a_disabled_robot_refuses_and_an_enabled_one_moves(lab):
    arm = lab.robot.left
    lab.robot.disable()  # another test may have enabled it
    with pytest.raises(CommandRefused):
        arm.move(arm.angles)
    lab.robot.enable()
    assert lab.robot.state is BaxterState.ENABLED
    for side in ("left", "right"):
        arm = lab.robot.arms[side]
        goal = arm.pose
        goal[2, 3] += 0.05
        arm.move(goal)
        np.testing.assert_allclose(arm.pose, goal, atol=0.02)


def test_a_place_out_of_reach_has_a_reason(lab):
    with pytest.raises(NoSolution, match="reach"):
        lab.robot.left.ik(pose((3.0, 0.0, 0.0)))
    with pytest.raises(LabError, match="goal"):
        lab.robot.left.move([0.1, 0.2])


def test_the_hands_camera_sees_what_is_under_the_hand(lab):
    arm, ahead = lab.robot.left, np.array((0.0, 0.0, 1.0))
    lab.robot.put({"left": arm.ik(pose((0.7, 0.3, 0.2)), np.zeros(7))})
    lab.add_box("carpet", (0.4, 0.4, 0.02), (0.7, 0.3, -0.4), colour=(0.0, 0.0, 1.0, 1.0))
    taken = lab.cameras.take("left_hand", 64, 64, depth=True)
    lab.remove("carpet")
    assert taken.camera[2, :3] @ ahead < -0.9  # it looks down
    red, _, blue = np.moveaxis(taken.pixels.astype(float), 2, 0)
    assert (blue > 1.5 * red + 20.0).mean() > 0.05  # the carpet
    with pytest.raises(LabError, match="right_hand"):
        lab.cameras.take("third_hand")


def test_streamed_commands_expire_and_waiting_ends(lab):
    lab.robot.enable()
    lab.robot.left.command(Mode.VELOCITY, [0.2] * 7)
    with pytest.raises(NotReached, match="the moon"):
        lab.wait(lambda: False, 0.5, "the moon")
    assert np.abs(lab.robot.left.velocities).max() < 0.02


def test_a_state_comes_again_to_the_bit(lab):
    lab.robot.enable()
    block = lab.add_box("block", (0.05, 0.05, 0.05), (0.8, 0.0, 0.0), mass_kg=0.1)
    lab.run(0.02)

    def played():
        lab.robot.left.command(Mode.RAW_POSITION, lab.robot.left.angles + 0.05)
        lab.robot.right.gripper.command("grip")
        lab.robot.head.turn(0.3)
        found = []
        for _ in range(60):
            lab.step()
            found.append(np.concatenate([*lab.robot.simulated.model.read_joints(), block.pose.ravel(), [lab.time_s]]))
        return found

    state = lab.save()
    first = played()
    lab.run(0.1)
    lab.restore(state)
    np.testing.assert_array_equal(first, played())
    lab.remove("block")
    with pytest.raises(LabError, match="removed"):
        lab.restore(state)


def test_each_kind_of_gripper_has_its_descriptions():
    for kind in ("electric", "suction", "none"):
        options = Options(left_gripper=kind)
        assert ("l_gripper_l_finger" in baxter_srdf(options.arguments())) == (kind == "electric")


def test_without_a_network_the_text_says_how_to_bring_the_meshes(tmp_path, monkeypatch):
    monkeypatch.setattr(subprocess, "run", lambda command, **_: subprocess.CompletedProcess(command, 1))
    said = []
    with pytest.raises(meshes.MeshesMissing, match=meshes.VERSION):
        meshes.fetch(tmp_path / "cache" / "meshes", said.append)
    assert meshes.VERSION in said[0]


def test_a_wheel_is_unpacked_whole_or_not_at_all(tmp_path):
    wheel, folder = tmp_path / "data.whl", tmp_path / "cache" / "meshes"
    with zipfile.ZipFile(wheel, "w") as archive:
        archive.writestr(meshes._INSIDE + "torso/base_link.DAE", "one")
    with pytest.raises(meshes.MeshesMissing, match="data.whl"):
        meshes.unpack(wheel, folder)
    assert not folder.exists()
    with zipfile.ZipFile(wheel, "a") as archive:
        archive.writestr(meshes._INSIDE + "electric_gripper/hand.DAE", "two")
    meshes.unpack(wheel, folder)
    found = meshes.MeshFinder(folder)("package://rethink_ee_description/meshes/electric_gripper/hand.DAE")
    assert found == str(folder / "electric_gripper" / "hand.DAE")
    wheel.write_text("torn")
    with pytest.raises(meshes.MeshesMissing, match="data.whl"):
        meshes.unpack(wheel, folder)
    assert (folder / "torso").is_dir()  # what was there stays
