// SPDX-License-Identifier: BSD-3-Clause
// The pre-pose client as the notes describe it, step by step.
#include <actionlib/client/simple_action_client.h>
#include <baxter_traj_streamer/baxter_traj_streamer.h>
#include <baxter_traj_streamer/trajAction.h>

void doneCb(const actionlib::SimpleClientGoalState &state, const baxter_traj_streamer::trajResultConstPtr &result) {
    ROS_INFO("done: %s, return_val %d, traj_id %d", state.toString().c_str(), result->return_val, result->traj_id);
}

int main(int argc, char **argv) {
    ros::init(argc, argv, "traj_action_client_node");
    ros::NodeHandle nh;
    Baxter_traj_streamer baxter_traj_streamer(&nh);

    Vectorq7x1 q_pre_pose;
    q_pre_pose << -0.907528, -0.111813, 2.06622, 1.8737, -1.295, 2.00164, -2.87179;

    std::vector<Eigen::VectorXd> des_path;
    Eigen::VectorXd q_in_vecxd;
    Vectorq7x1 q_vec_right_arm = baxter_traj_streamer.get_qvec_right_arm();
    q_in_vecxd = q_vec_right_arm;
    des_path.push_back(q_in_vecxd);
    q_in_vecxd = q_pre_pose;
    des_path.push_back(q_in_vecxd);

    trajectory_msgs::JointTrajectory des_trajectory;
    baxter_traj_streamer.stuff_trajectory(des_path, des_trajectory);

    baxter_traj_streamer::trajGoal goal;
    goal.trajectory = des_trajectory;
    goal.traj_id = 1;

    actionlib::SimpleActionClient<baxter_traj_streamer::trajAction> action_client("trajActionServer", true);
    if (!action_client.waitForServer(ros::Duration(5.0))) {
        ROS_WARN("could not connect to the server");
        return 1;
    }
    action_client.sendGoal(goal, &doneCb);
    if (!action_client.waitForResult(ros::Duration(5.0))) ROS_WARN("giving up waiting on the result");
    return 0;
}
