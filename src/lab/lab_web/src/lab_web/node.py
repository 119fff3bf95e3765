# SPDX-License-Identifier: BSD-3-Clause
"""The node lab_web: serves the page beside a running lab, and prints its address."""
from __future__ import annotations

import argparse
import contextlib
import importlib.util
import os
import re
import secrets
import socket
import sys
import threading
import time
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple
from urllib.parse import quote

import rosgraph
import rospkg
import rospy

from baxter_conformance.reader import NO_ANSWER, read
from baxter_model.interface import physical_robot
from lab_web import jupyter, page_files
from lab_web.buttons import Buttons
from lab_web.certificate import CertificateError, certificate
from lab_web.comparison import Comparison, findings_of
from lab_web.episodes import Episodes, of_workspace
from lab_web.exercises import ExerciseResults
from lab_web.hands import HandAnswers, ghost
from lab_web.lab import PageLab
from lab_web.libraries import LibrariesError, fetched, kept_in
from lab_web.loops import attended
from lab_web.move_group import RESULT_TOPIC, RESULT_TYPE, MoveGroupPlanner
from lab_web.notebooks import PATH, NotebookDoor, NotebookHandler, Notebooks, labs_notebooks
from lab_web.overlay import PageOverlay
from lab_web.overlay_topics import OverlayTopics
from lab_web.planning import PagePlanning
from lab_web.playback import MotionRecorder, play
from lab_web.release_guard import ReleaseGuard
from lab_web.robot import ARM_LINKS, BaxterTopics
from lab_web.robot_parts import SCREEN_TOPIC, PartPublishers
from lab_web.scene import SceneFollower, bodies_of
from lab_web.serving import Pages, episode_routes, routes, upload_routes
from lab_web.servos import Servos
from lab_web.sim_clock import LINGER_S, SimClock
from lab_web.simulation import SimulationControls
from lab_web.steering import SteeredMotion
from lab_web.steering import operation as steer_operation
from lab_web.task_queue import TaskQueue
from lab_web.tokens import TOKEN, VIEW_TOKEN
from loop_ros.faults import Faults
from master_calls.simulator_start import SimulatorDied, StartWatch
from processes.memory import return_large_blocks
from rospy_fixes.ports.threads import lasting
from rospy_nodes.rest import Demand
from rospy_nodes.start import end_on_signals, limit_ports
from web_bridge import ros_graph
from web_bridge.access import Access
from web_bridge.cameras import Cameras
from web_bridge.codec import Codec
from web_bridge.errors import shown
from web_bridge.loop_thread import LoopThread
from web_bridge.serving import Serving, first_sockets, port_of, tls_context
from web_bridge.session import Bridge
from web_bridge.video import SnapshotHandler, VideoOptions, VideoServer
from web_bridge.websocket import Clients, SocketOptions
from world_picture.snapshot import SnapshotError

if TYPE_CHECKING:
    from collections.abc import Callable

    from baxter_conformance.comparison import ConformanceFinding

FIRST_PORT = 8090
# So many are tried.
PORTS = 100
_LARGEST_PORT = 65535
#: Period of poses to the pages [s]; of looks at what changes rarely, each some questions to the master [s]; the same
#: while nobody needs them, and how often it is looked whether somebody does.
_POSES_S, _LOOK_S, _LOOK_UNSEEN_S, _UNSEEN_S = 0.05, 1.0, 5.0, 0.25
# Between two looks at whether somebody needs the robot's states [s].
_NEED_S = 0.1
# The addresses are printed so long after the page is there at most, if the lab is still starting [s].
_START_S = 60.0
# Between warnings of the same [s].
_COMPLAIN_S = 60.0
# How long the comparison with a physical robot waits for the messages of some topics [s].
_MESSAGES_S = 5.0
_SNAPSHOT = "/gazebo/snapshot"
_COMPRESSED = "sensor_msgs/CompressedImage"


class PageFailure(Exception):
    """The page cannot be served; the text says why, and what helps."""


def main() -> int:
    """Returns the exit code."""
    options = parse(rospy.myargv()[1:])
    try:
        _require_lab()
        there = page_files.address(rosgraph.get_master_uri())
        # A second node of the name would end the first and somebody's page. Options ask for another one.
        if there and not _is_launched() and not rospy.myargv()[1:]:
            print("The lab's page is served already, until Ctrl-C in its terminal. Open in a browser:\n\n    %s"
                  % there, flush=True)
            return 0
        page = Path(rospkg.RosPack().get_path("lab_web")) / "page"
        serve(options, page, fetched(page))
    except (PageFailure, LibrariesError) as error:
        print("lab_web: %s" % error, flush=True)
        return 2
    return 0


def parse(argv: list[str]) -> argparse.Namespace:
    """The options."""
    parser = argparse.ArgumentParser(prog="./baxter.sh web", description="The lab's page in a browser, beside a "
                                     "running lab, until Ctrl-C or until the lab ends.")
    parser.add_argument("--port", type=_port_number, help="the port; default: the first free one from %d" % FIRST_PORT)
    parser.add_argument("--public", action="store_true", help="open the page to other machines; see docs/web.md")
    parser.add_argument("--token", type=_token, default=os.environ.get(TOKEN),
                        help="the operator's token; default: the variable %s, else a new one" % TOKEN)
    parser.add_argument("--view-token", type=_token, default=os.environ.get(VIEW_TOKEN),
                        help="the token of those that only watch and stop; default: the variable %s, else a new one"
                        % VIEW_TOKEN)
    parser.add_argument("--notebook", action=argparse.BooleanOptionalAction, default=None,
                        help="offer JupyterLab beside the robot to the operator's token; it starts when a page asks "
                        "for it. Default: yes, but with --public no: it runs any code")
    parser.add_argument("--notebook-root", type=Path, metavar="FOLDER",
                        help="the topmost folder of the notebooks; the labs' are copied there. Default: the workspace")
    parser.add_argument("--below", type=_below, default="", metavar="PATH",
                        help="the path at which a front door shows this page, such as /anna")
    return parser.parse_args(argv)


def _port_number(text: str) -> int:
    if not (text.isdecimal() and int(text) <= _LARGEST_PORT):
        raise argparse.ArgumentTypeError("%r is no port; 0 (any free one) to %d are" % (text, _LARGEST_PORT))
    return int(text)


def _token(text: str) -> str:
    if not text.isprintable() or not text:
        raise argparse.ArgumentTypeError("%r is no token; letters, digits and signs are expected" % text)
    return text


def _below(text: str) -> str:
    if not re.fullmatch(r"(/[\w-]+)*", text):
        raise argparse.ArgumentTypeError("%r is no path of an address; /anna is one, without a slash at its end" % text)
    return text


def _require_lab() -> None:
    if not rosgraph.is_master_online():
        raise PageFailure("no lab runs at %s. Start one in another terminal: "
                          "./baxter.sh sim roslaunch baxter_gazebo baxter_world.launch" % rosgraph.get_master_uri())


def serve(options: argparse.Namespace, page: Path, libraries: Path) -> None:
    """Serve until the node or the lab ends. Raises PageFailure."""
    tokens = options.token or secrets.token_urlsafe(18), options.view_token or secrets.token_urlsafe(18)
    if tokens[0] == tokens[1]:
        raise PageFailure("--token and --view-token are the same; pages that only watch need another one")
    network = "" if options.public else "127.0.0.1"
    # Before the node, whose name ends the page that has the port. Browsers that come early wait.
    sockets = _sockets(options, network)
    port = port_of(sockets)
    return_large_blocks()
    limit_ports()
    end_on_signals()
    rospy.init_node("lab_web", disable_signals=True, disable_rostime=True)
    loop_thread = LoopThread("lab_web")
    forwarded = forwarded_address(os.environ, port)
    access = Access({tokens[0]: True, tokens[1]: False}, [forwarded] if forwarded else ())
    robot = BaxterTopics(lambda text: pages.tell(None, "refused", text))
    pages = Pages(access, loop_thread, PageLab(
        robot, lambda: pages.control_changed(), lambda client, code, text: pages.tell(client, code, text),
        rested=lambda client: pages.answer(client, {"op": "rested"})))
    faults = Faults(_Log())
    equipment = _equip(pages, robot, faults)

    def is_needed() -> bool:
        return len(pages) > 0 or equipment.recorder.is_running

    graph, codec = ros_graph.RosGraph(), Codec(ros_graph.message_class, ros_graph.now)
    bridge = Bridge(graph, codec, loop_thread.later)
    video = VideoServer(Cameras(graph, codec, loop_thread), VideoOptions(access))
    clock = SimClock(lambda: is_needed() or clients.need_time)

    def clients_changed(_connected: list) -> None:
        if clients.need_time:
            clock.need()

    clients = Clients(bridge, loop_thread, SocketOptions(access), clients_changed)

    def listen() -> None:
        robot.listen()
        equipment.servos.listen()

    def rest() -> None:
        robot.rest()
        equipment.servos.rest()

    states = Demand(listen, rest, LINGER_S, is_needed)

    def watch(ends: Callable[[], bool]) -> None:
        while not ends():
            if is_needed():
                clock.need()
                states.need()
            rospy.rostime.wallsleep(_NEED_S)

    notebooks = _notebooks(options, pages)
    application = clients.application(*routes(pages, page, libraries), *upload_routes(pages, equipment.recorder),
                                      *episode_routes(pages, equipment.episodes),
                                      *_notebook_routes(notebooks, access),
                                      (r"/snapshot", SnapshotHandler, {"server": video}))
    serving = Serving(loop_thread, application, port, network, sockets=sockets)
    secure = _serve_securely(loop_thread, application, port, network) if options.public else None
    threads = [threading.Thread(target=lasting(faults, place, loop), args=(rospy.is_shutdown,)) for place, loop in (
        ("the robot's states", watch), *equipment.loops.items())]
    for thread in threads:
        thread.start()
    address = ""
    try:
        address = _announce(serving.port, tokens, options.public, secure.port if secure else None)
        lasting(faults, "the robot's parts", partial(_watch, robot, equipment, pages, is_needed))(rospy.is_shutdown)
    finally:
        page_files.remove_address(rosgraph.get_master_uri(), address)
        rospy.signal_shutdown("the end")
        if notebooks is not None:
            notebooks.close()
        for thread in threads:
            thread.join()
        equipment.guard.close()
        equipment.episodes.close()
        clients.shut_down()
        for one in (serving, secure):
            if one is not None:
                one.close()
        video.cameras.shut_down()
        loop_thread.stop()


def _workspace() -> Path:
    return Path(rospkg.RosPack().get_path("lab_web")).parents[2]


def _notebooks(options: argparse.Namespace, pages: Pages) -> Notebooks | None:
    """The Notebooks of the page, or None where it offers none. Raises PageFailure."""
    offered = not options.public if options.notebook is None else options.notebook
    if not offered or importlib.util.find_spec("jupyterlab") is None:
        return None
    packages, workspace, root = rospkg.RosPack(), _workspace(), options.notebook_root
    try:
        if root is None and (workspace / "src").is_dir():
            root, files = workspace, jupyter.notebooks(workspace)
            files = [path.relative_to(workspace).as_posix() for path in files]
        else:
            # An install space is no place for a user's work.
            root = (root or Path.home() / "baxter_notebooks").absolute()
            folders = {name: Path(packages.get_path(name)) / "notebooks" for name in packages.list()}
            files = labs_notebooks({name: path for name, path in folders.items() if path.is_dir()}, root)
    except OSError as error:
        raise PageFailure("the notebooks cannot be put into %s: %s; name another folder by --notebook-root, or add "
                          "--no-notebook" % (root, error.strerror)) from None
    if (workspace / "baxter.sh").is_file():
        # Cells and terminals find the check there.
        os.environ.setdefault("LAB_ROOT", str(workspace))
    made = Notebooks(partial(jupyter.Server, root, options.below + PATH), files, partial(pages.share, "notebook"),
                     options.below)
    pages.lab.add("notebook", made.ask, needs_control=False)
    return made


def _notebook_routes(notebooks: Notebooks | None, access: Access) -> list[tuple[str, type, dict[str, Any]]]:
    return [] if notebooks is None else [(PATH + ".*", NotebookHandler, {"door": NotebookDoor(access, notebooks)})]


class _Log:
    """rospy's, for :class:`loop_ros.faults.Faults`."""

    def error(self, text: str) -> None:
        rospy.logerr(text)


class _Equipment(NamedTuple):
    """Services of pages beside the arms; ``loops``: {name: function of ``ends``}, for a thread each."""

    hands: HandAnswers
    simulation: SimulationControls
    recorder: MotionRecorder
    guard: ReleaseGuard
    overlay_topics: OverlayTopics
    servos: Servos
    episodes: Episodes
    loops: dict[str, Callable[[Callable[[], bool]], object]]


def _equip(pages: Pages, robot: BaxterTopics, faults: Faults) -> _Equipment:
    """Add the operations of all parts to the lab."""
    lab = pages.lab
    hands = HandAnswers(robot.measured, lambda chain, joints: ghost(pages.picture, chain, joints), pages.answer)
    lab.add("reach", hands.ask, needs_control=False)
    overlay_topics = OverlayTopics(lambda: hands.base(pages.picture))
    overlay = PageOverlay(overlay_topics, pages.show, pages.answer, pages.tell)
    lab.add("watch", overlay.watch, needs_control=False, for_viewers=True)
    pages.when_closed = overlay.forget
    parts = PartPublishers()
    tasks, switches, plans, comparisons, edits = (TaskQueue(pages.tell, faults) for _ in range(5))
    guard = ReleaseGuard()
    buttons = Buttons(parts.switch, switches, guard.pressed)
    simulation = SimulationControls(tasks, lambda: bodies_of(pages.picture, robot.limits), pages.answer,
                                    lambda state: pages.share("simulation", state))
    lab.when_lost(buttons.release_all)
    planning = PagePlanning(lab, robot, MoveGroupPlanner(), plans, pages.answer)
    lab.add("plan", planning.plan)
    # A page that is silent for a moment still gets its plan; to move, it must be there.
    lab.when_lost(planning.cancel, when_silent=False)
    recorder = MotionRecorder(lambda recording: pages.share("recording", recording))
    robot.heard = recorder.take
    lab.add("record", recorder.record, needs_control=False)
    lab.add("load", recorder.load, needs_control=False)
    lab.add("play", lambda client, _operation: play(lab, client, recorder))
    servos = Servos()
    steering = SteeredMotion(lambda: servos.hands, lambda side: robot.explain(
        side + "_s0", lambda why: pages.tell(lab.holder, "held", "the %s arm: %s" % (side, why))), hands.pose)
    lab.add("steer", steer_operation(lab, steering, lambda: servos.hands))
    lab.add("mark", servos.mark)
    episodes = of_workspace(_workspace(), servos.tell, edits, partial(pages.share, "episodes"))
    lab.add("episodes", episodes.ask, needs_control=False)
    comparison = Comparison(_findings, comparisons, partial(pages.share, "interface"), time.time)
    lab.add("compare", comparison.ask, needs_control=False)
    lab.add("nod", parts.nod, needs_power=True)
    for name, serve in {"press": buttons.press, "turn": buttons.turn, **parts.operations(),
                        **simulation.operations()}.items():
        lab.add(name, serve)
    return _Equipment(hands, simulation, recorder, guard, overlay_topics, servos, episodes, {
        **{name: attended(pages.present, loop) for name, loop in (
            ("the arms", lab.run), ("the 3D view", partial(_follow, pages)), ("points and frames", overlay.run),
            ("the hands", hands.run), ("tasks", tasks.run), ("plans", plans.run),
            ("comparison", comparisons.run), ("episodes", edits.run))},
        # Those of a page that has gone are released after that.
        "buttons": lambda ends: switches.run(ends, buttons.release_all)})


def _findings() -> list[ConformanceFinding]:
    return findings_of(physical_robot(), lambda robot: read(robot, _MESSAGES_S), rosgraph.is_master_online, NO_ANSWER)


def _sockets(options: argparse.Namespace, network: str) -> list[socket.socket]:
    """Sockets that listen on the page's port. Raises PageFailure."""
    ports = range(FIRST_PORT, FIRST_PORT + PORTS) if options.port is None else [options.port]
    try:
        return first_sockets(ports, network)
    except OSError as error:
        if options.port is None:
            raise PageFailure("no port from %d to %d can be opened: %s; end a program that holds one, or name another "
                              "one by --port" % (ports[0], ports[-1], error)) from None
        raise PageFailure("port %d cannot be opened: %s; name another one by --port" % (options.port, error)) from None


def forwarded_address(variables: Mapping[str, str], port: int) -> str:
    """The address at which a GitHub codespace forwards a port to its owner's browser; "" elsewhere."""
    name, domain = variables.get("CODESPACE_NAME"), variables.get("GITHUB_CODESPACES_PORT_FORWARDING_DOMAIN")
    return "https://%s-%d.%s" % (name, port, domain) if name and domain else ""


def _host() -> str:
    """This machine's name or address for others."""
    return os.environ.get("ROS_IP") or socket.gethostname()


def _serve_securely(loop_thread: LoopThread, application: Any, port: int, network: str) -> Serving | None:
    """The same pages by https on another port, for headsets and telephones; None where there is no certificate."""
    try:
        tls = tls_context(*certificate(kept_in(), [_host(), "localhost"]))
        return Serving(loop_thread, application, port, network, tls,
                       sockets=first_sockets(range(port + 1, port + PORTS), network))
    except (CertificateError, OSError) as error:
        rospy.logwarn("no page by https, which headsets need: %s", error)
        return None


def _announce(port: int, tokens: tuple[str, str], public: bool, secure_port: int | None = None) -> str:
    """Make the addresses known, and print them once the lab has started; returns the operator's."""
    host = _host() if public else "localhost"
    address = (forwarded_address(os.environ, port) or "http://%s:%d" % (host, port)) + "/"
    # A token of the user may hold signs that mean something else in an address.
    operators, viewers = ("%s?token=%s" % (address, quote(token, safe="")) for token in tokens)
    rospy.set_param("~address", address)
    # Notebooks of this user find it there; a folder that cannot be written costs only that.
    with contextlib.suppress(OSError):
        page_files.write_address(rosgraph.get_master_uri(), operators)
    # What else roslaunch starts still prints lines.
    secure = "https://%s:%d/?token=%s" % (host, secure_port, quote(tokens[0], safe="")) if secure_port else ""
    text = announcement(operators, viewers, port if public else None, _is_launched(), secure)
    threading.Thread(target=_print_when_started, args=(text,), daemon=True).start()
    return operators


def _is_launched() -> bool:
    """Whether roslaunch started this process: it names its nodes."""
    return "__name" in rosgraph.names.load_mappings(sys.argv)


def announcement(operators: str, viewers: str, public_port: int | None, is_launched: bool, secure: str = "") -> str:
    """The printed text of the addresses; the operator's is the last line."""
    text = "To watch, and to stop the robot:\n\n    %s\n\n" % viewers
    if public_port is not None:
        text += ("Port %d is open to every machine of the network: who has the operator's address moves the robot. The "
                 "connection is not encrypted.\n\n" % public_port)
    if secure:
        text += ("For a headset or a telephone that moves the hands, encrypted by a certificate of its own, which "
                 "the browser asks about once:\n\n    %s\n\n" % secure)
    if not is_launched:
        text += "Ctrl-C here ends the page; the lab goes on.\n\n"
    return text + "Open in a browser:\n\n    %s" % operators


def _print_when_started(text: str) -> None:
    """Print a text once no process of the lab is starting any more, or after _START_S."""
    watch, deadline = StartWatch(rosgraph.get_master_uri(), rospy.get_name()), time.monotonic() + _START_S
    # A lab that ends meanwhile says so itself.
    with contextlib.suppress(SimulatorDied):
        while watch.look() and time.monotonic() < deadline and not rospy.is_shutdown():
            rospy.rostime.wallsleep(_LOOK_S)
    if not rospy.is_shutdown():
        print(text, flush=True)


def _watch(robot: BaxterTopics, equipment: _Equipment, pages: Pages, is_needed: Callable[[], bool],
           ends: Callable[[], bool]) -> None:
    """Look after what changes rarely, until the node or the lab ends; at once when somebody needs it (``is_needed``)
    after a time without."""
    told, types, results = None, {}, ExerciseResults(page_files.result_file())
    while not ends():
        if not rosgraph.is_master_online():
            print("The lab has ended, and the page with it.", flush=True)
            return
        # The master may end between the two lines.
        with contextlib.suppress(OSError, rospy.ROSException, rosgraph.MasterException):
            robot.look_after()
            equipment.overlay_topics.look_after()
            description = robot.read_description()
            if description is not None:
                equipment.hands.know(description, ARM_LINKS, rospy.logwarn)
            published = dict(rospy.get_published_topics())
            now = _described(robot, equipment, published)
            if now["has_scene"] and len(pages):
                equipment.simulation.look()
            if (result := results.newest()) is not None:
                pages.share("result", result)
            if published != types:
                types = published
                pages.share("topics", {"types": types})
            if now != told:
                pages.share("robot", now)
                told = now
        looked = time.monotonic()
        rospy.rostime.wallsleep(_LOOK_S)
        while not ends() and not is_needed() and time.monotonic() - looked < _LOOK_UNSEEN_S:
            pages.present.wait(_UNSEEN_S)


def _described(robot: BaxterTopics, equipment: _Equipment, published: Mapping[str, str]) -> dict[str, Any]:
    """Description of the robot for pages: the operation "robot". ``published``: {topic: type}."""
    return {"joints": [{"name": name, "lower": limits.lower, "upper": limits.upper}
                       for name, limits in robot.limits.items()],
            "poses": list(robot.poses), "hands": equipment.hands.sides, "servos": equipment.servos.there,
            "grippers": robot.grippers,
            "cameras": sorted(topic for topic, kind in published.items() if kind == _COMPRESSED),
            "can_plan": published.get(RESULT_TOPIC) == RESULT_TYPE,
            "can_press": PartPublishers.can_press(), "has_screen": SCREEN_TOPIC in published,
            "has_scene": isinstance(rospy.get_param(_SNAPSHOT, None), str), "things": equipment.simulation.things}


def _snapshot_folder() -> str:
    """The folder of the simulator's state. Raises SnapshotError where there is none."""
    folder = rospy.get_param(_SNAPSHOT, None)
    if folder is not None and not isinstance(folder, str):
        rospy.logwarn_throttle(_COMPLAIN_S, "no 3D view: the parameter %s is %s; the text of a folder's path is "
                               "expected" % (_SNAPSHOT, shown(folder)))
    if not isinstance(folder, str):
        raise SnapshotError("there is no simulator")
    return folder


def _follow(pages: Pages, ends: Callable[[], bool]) -> None:
    """Send poses to the pages; across restarts of the simulator."""
    follower, picture = None, None
    while not ends():
        began = time.monotonic()
        try:
            if follower is None or not follower.is_alive:
                follower, picture = SceneFollower(_snapshot_folder(), rospy.logwarn), None
            is_new = follower.follow()
            if follower.picture is not None and (is_new or follower.picture is not picture):
                picture = follower.picture
                pages.show_poses(picture, follower.poses())
        # No simulator, or it is just starting or ending.
        except (SnapshotError, OSError, rosgraph.MasterException):
            follower = None
            rospy.rostime.wallsleep(_LOOK_S)
        rospy.rostime.wallsleep(max(0.0, _POSES_S - (time.monotonic() - began)))
