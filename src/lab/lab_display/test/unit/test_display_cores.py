# SPDX-License-Identifier: BSD-3-Clause
"""Trees, plots, matrices, and the camera outside of the robot: their content and places."""
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from lab_display import joint_plot, outside
from lab_display.command import picture_path
from lab_display.matrices import FrameMatrix, angle_and_axis
from lab_display.picture import Picture
from lab_display.trees import FrameTree, TreeError
from sensor_renderer.pinhole import Pinhole
from sensor_renderer.viewpoint import looking_at
from urdf_model import parse_urdf
from urdf_model.transforms import axis_rotation, pose_matrix

ARM = """<robot name="arm"><link name="foot"/><link name="upper"/><link name="tool"/><link name="lamp"/>
<joint name="turn" type="revolute"><parent link="foot"/><child link="upper"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" velocity="1" effort="1"/></joint>
<joint name="j2" type="fixed"><parent link="upper"/><child link="tool"/></joint>
<joint name="j3" type="fixed"><parent link="foot"/><child link="lamp"/></joint></robot>"""
ROS = ("rospy", "tf2_ros", "sensor_msgs", "cv_bridge", "baxter_interface")


def test_cores_load_without_ros():
    block = "import sys; sys.modules.update(dict.fromkeys(%r)); " % (ROS,)
    program = block + "from lab_display import joint_plot, matrices, outside, picture, trees"
    subprocess.run([sys.executable, "-c", program], check=True)


def test_tree_of_a_urdf_as_text():
    assert str(FrameTree.of_urdf(parse_urdf(ARM))) == "foot\n  [turn] upper\n    tool\n  lamp"


def test_tree_from_a_frame_down_and_an_unknown_one():
    tree = FrameTree.of_urdf(parse_urdf(ARM))
    assert str(tree.below("upper")) == "upper\n  tool"
    with pytest.raises(TreeError, match="no frame 'leg'; there are: foot, lamp, tool, upper"):
        tree.below("leg")


def test_frames_in_a_ring_are_named():
    with pytest.raises(TreeError, match="a, b"):
        FrameTree({"a": ("b", "", False), "b": ("a", "", False), "d": ("c", "", False)}).draw()


def test_picture_of_a_tree_has_moving_frames_in_red():
    pixels = FrameTree.of_urdf(parse_urdf(ARM)).draw().array().astype(int)
    assert (pixels[:, :, 0] > pixels[:, :, 1] + 80).sum() > 50
    still = FrameTree({"b": ("a", "", False)}).draw().array().astype(int)
    # The title alone has no colour.
    assert (still[:, :, 0] > still[:, :, 1] + 80).sum() == 0


def test_arms_are_plotted_in_a_panel_each_from_time_zero():
    line = np.array([[5.0, 6.0, 7.0], [0.0, 1.0, 0.5]])
    figure = joint_plot.figure_of({"right_s0": line, "left_s0": line, "left_s1": line + 1.0, "head_pan": line})
    panels = [[curve.get_label() for curve in axes.get_lines()] for axes in figure.axes]
    assert panels == [["left_s0", "left_s1"], ["right_s0"], ["head_pan"]]
    np.testing.assert_allclose(figure.axes[0].get_lines()[0].get_xdata(), [0.0, 1.0, 2.0])
    with pytest.raises(joint_plot.NothingRecorded, match="nothing was recorded"):
        joint_plot.draw({"left_s0": np.empty((2, 0))})


def test_a_joint_has_one_colour_in_whatever_order_and_company_it_is_plotted():
    line = np.array([[5.0, 6.0], [0.0, 1.0]])
    colours = {}
    plots = (("left_s0", "left_s1", "left_e0"), ("left_e0", "left_s0"), ("other", "left_s1", "left_w2", "another"))
    for names in plots:
        for axes in joint_plot.figure_of(dict.fromkeys(names, line)).axes:
            of_panel = {curve.get_label(): curve.get_color() for curve in axes.get_lines()}
            assert len(set(of_panel.values())) == len(of_panel)
            for name, colour in of_panel.items():
                assert colours.setdefault(name, colour) == colour or "other" in name


def test_fingers_have_their_own_panel_in_metres():
    line = np.array([[5.0, 6.0], [0.0, 0.02]])
    figure = joint_plot.figure_of({"left_s0": line, "left_finger": line}, {"left_s0": "rad", "left_finger": "m"})
    assert [(axes.get_ylabel(), [curve.get_label() for curve in axes.get_lines()]) for axes in figure.axes] == [
        ("rad", ["left_s0"]), ("m", ["left_finger"])]


def test_a_picture_without_a_name_does_not_lie_among_the_workspaces_files(tmp_path):
    assert picture_path("tf", tmp_path, str(tmp_path)) == tmp_path / ".baxter/pictures/tf.png"
    assert picture_path("tf", tmp_path, "") == Path("tf.png")
    (tmp_path / "mine").mkdir()
    assert picture_path("tf", tmp_path / "mine", str(tmp_path)) == Path("tf.png")


@pytest.mark.parametrize("axis", [(1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.6, 0.0, 0.8)])
@pytest.mark.parametrize("angle", [0.3, 1.5, 3.0])
def test_angle_and_axis_of_a_turn(axis, angle):
    found, direction = angle_and_axis(axis_rotation(np.array(axis), angle))
    assert found == pytest.approx(angle, abs=1e-9)
    np.testing.assert_allclose(direction, axis, atol=1e-9)


def test_half_a_turn_has_an_axis_and_no_turn_has_none():
    angle, axis = angle_and_axis(axis_rotation(np.array([0.0, 1.0, 0.0]), np.pi))
    assert angle == pytest.approx(np.pi)
    np.testing.assert_allclose(axis, (0.0, 1.0, 0.0), atol=1e-9)
    assert angle_and_axis(np.eye(3)) == (0.0, None)


def test_matrix_is_printed_with_names_numbers_and_words():
    matrix = FrameMatrix("base", "head", pose_matrix((0.06, -1e-9, 0.686), (0.0, 0.0, np.pi / 2)))
    text = repr(matrix)
    assert text.startswith("head in base:") and "-0.0000" not in text
    assert "x 0.0600, y 0.0000, z 0.6860 m, turned by 90.0 degrees about (0.000, 0.000, 1.000)" in text
    np.testing.assert_allclose(np.array(matrix), matrix.matrix)


def test_axes_of_a_frame_are_drawn_where_the_frame_is():
    pinhole = Pinhole.from_field_of_view(200, 100, 0.8, 0.05, 100.0)
    view = np.linalg.inv(looking_at((2.0, 0.0, 0.0), (0.0, 0.0, 0.0)))
    pixels = np.zeros((100, 200, 3), np.uint8)
    outside.draw_frame(pixels, pinhole, view, np.eye(4), 0.2)
    blue, green = pixels[40, 99:102].astype(int), pixels[49:52, 108].astype(int)
    # Seen against x: y is to the right, z is up.
    assert (blue[:, 2] - blue[:, 0]).max() > 100 and (green[:, 1] - green[:, 0]).max() > 80
    behind = np.zeros_like(pixels)
    outside.draw_frame(behind, pinhole, view, pose_matrix((3.0, 0.0, 0.0)), 0.2)
    assert not behind.any()


def test_picture_keeps_its_colours_and_its_size(tmp_path):
    pixels = np.zeros((20, 30, 3), np.uint8)
    pixels[:, :10] = (255, 10, 20)
    picture = Picture.of_array(pixels)
    np.testing.assert_array_equal(picture.array(), pixels)
    assert repr(picture) == "picture of 30 x 20 pixels" and picture._repr_png_().startswith(b"\x89PNG")
    picture.save(tmp_path / "p.png")
    assert (tmp_path / "p.png").read_bytes() == picture.png
