// SPDX-License-Identifier: BSD-3-Clause
// The library of Case Western's notes on Baxter for C++: poses of the arms, paths turned into trajectories.
//
// Vectors of seven go from torso to tool flange [rad]. Arrival times come from traj_interpolator_as, where the limits
// and the rule are: calls that need them wait for it, and say so. Everything throws std::runtime_error when ROS shuts
// down while it waits, or when an argument cannot be used.
#ifndef BAXTER_TRAJ_STREAMER_BAXTER_TRAJ_STREAMER_H
#define BAXTER_TRAJ_STREAMER_BAXTER_TRAJ_STREAMER_H

#include <map>
#include <mutex>
#include <string>
#include <vector>

#include <Eigen/Dense>
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <sensor_msgs/JointState.h>
#include <trajectory_msgs/JointTrajectory.h>

typedef Eigen::Matrix<double, 7, 1> Vectorq7x1;

class Baxter_traj_streamer {
public:
    // Works from the first call on, whether the caller spins or not.
    explicit Baxter_traj_streamer(ros::NodeHandle *nodehandle);
    ~Baxter_traj_streamer();

    // Measured angles, as last reported; waits for the first report.
    Vectorq7x1 get_qvec_right_arm();
    Vectorq7x1 get_qvec_left_arm();

    // Shortest time [s] for a move of the seven joints by dqvec.
    double transition_time(Eigen::VectorXd dqvec);
    double transition_time(Vectorq7x1 dqvec);

    // Fills new_trajectory with the path and its arrival times; the first pose is due at 0 s.
    void stuff_trajectory(std::vector<Vectorq7x1> qvecs, trajectory_msgs::JointTrajectory &new_trajectory);
    void stuff_trajectory(std::vector<Eigen::VectorXd> qvecs, trajectory_msgs::JointTrajectory &new_trajectory);
    void stuff_trajectory_right_arm(std::vector<Eigen::VectorXd> qvecs, trajectory_msgs::JointTrajectory &new_trajectory);
    void stuff_trajectory_left_arm(std::vector<Eigen::VectorXd> qvecs, trajectory_msgs::JointTrajectory &new_trajectory);

    // Commands a pose once, in position mode.
    void cmd_pose_right(Vectorq7x1 qvec);
    void cmd_pose_left(Vectorq7x1 qvec);

    // Publishes on <side>_arm_joint_path_command; goals of trajActionServer are the better way.
    void pub_right_arm_trajectory(trajectory_msgs::JointTrajectory &new_trajectory);
    void pub_left_arm_trajectory(trajectory_msgs::JointTrajectory &new_trajectory);

private:
    void on_joint_states(const sensor_msgs::JointState::ConstPtr &message);
    Vectorq7x1 get_qvec(const std::string &side);
    void stuff(const std::string &side, const std::vector<Eigen::VectorXd> &qvecs,
               trajectory_msgs::JointTrajectory &new_trajectory, std::vector<double> *transition_times = nullptr);
    void cmd_pose(const std::string &side, const Vectorq7x1 &qvec);

    ros::NodeHandle nh_;
    ros::CallbackQueue queue_;  // own queue, so that the caller need not spin
    std::mutex mutex_;
    std::map<std::string, double> angles_;
    ros::AsyncSpinner spinner_;
    ros::Subscriber joint_states_;
    ros::ServiceClient time_path_;
    std::map<std::string, ros::Publisher> commands_, paths_;
};

#endif
