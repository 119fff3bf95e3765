# SPDX-License-Identifier: BSD-3-Clause
"""The elements of noetic's gazebo_plugins and gazebo_ros_control, by file name, and their effect here. ROS-free."""
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
        "legacyMode odometrySource publishWheelJointState publishWheelTF publishOdomTF publishTf",),
    "libgazebo_ros_skid_steer_drive.so": (
        _DRIVE + "updateRate leftFrontJoint rightFrontJoint leftRearJoint rightRearJoint wheelSeparation wheelDiameter "
        "torque broadcastTF covariance_x covariance_y covariance_yaw",),
    "libgazebo_ros_tricycle_drive.so": (
        _DRIVE + "updateRate steeringJoint actuatedWheelJoint actuatedWheelDiameter encoderWheelLeftJoint "
        "encoderWheelRightJoint encoderWheelSeparation encoderWheelDiameter wheelTorque wheelAcceleration "
        "wheelDeceleration steeringSpeed odometrySource publishWheelJointState publishWheelTF", _TOLERANCES),
    "libgazebo_ros_planar_move.so": (_DRIVE + "odometryRate cmdTimeout",),
    "libgazebo_ros_force_based_move.so": (_DRIVE + "odometryRate publishOdometryTf cmdTimeout", _FORCE_GAINS),
    "libgazebo_ros_elevator.so": ("topic lift_joint door_joint floor_height door_wait_time",),
    "libgazebo_ros_hand_of_god.so": ("frameId kl ka linkName",),
    "libgazebo_world_odometry.so": ("topicName frameName updateRate",),
    "libgazebo_ros_control.so": ("robotParam robotSimType controlPeriod eStopTopic legacyModeNS",),
}
TABLES = {name: ElementTable([{"plugin": "%s %s" % (_ALL, known)}], [("plugin", *row) for row in rows])
          for name, (known, *rows) in PLUGINS.items()}
