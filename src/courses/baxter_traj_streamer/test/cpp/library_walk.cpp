// SPDX-License-Identifier: BSD-3-Clause
// Calls every member function once and prints its result, for comparison with the Python library.
#include <cstdio>

#include <baxter_traj_streamer/baxter_traj_streamer.h>

void print(const char *what, const Eigen::VectorXd &values) {
    std::printf("%s", what);
    for (int i = 0; i < values.size(); ++i) std::printf(" %.9f", values[i]);
    std::printf("\n");
}

void print(const char *what, const trajectory_msgs::JointTrajectory &trajectory) {
    std::printf("%s %s", what, trajectory.joint_names.at(0).c_str());
    for (const auto &point : trajectory.points) std::printf(" %.9f", point.time_from_start.toSec());
    std::printf("\n");
}

int main(int argc, char **argv) {
    ros::init(argc, argv, "library_walk");
    ros::NodeHandle nh;
    Baxter_traj_streamer streamer(&nh);
    const Vectorq7x1 right = streamer.get_qvec_right_arm(), left = streamer.get_qvec_left_arm();
    print("right", right);
    print("left", left);

    Vectorq7x1 step;
    step << 0.1, -0.2, 0.3, -0.1, 0.9, 0.0, 0.2;
    const Eigen::VectorXd long_step = 2.0 * step;
    std::printf("time %.9f %.9f\n", streamer.transition_time(step), streamer.transition_time(long_step));

    trajectory_msgs::JointTrajectory trajectory;
    streamer.stuff_trajectory(std::vector<Vectorq7x1>{right, right + step, right + step}, trajectory);
    print("seven", trajectory);
    const std::vector<Eigen::VectorXd> path{left, left + long_step};
    streamer.stuff_trajectory(path, trajectory);
    print("any", trajectory);
    streamer.stuff_trajectory_right_arm(path, trajectory);
    print("right_arm", trajectory);
    streamer.stuff_trajectory_left_arm(path, trajectory);
    print("left_arm", trajectory);
    streamer.pub_right_arm_trajectory(trajectory);
    streamer.pub_left_arm_trajectory(trajectory);
    streamer.cmd_pose_right(right);
    Vectorq7x1 moved = left;
    moved[6] += 0.1;
    streamer.cmd_pose_left(moved);
    try {
        streamer.stuff_trajectory(std::vector<Eigen::VectorXd>{Eigen::VectorXd::Zero(3)}, trajectory);
    } catch (const std::runtime_error &error) {
        std::printf("error %s\n", error.what());
    }
    return 0;
}
