// SPDX-License-Identifier: BSD-3-Clause
// Sends and receives messages. Python computes the trajectories: docs/decisions/0005-cpp-client-library.md.
#include "baxter_traj_streamer/baxter_traj_streamer.h"

#include <functional>
#include <stdexcept>

#include <baxter_core_msgs/JointCommand.h>
#include <baxter_traj_streamer/TimePath.h>

namespace {
const char *const JOINTS[] = {"s0", "s1", "e0", "e1", "w0", "w1", "w2"};
const char *const SIDES[] = {"right", "left"};
const char *const TIME_PATH = "/baxter_traj_streamer/time_path";
const double REMINDER_S = 5.0;
const double POLL_S = 0.01;

std::vector<std::string> joint_names(const std::string &side) {
    std::vector<std::string> names;
    for (const char *joint : JOINTS) names.push_back(side + "_" + joint);
    return names;
}

std::vector<double> to_list(const Eigen::VectorXd &qvec) {
    return std::vector<double>(qvec.data(), qvec.data() + qvec.size());
}

// In wall time: the clock of a simulation may not run yet.
void wait_until(const std::function<bool()> &condition, const std::string &what) {
    ros::WallTime due = ros::WallTime::now() + ros::WallDuration(REMINDER_S);
    while (!condition()) {
        if (!ros::ok()) throw std::runtime_error("shut down while waiting for " + what);
        if (ros::WallTime::now() >= due) {
            ROS_WARN_STREAM("waiting for " << what);
            due += ros::WallDuration(REMINDER_S);
        }
        ros::WallDuration(POLL_S).sleep();
    }
}
}  // namespace

Baxter_traj_streamer::Baxter_traj_streamer(ros::NodeHandle *nodehandle) : nh_(*nodehandle), spinner_(1, &queue_) {
    for (const std::string side : SIDES) {
        commands_[side] = nh_.advertise<baxter_core_msgs::JointCommand>("/robot/limb/" + side + "/joint_command", 1);
        paths_[side] = nh_.advertise<trajectory_msgs::JointTrajectory>(side + "_arm_joint_path_command", 1);
    }
    time_path_ = nh_.serviceClient<baxter_traj_streamer::TimePath>(TIME_PATH);
    ros::SubscribeOptions options = ros::SubscribeOptions::create<sensor_msgs::JointState>(
        "/robot/joint_states", 1,
        [this](const sensor_msgs::JointState::ConstPtr &message) { on_joint_states(message); }, ros::VoidPtr(), &queue_);
    joint_states_ = nh_.subscribe(options);
    spinner_.start();
}

Baxter_traj_streamer::~Baxter_traj_streamer() {
    // Callbacks must not use destroyed members.
    joint_states_.shutdown();
    spinner_.stop();
}

void Baxter_traj_streamer::on_joint_states(const sensor_msgs::JointState::ConstPtr &message) {
    std::lock_guard<std::mutex> lock(mutex_);
    for (size_t i = 0; i < message->name.size() && i < message->position.size(); ++i)
        angles_[message->name[i]] = message->position[i];
}

Vectorq7x1 Baxter_traj_streamer::get_qvec(const std::string &side) {
    const std::vector<std::string> names = joint_names(side);
    Vectorq7x1 qvec;
    wait_until([&] {
        std::lock_guard<std::mutex> lock(mutex_);
        for (size_t i = 0; i < names.size(); ++i) {
            const auto found = angles_.find(names[i]);
            if (found == angles_.end()) return false;
            qvec[i] = found->second;
        }
        return true;
    }, "/robot/joint_states of the " + side + " arm; is the robot or the simulator running?");
    return qvec;
}

void Baxter_traj_streamer::stuff(const std::string &side, const std::vector<Eigen::VectorXd> &qvecs,
                                 trajectory_msgs::JointTrajectory &new_trajectory,
                                 std::vector<double> *transition_times) {
    baxter_traj_streamer::TimePath call;
    call.request.path.joint_names = joint_names(side);
    for (const Eigen::VectorXd &qvec : qvecs) {
        call.request.path.points.emplace_back();
        call.request.path.points.back().positions = to_list(qvec);
    }
    wait_until([&] { return time_path_.exists(); },
               std::string(TIME_PATH) + ": rosrun baxter_traj_streamer traj_interpolator_as");
    if (!time_path_.call(call)) throw std::runtime_error(std::string(TIME_PATH) + " refused the path; its line above says why");
    new_trajectory = call.response.trajectory;
    if (transition_times) *transition_times = call.response.transition_times;
}

double Baxter_traj_streamer::transition_time(Eigen::VectorXd dqvec) {
    trajectory_msgs::JointTrajectory trajectory;
    std::vector<double> times;
    stuff(SIDES[0], {Eigen::VectorXd::Zero(dqvec.size()), dqvec}, trajectory, &times);
    return times.at(0);
}

double Baxter_traj_streamer::transition_time(Vectorq7x1 dqvec) { return transition_time(Eigen::VectorXd(dqvec)); }

void Baxter_traj_streamer::stuff_trajectory(std::vector<Vectorq7x1> qvecs,
                                            trajectory_msgs::JointTrajectory &new_trajectory) {
    stuff(SIDES[0], std::vector<Eigen::VectorXd>(qvecs.begin(), qvecs.end()), new_trajectory);
}

void Baxter_traj_streamer::stuff_trajectory(std::vector<Eigen::VectorXd> qvecs,
                                            trajectory_msgs::JointTrajectory &new_trajectory) {
    stuff(SIDES[0], qvecs, new_trajectory);
}

void Baxter_traj_streamer::stuff_trajectory_right_arm(std::vector<Eigen::VectorXd> qvecs,
                                                      trajectory_msgs::JointTrajectory &new_trajectory) {
    stuff("right", qvecs, new_trajectory);
}

void Baxter_traj_streamer::stuff_trajectory_left_arm(std::vector<Eigen::VectorXd> qvecs,
                                                     trajectory_msgs::JointTrajectory &new_trajectory) {
    stuff("left", qvecs, new_trajectory);
}

void Baxter_traj_streamer::cmd_pose(const std::string &side, const Vectorq7x1 &qvec) {
    baxter_core_msgs::JointCommand command;
    command.mode = baxter_core_msgs::JointCommand::POSITION_MODE;
    command.names = joint_names(side);
    command.command = to_list(qvec);
    // Messages without a subscriber are lost, and a latched command would move the next robot that starts.
    wait_until([&] { return commands_[side].getNumSubscribers() > 0; }, "the robot to listen to " + commands_[side].getTopic());
    commands_[side].publish(command);
}

Vectorq7x1 Baxter_traj_streamer::get_qvec_right_arm() { return get_qvec("right"); }
Vectorq7x1 Baxter_traj_streamer::get_qvec_left_arm() { return get_qvec("left"); }
void Baxter_traj_streamer::cmd_pose_right(Vectorq7x1 qvec) { cmd_pose("right", qvec); }
void Baxter_traj_streamer::cmd_pose_left(Vectorq7x1 qvec) { cmd_pose("left", qvec); }

void Baxter_traj_streamer::pub_right_arm_trajectory(trajectory_msgs::JointTrajectory &new_trajectory) {
    paths_["right"].publish(new_trajectory);
}

void Baxter_traj_streamer::pub_left_arm_trajectory(trajectory_msgs::JointTrajectory &new_trajectory) {
    paths_["left"].publish(new_trajectory);
}
