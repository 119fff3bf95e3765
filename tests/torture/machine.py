# SPDX-License-Identifier: BSD-3-Clause
"""A state machine over the lab's services and topics, in lock-step.

Hypothesis picks the steps. The result of each is compared with docs/interface.md, and after each the invariants must
hold.
"""
import errno
import functools
import math

import rospy
from baxter_core_msgs.msg import CameraSettings, EndEffectorCommand, JointCommand
from baxter_core_msgs.srv import CloseCamera, ListCameras, OpenCamera, SolvePositionIK, SolvePositionIKRequest
from bullet_sim_msgs.srv import Press, PressRequest
from controller_manager_msgs.srv import (
    ListControllers,
    LoadController,
    SwitchController,
    SwitchControllerRequest,
    UnloadController,
)
from expected import DISABLED, ENABLED, PRESSED, ExpectedControllers, ExpectedRobot
from gazebo_msgs.srv import DeleteModel, SpawnModel
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion
from hypothesis import errors as hypothesis_errors
from hypothesis import stateful
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, precondition
from invariants import EmergencyStop
from robot import Robot
from std_msgs.msg import Bool, Empty, Float64
from std_srvs.srv import Empty as EmptyService
from watch import STATES

from baxter_model import JOINTS, SIDES

# A state is published every 5 ticks, one tick late.
REST_SPEED = 0.05  # slower joints count as at rest [rad/s]
STATED_TICKS = 10
# The hardest stop within the joints' torque limits takes up to 0.36 s from full speed (4,000 random postures).
REST_TICKS = 200
STOP = EmergencyStop(STATED_TICKS, REST_TICKS, REST_SPEED)
SETTLED_TICKS, WATCHED_TICKS, MOVE_TICKS = 250, 100, 1000
ARRIVED = 0.02  # [rad]
CLAIMS = {"joint_state_controller": (), "both": ("hip", "knee"), "hip": ("hip",), "trajectory": ("hip", "knee")}
CONTROLLERS = sorted(CLAIMS)
FULL_SIZE = (1280, 800)
CAMERAS = ("head_camera", "left_hand_camera", "right_hand_camera")
BOX = """<robot name="box"><link name="link"><inertial><mass value="1"/><inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01"
 iyz="0" izz="0.01"/></inertial><collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision></link></robot>"""
BOXES = ("box_a", "box_b")
UPRIGHT = Quaternion(0.0, 0.0, 0.0, 1.0)
BAD_VALUES = st.sampled_from((math.nan, math.inf, -math.inf))
SIDE, WRIST = st.sampled_from(SIDES), st.floats(-1.5, 1.5)


def _remembering(function):
    """Wraps ``function`` of a Machine; keeps its first error.

    Hypothesis repeats failed steps. On a lab that is broken by then they fail differently, and hypothesis reports that
    later failure.
    """

    @functools.wraps(function)
    def call(self, *arguments, **options):
        try:
            return function(self, *arguments, **options)
        except Exception as error:
            if Machine.first_error is None and not isinstance(error, hypothesis_errors.HypothesisException):
                Machine.first_error = error
            raise

    return call


def rule(**strategies):
    """hypothesis's, remembering."""
    return lambda function: stateful.rule(**strategies)(_remembering(function))


def invariant():
    """hypothesis's, remembering."""
    return lambda function: stateful.invariant()(_remembering(function))


class Machine(RuleBasedStateMachine):
    """One example: a robot as after the start, and steps. The runner sets the class attributes."""

    watch = lockstep = journal_step = first_error = None

    def __init__(self):
        super().__init__()
        self.robot, self.controllers = ExpectedRobot(), ExpectedControllers(CLAIMS)
        self.boxes, self.cameras = set(), set()
        self.ticks_since_stop = None

    # -- start --------------------------------------------------------------------------------------------------------

    @initialize(disabled=st.booleans())
    def start(self, disabled):
        """Undo the effects of the previous example through the interface."""
        self.step("start", "disabled" if disabled else "enabled")
        robot = Robot(self.watch)
        self.lockstep.pause()
        robot.call("/robot/sim/press", Press, "estop", PressRequest.RELEASE, 0)
        for controller in robot.call("/one/controller_manager/list_controllers", ListControllers).controller:
            if controller.state == "running":
                self.switch_service(["", controller.name])
            robot.call("/one/controller_manager/unload_controller", UnloadController, controller.name)
        for box in BOXES:
            robot.call("/gazebo/delete_model", DeleteModel, box)
        self.cameras = set(CAMERAS)
        for camera in CAMERAS:
            answer = self.call("/cameras/open", OpenCamera, camera, CameraSettings(*FULL_SIZE, 0.0, []))
            assert answer.err == 0, answer
        self.reset("simulation")
        self.lockstep.send("/robot/set_super_reset", Empty(), 10)
        for side in SIDES:
            # No reset restores it, and hostile messages before may have set it to zero.
            self.lockstep.send("/robot/limb/%s/set_speed_ratio" % side, Float64(1.0), 1)
        self.robot.reset()
        if not disabled:
            self.enable()
            self.command_position("left", 0.3)

    # -- enable, stop -------------------------------------------------------------------------------------------------

    @rule()
    def enable(self):
        self.step("enable")
        self.lockstep.send("/robot/set_super_enable", Bool(True), 10)
        self.robot.enable()

    @rule()
    def disable(self):
        self.step("disable")
        self.lockstep.send("/robot/set_super_enable", Bool(False), STATED_TICKS)
        self.robot.disable()
        if self.robot.state == DISABLED:
            self.lockstep.advance(REST_TICKS - STATED_TICKS)
            self.is_at_rest("disabled")
        self.stays()

    @rule()
    def stop(self):
        self.step("stop")
        self.lockstep.forget_state()
        self.lockstep.send("/robot/set_super_stop", Empty(), 10)
        self.robot.stop()
        self.has_stopped()

    @rule()
    def reset_robot(self):
        self.step("reset")
        self.lockstep.send("/robot/set_super_reset", Empty(), 10)
        self.robot.reset()
        self.stays()

    @rule()
    def press(self):
        self.step("press the emergency stop")
        self.lockstep.forget_state()
        self.call("/robot/sim/press", Press, "estop", PressRequest.PRESS, 0)
        self.lockstep.advance(10)
        self.robot.press()
        self.has_stopped()

    @precondition(lambda self: self.robot.state == PRESSED)
    @rule()
    def release(self):
        self.step("release the emergency stop")
        self.call("/robot/sim/press", Press, "estop", PressRequest.RELEASE, 0)
        self.lockstep.advance(10)
        self.robot.release()

    # -- commands -----------------------------------------------------------------------------------------------------

    @rule(side=SIDE, angle=WRIST)
    def command_position(self, side, angle):
        self.step("position", side, angle)
        name = "%s_w2" % side
        self.command(side, JointCommand.POSITION_MODE, [name], [angle], 20)
        if self.robot.state == ENABLED:
            self.lockstep.advance(MOVE_TICKS)
            found = self.positions()[name]
            assert abs(found - angle) < ARRIVED, "%s was sent to %.4f and is at %.4f" % (name, angle, found)

    @rule(side=SIDE, mode=st.sampled_from((1, 2, 3, 4)), values=st.lists(st.floats(-3, 3), min_size=7, max_size=7))
    def command_any(self, side, mode, values):
        self.step("command in mode %d" % mode, side, values)
        self.command(side, mode, ["%s_%s" % (side, joint) for joint in JOINTS], values, 20)

    @rule(side=SIDE, mode=st.sampled_from((0, 1, 2, 3, 4, 5, -1)), bad=BAD_VALUES)
    def command_bad(self, side, mode, bad):
        self.step("a command that is refused", side, mode, bad)
        self.settle()
        before = self.positions()
        self.command(side, mode, ["%s_s0" % side, "%s_s1" % side], [bad, 0.5], 20)
        self.stays(before)

    @rule(side=SIDE, by_position=st.booleans(), how=st.sampled_from(("stop", "press", "disable")))
    def interrupt_motion(self, side, by_position, how):
        """Command a motion and end it halfway."""
        self.step("a motion, and an end of it", side, by_position, how)
        name = "%s_w0" % side
        if by_position:  # a position command is valid until it is reached, a velocity for 0.2 s
            away = -1.5 if self.positions().get(name, 0.0) > 0.0 else 1.5
            self.command(side, JointCommand.POSITION_MODE, [name], [away], 40)
        else:
            self.command(side, JointCommand.VELOCITY_MODE, [name], [1.0], 40)
        getattr(self, how)()

    @rule(side=SIDE, command=st.sampled_from(("go", "grip", "release", "calibrate", "stop", "reboot", "xyzzy")),
          args=st.sampled_from(("", "{}", '{"position": 30.0}', '{"position": NaN}', "[" * 2000, '{"position": 1e9}')))
    def grip(self, side, command, args):
        self.step("gripper", side, command, args[:30])
        message = EndEffectorCommand(command=command, args=args, sender="/torture", sequence=self.lockstep.ticks)
        self.lockstep.send("/robot/end_effector/%s_gripper/command" % side, message, 50)

    # -- world --------------------------------------------------------------------------------------------------------

    @rule(box=st.sampled_from(BOXES), x=st.floats(-4, -3), y=st.floats(-1, 1))
    def spawn(self, box, x, y):
        self.step("spawn", box, x, y)
        pose = Pose(Point(x, y, 0.5), UPRIGHT)
        answer = self.call("/gazebo/spawn_urdf_model", SpawnModel, box, BOX, "", pose, "world")
        assert answer.success is (box not in self.boxes), answer
        self.boxes.add(box)

    @rule(box=st.sampled_from(BOXES))
    def delete(self, box):
        self.step("delete", box)
        answer = self.call("/gazebo/delete_model", DeleteModel, box)
        assert answer.success is (box in self.boxes), answer
        self.boxes.discard(box)

    @precondition(lambda self: self.robot.state != PRESSED)
    @rule(what=st.sampled_from(("world", "simulation")))
    def reset(self, what):
        self.step("reset the " + what)
        self.watch.stamps.announce_reset()
        self.call("/gazebo/reset_" + what, EmptyService)
        self.lockstep.advance(20)
        self.stays()

    @rule(seconds=st.sampled_from((0.02, 0.2)))
    def run_free(self, seconds):
        self.step("unpause and pause", seconds)
        self.lockstep.run_free(seconds)
        self.lockstep.advance(20)

    # -- controllers, cameras, inverse kinematics ---------------------------------------------------------------------

    @rule(name=st.sampled_from(CONTROLLERS))
    def load(self, name):
        self.step("load", name)
        answer = self.call("/one/controller_manager/load_controller", LoadController, name)
        assert answer.ok is self.controllers.load(name), "load %s answered %s" % (name, answer.ok)
        self.controllers_are_as_expected()

    @rule(name=st.sampled_from(CONTROLLERS))
    def unload(self, name):
        self.step("unload", name)
        answer = self.call("/one/controller_manager/unload_controller", UnloadController, name)
        assert answer.ok is self.controllers.unload(name), "unload %s answered %s" % (name, answer.ok)
        self.controllers_are_as_expected()

    @rule(names=st.lists(st.sampled_from([*CONTROLLERS, ""]), min_size=2, max_size=2, unique=True))
    def switch(self, names):
        self.step("start and stop", *names)
        answer = self.switch_service(names)
        assert answer.ok is self.controllers.switch(*names), "start, stop %s answered %s" % (names, answer.ok)
        self.controllers_are_as_expected()

    @rule(camera=st.sampled_from((*CAMERAS, "nose_camera")),
          size=st.sampled_from((FULL_SIZE, (640, 400), (641, 400), (0, 0))))
    def open_camera(self, camera, size):
        self.step("open", camera, *size)
        answer = self.call("/cameras/open", OpenCamera, camera, CameraSettings(*size, 0.0, []))
        if camera in CAMERAS and size in (FULL_SIZE, (640, 400)):
            assert answer.err == 0, answer
            self.cameras.add(camera)
        else:
            assert answer.err != 0, "opened %s with %d x %d" % (camera, *size)

    @rule(camera=st.sampled_from((*CAMERAS, "nose_camera")))
    def close_camera(self, camera):
        self.step("close", camera)
        answer = self.call("/cameras/close", CloseCamera, camera)
        expected = 0 if camera in self.cameras else errno.EINVAL if camera in CAMERAS else errno.ENODEV
        assert answer.err == expected, "closing %s answered %s, expected %d" % (camera, answer, expected)
        self.cameras.discard(camera)

    @rule(side=SIDE, x=st.floats(0.3, 1.2), y=st.floats(-0.5, 0.5), z=st.floats(-0.2, 0.8), bad=st.booleans())
    def solve(self, side, x, y, z, bad):
        self.step("inverse kinematics", side, x, y, z, bad)
        pose = PoseStamped(pose=Pose(Point(x, math.nan if bad else y, z), Quaternion(0.0, 1.0, 0.0, 0.0)))
        pose.header.frame_id = "base"
        answer = self.call("/ExternalTools/%s/PositionKinematicsNode/IKService" % side, SolvePositionIK,
                           [pose], [], SolvePositionIKRequest.SEED_AUTO)
        assert len(answer.isValid) == len(answer.joints) == 1 and not (bad and answer.isValid[0]), answer
        if answer.isValid[0]:
            angles = dict(zip(answer.joints[0].name, answer.joints[0].position, strict=True))
            assert len(angles) == 7 and not self.watch._limits.check(angles, angles.values()), angles

    # -- what holds after each step -----------------------------------------------------------------------------------

    @invariant()
    def nothing_wrong_was_published(self):
        found = self.watch.take_found()
        assert not found, "; ".join(found[:5])

    @invariant()
    def state_is_as_expected(self):
        if self.lockstep.ticks:
            self.lockstep.await_state(self.robot.fields)

    @invariant()
    def cameras_are_as_expected(self):
        if self.lockstep.ticks % 7 == 0 and self.lockstep.ticks:  # not always: it costs a call
            listed = set(self.call("/cameras/list", ListCameras).cameras)
            assert self.cameras <= listed, "open are %s, listed %s" % (self.cameras, listed)

    def teardown(self):
        self.watch.still.disarm()

    # -- parts of steps -----------------------------------------------------------------------------------------------

    def step(self, *words):
        self.journal_step(" ".join(map(str, words)))

    def call(self, name, service_class, *arguments):
        """Call a service that does not wait for a tick."""
        return Robot.call(None, name, service_class, *arguments)

    def command(self, side, mode, names, values, ticks):
        self.lockstep.send("/robot/limb/%s/joint_command" % side, JointCommand(mode, values, names), ticks)

    def positions(self):
        message = self.watch.latest[STATES]
        return {name: position for name, position in zip(message.name, message.position, strict=True)
                if name[-2:] in JOINTS}

    def speeds(self):
        message = self.watch.latest[STATES]
        return [speed for name, speed in zip(message.name, message.velocity, strict=True) if name[-2:] in JOINTS]

    def settle(self):
        """Wait until earlier commands have expired."""
        for _ in range(20):
            self.lockstep.advance(SETTLED_TICKS)
            if all(abs(speed) < 0.001 for speed in self.speeds()):
                return

    def stays(self, before=None):
        """Expect that no arm moves from now on, or from ``before``, since there is no command."""
        if before is None:
            self.settle()
            before = self.positions()
        self.watch.still.arm(before)
        self.lockstep.advance(WATCHED_TICKS)
        self.watch.still.disarm()

    def has_stopped(self):
        """Expect that the robot reports the stop in time, and that the arms come to rest in time and stay at rest."""
        self.lockstep.await_state(self.robot.fields)
        self.lockstep.advance(REST_TICKS - STATED_TICKS)
        found = STOP.check(REST_TICKS, self.lockstep.state().stopped, self.speeds())
        assert not found, found
        self.stays()

    def is_at_rest(self, after):
        fastest = max(map(abs, self.speeds()))
        assert fastest < REST_SPEED, "a joint moves at %.4f rad/s %d ticks after it was %s" % (
            fastest, REST_TICKS, after)

    def switch_service(self, names):
        start, stop = ([name] if name else [] for name in names)
        service = rospy.ServiceProxy("/one/controller_manager/switch_controller", SwitchController)
        return self.lockstep.call_while_advancing(
            service, start, stop, SwitchControllerRequest.STRICT, False, 0.0)

    def controllers_are_as_expected(self):
        listed = self.call("/one/controller_manager/list_controllers", ListControllers).controller
        found = {controller.name: controller.state == "running" for controller in listed}
        assert found == self.controllers.running, "listed %s, expected %s" % (found, self.controllers.running)
