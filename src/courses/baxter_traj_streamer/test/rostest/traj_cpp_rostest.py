#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The C++ library against the Python one, and the notes' client with it."""
import pathlib
import subprocess
import tempfile

import numpy as np
import rospy
from traj_rostest_kit import FakeRobotTest, wait_until

from baxter_traj_streamer.settings import arm_joint_names

# Longest build [s]; it takes about 15.
BUILD_S = 300.0
# The step that test/cpp/library_walk.cpp takes [rad].
STEP = np.array([0.1, -0.2, 0.3, -0.1, 0.9, 0.0, 0.2])


class TrajCppTest(FakeRobotTest):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.programs = pathlib.Path(folder.name)
        source = pathlib.Path(__file__).parents[1] / "cpp"
        for command in (["cmake", "-DCATKIN_ENABLE_TESTING=0", str(source)], ["make", "-j2"]):
            done = subprocess.run(command, cwd=cls.programs, capture_output=True, text=True, timeout=BUILD_S,
                                  check=False)
            assert done.returncode == 0, done.stdout + done.stderr

    def run_program(self, name):
        done = subprocess.run([str(self.programs / name)], capture_output=True, text=True, timeout=60, check=False)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        return done.stdout

    def test_every_member_function_gives_what_the_python_library_gives(self):
        before = {side: np.array(self.streamer.get_qvec(side)) for side in ("right", "left")}
        found = {}
        for line in self.run_program("library_walk").splitlines():
            word, _, rest = line.partition(" ")
            found[word] = rest
        for side in ("right", "left"):
            np.testing.assert_allclose([float(number) for number in found[side].split()], before[side], atol=1e-3)
        times = [self.streamer.transition_time(STEP), self.streamer.transition_time(2.0 * STEP)]
        np.testing.assert_allclose([float(number) for number in found["time"].split()], times, atol=1e-8)
        path = [np.zeros(7), STEP, STEP]
        self.check_trajectory(found["seven"], "right", path)
        for word, side in (("any", "right"), ("right_arm", "right"), ("left_arm", "left")):
            self.check_trajectory(found[word], side, [np.zeros(7), 2.0 * STEP])
        self.assertIn("refused the path", found["error"])
        wait_until(lambda: abs(self.streamer.get_qvec_left_arm()[6] - before["left"][6] - 0.1) < 0.001, "w2 to follow")

    def check_trajectory(self, text, side, path):
        name, *times = text.split()
        expected = self.streamer.stuff_trajectory(path, side)
        self.assertEqual(name, expected.joint_names[0])
        np.testing.assert_allclose([float(time) for time in times],
                                   [point.time_from_start.to_sec() for point in expected.points], atol=1e-6)

    def test_notes_client_moves_the_arm_to_the_pre_pose_though_it_gives_up_before(self):
        self.run_program("pre_pose_client")
        pose = self.streamer.settings.pose("pre_pose", "right")
        wait_until(lambda: np.abs(self.angles(arm_joint_names("right")) - pose).max() < 0.01, "the pre-pose")


if __name__ == "__main__":
    import rostest

    rospy.init_node("traj_cpp_rostest")
    rostest.rosrun("baxter_traj_streamer", "traj_cpp", TrajCppTest)
