# SPDX-License-Identifier: BSD-3-Clause
# Our replacements for packages that Debian's ROS lacks. Sourced by set-up.

STAND_INS=(
    src/simulator/gazebo_msgs
    src/ros_control/control_msgs
    src/ros_control/controller_manager_msgs
    src/ros_control/four_wheel_steering_msgs
    src/planning/moveit_msgs
    src/planning/object_recognition_msgs
    src/planning/octomap_msgs
    src/web/foxglove_bridge
    src/web/interactive_marker_proxy
    src/web/rosapi
    src/web/rosbridge_msgs
    src/web/rosbridge_server
    src/web/tf2_web_republisher
    src/web/web_video_server
    src/base/xacro
    src/compat/rqt_plot
    src/compat/joy
    src/compat/joint_state_controller
    src/compat/imu_sensor_controller
    src/compat/force_torque_sensor_controller
    src/compat/media_export
    src/compat/moveit_ros_planning_interface
)

# leave_out_stand_ins ROOT SHARE…: where an installed ROS (its share folders) has a package of that name, hide ours from
# catkin and rospack by a file CATKIN_IGNORE; take the file away where it has none.
leave_out_stand_ins() {
    local root=$1 folder share installed
    shift
    for folder in "${STAND_INS[@]}"; do
        [[ -d $root/$folder ]] || continue
        installed=""
        for share in "$@"; do
            if [[ -f $share/${folder##*/}/package.xml ]]; then installed=$share; fi
        done
        if [[ -n $installed ]]; then
            echo "made by set-up: $installed has this package" >"$root/$folder/CATKIN_IGNORE"
        else
            rm -f "$root/$folder/CATKIN_IGNORE"
        fi
    done
}
