# SPDX-License-Identifier: BSD-3-Clause
"""The elements of noetic's gazebo_plugins and gazebo_ros_control, by file name, and their effect here. ROS-free."""
from __future__ import annotations

from urdf_model.element_table import ElementTable

# Read for all plugins, or of no use to any: noetic's plugins do not read alwaysOn, and rosDebugLevel is of the log. Of
# the cameras, only those that are triggered use triggerTopicName.
_ALL = "robotNamespace alwaysOn always_on rosDebugLevel"
_CAMERA = ("cameraName imageTopicName cameraInfoTopicName frameName updateRate hackBaseline distortionK1 distortionK2 "
           "distortionK3 distortionT1 distortionT2 focalLength Cx Cy CxPrime autoDistortion triggerTopicName")
_LENS = ({"borderCrop": "true"}, "the picture is distorted as a whole")
_DEPTH = _CAMERA + (" depthImageTopicName depthImageCameraInfoTopicName pointCloudTopicName pointCloudCutoff "
                    "pointCloudCutoffMax useDepth16UC1Format")
_MORE_DEPTH = ({"normalsTopicName": None, "reflectanceTopicName": None, "reduceNormals": None},
               "normals and reflectances are not published")
_OFFSET = ({"xyzOffset": "0 0 0"}, "it measures at the origin of its link")
_DRIVE = "commandTopic odometryTopic odometryFrame robotBaseFrame "
_TOLERANCES = ({"wheelSpeedTolerance": "0.01", "steeringAngleTolerance": "0.01"}, "wheels follow their targets exactly")
_FORCE_GAINS = ({"yaw_velocity_p_gain": None, "x_velocity_p_gain": None, "y_velocity_p_gain": None},
                "the model moves as commanded, whatever the gains")
_ERRORS = "offset", "drift", "driftFrequency", "gaussianNoise", "scaleError"
_ON_THE_GLOBE = ({"useWorldSphericalCoordinates": "false"}, "receivers have the reference of their plugin")
_PAUSES = {"updateOffset": "0"}, "measurements begin with the time"
_MIMIC = "joint mimicJoint multiplier offset sensitiveness maxEffort hasPID"


def _with_errors(known: str, *prefixes: str) -> str:
    """``known`` and the elements of the error model of each measurement."""
    return known + "".join(" %s%s" % (prefix, name[0].upper() + name[1:] if prefix else name)
                           for prefix in prefixes for name in _ERRORS)


#: File name -> (elements with an effect, ({name: harmless texts}, reason), ...).
PLUGINS = {
    **dict.fromkeys(("libgazebo_ros_camera.so", "libgazebo_ros_multicamera.so", "libgazebo_ros_prosilica.so",
                     "libgazebo_ros_triggered_camera.so", "libgazebo_ros_triggered_multicamera.so"), (_CAMERA, _LENS)),
    "libgazebo_ros_depth_camera.so": (_DEPTH, _LENS, _MORE_DEPTH),
    "libgazebo_ros_openni_kinect.so": (_DEPTH, _LENS),
    "libgazebo_ros_laser.so": ("topicName frameName updateRate",),
    "libgazebo_ros_gpu_laser.so": ("topicName frameName updateRate",),
    "libgazebo_ros_block_laser.so": ("topicName frameName updateRate gaussianNoise hokuyoMinIntensity",),
    "libgazebo_ros_range.so": ("topicName frameName updateRate fov radiation gaussianNoise",),
    "libgazebo_ros_imu.so": ("topicName frameName bodyName serviceName updateRate gaussianNoise rpyOffset", _OFFSET),
    "libgazebo_ros_imu_sensor.so": (
        "topicName frameName updateRateHZ updateRate gaussianNoise rpyOffset initialOrientationAsReference", _OFFSET),
    "libgazebo_ros_bumper.so": ("bumperTopicName frameName updateRate",),
    "libgazebo_ros_p3d.so": ("topicName frameName bodyName updateRate gaussianNoise xyzOffset rpyOffset rpyOffsets",),
    "libgazebo_ros_joint_state_publisher.so": ("jointName updateRate topicName",),
    "libgazebo_ros_ft_sensor.so": ("topicName jointName updateRate gaussianNoise",),
    "libgazebo_ros_f3d.so": ("topicName frameName bodyName updateRate",),
    "libgazebo_ros_force.so": ("topicName bodyName",),
    "libgazebo_ros_joint_pose_trajectory.so": ("topicName serviceName updateRate",),
    "libgazebo_ros_vacuum_gripper.so": ("topicName bodyName updateRate",),
    "libgazebo_ros_diff_drive.so": (
        _DRIVE + "updateRate leftJoint rightJoint wheelSeparation wheelDiameter wheelTorque wheelAcceleration "
        "odometrySource publishWheelJointState publishWheelTF publishOdomTF publishTf",
        ({"legacyMode": "false"}, "left and right are not exchanged, as in melodic and noetic")),
    "libgazebo_ros_skid_steer_drive.so": (
        _DRIVE + "updateRate leftFrontJoint rightFrontJoint leftRearJoint rightRearJoint wheelSeparation wheelDiameter "
        "torque broadcastTF covariance_x covariance_y covariance_yaw",),
    "libgazebo_ros_tricycle_drive.so": (
        _DRIVE + "updateRate steeringJoint actuatedWheelJoint actuatedWheelDiameter encoderWheelLeftJoint "
        "encoderWheelRightJoint encoderWheelSeparation encoderWheelDiameter wheelTorque wheelAcceleration "
        "wheelDeceleration steeringSpeed odometrySource publishWheelJointState publishWheelTF", _TOLERANCES),
    "libgazebo_ros_planar_move.so": (_DRIVE + "odometryRate cmdTimeout",),
    **dict.fromkeys(("libgazebo_ros_force_based_move.so", "libridgeback_ros_force_based_move.so",
                     "librobotnik_force_based_move.so"),
                    (_DRIVE + "odometryRate publishOdometryTf cmdTimeout", _FORCE_GAINS)),
    **dict.fromkeys(("libgazebo_ros_elevator.so", "libElevatorPlugin.so"),
                    ("topic lift_joint door_joint floor_height door_wait_time",)),
    "libInitialVelocityPlugin.so": ("linear angular",),
    "libconveyor_belt.so": ("joint speed commandTopic",),
    "libgazebo_ros_kobuki.so": (
        "left_wheel_joint_name right_wheel_joint_name wheel_separation wheel_diameter torque velocity_command_timeout "
        "publish_tf imu_name", (dict.fromkeys((
            "bumper_name", "cliff_sensor_left_name", "cliff_sensor_center_name", "cliff_sensor_right_name",
            "cliff_detection_threshold", "wheel_drop_left_sensor_name", "wheel_drop_right_sensor_name")),
            "kobuki_msgs, in which it would be told, is not there")),
    **dict.fromkeys(("libgazebo_mimic_joint_plugin.so", "libroboticsgroup_gazebo_mimic_joint_plugin.so",
                     "libroboticsgroup_upatras_gazebo_mimic_joint_plugin.so"), (_MIMIC,)),
    "libgazebo_grasp_fix.so": ("arm", (dict.fromkeys((
        "forces_angle_tolerance", "update_rate", "grip_count_threshold", "max_grip_count", "release_tolerance",
        "disable_collisions_on_attach", "contact_topic")), "fingers hold by friction, and nothing is fixed")),
    **dict.fromkeys(("libgazebo_ros_velodyne_laser.so", "libgazebo_ros_velodyne_gpu_laser.so"), (
        "topicName frameName updateRate min_range max_range gaussianNoise organize_cloud",
        ({"min_intensity": "0"}, "intensities of lasers are 0"))),
    "libhector_gazebo_ros_imu.so": (_with_errors(
        "bodyName frameId topicName biasTopicName serviceName rpyOffset updateRate updatePeriod gaussianNoise", "accel",
        "rate", "yaw"), _OFFSET, _PAUSES),
    "libhector_gazebo_ros_gps.so": (_with_errors(
        "bodyName frameId topicName velocityTopicName referenceLatitude referenceLongitude referenceAltitude "
        "referenceHeading status service updateRate updatePeriod", "", "velocity"), _ON_THE_GLOBE, _PAUSES),
    "libhector_gazebo_ros_magnetic.so": (_with_errors(
        "bodyName frameId topicName useMagneticFieldMsgs magnitude referenceHeading declination inclination updateRate "
        "updatePeriod", ""), _ON_THE_GLOBE, _PAUSES),
    "libhector_gazebo_ros_sonar.so": (_with_errors("frameId topicName updateRate", ""), _PAUSES),
    **dict.fromkeys(("libgazebo_ros_harness.so", "libHarnessPlugin.so"), ("joint winch detach",)),
    "libgazebo_ros_hand_of_god.so": ("frameId kl ka linkName",),
    **dict.fromkeys(("libgazebo_ros_wheel_slip.so", "libWheelSlipPlugin.so"), ("wheel",)),
    "libgazebo_ros_video.so": ("topicName width height",),
    "libgazebo_world_odometry.so": ("topicName frameName updateRate",),
    "libgazebo_ros_control.so": ("robotParam robotSimType controlPeriod eStopTopic legacyModeNS",),
}
TABLES = {name: ElementTable([{"plugin": "%s %s" % (_ALL, known)}], [("plugin", *row) for row in rows])
          for name, (known, *rows) in PLUGINS.items()}
