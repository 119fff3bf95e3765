#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Benchmarks of the stack: every figure beside its peer in the same run, median and spread over rounds.

    ./baxter.sh bench [NAME...] [--rounds 5] [--quick] [--all]

A NAME is a suite, see --list; without one, all suites run. The table goes to the terminal; JSON, Markdown and pictures
go to .baxter/bench. Suites take turns, round by round, so that a busy minute of the machine affects all of them.
"""
import argparse
import datetime
import json
import os
import platform
import signal
import subprocess
import sys
from importlib import import_module
from pathlib import Path

from pictures import distribution, ratios
from report import Report, as_json, markdown, put_together, table

from command_line.options import Parser, did_you_mean, seconds

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
PEERS = ROOT / ".baxter/bench/python"
# Name: (module with a function `measure(report, quick, number)`, description). Each round has its own process.
SUITES = {
    "ik": ("ik_bench", "inverse kinematics beside TRAC-IK and KDL: solved, time; batches; clear of collisions"),
    "verdict": ("verdict_bench", "poses without a solution for a known cause: the share of correct diagnoses"),
    "fk": ("fk_bench", "forward kinematics and Jacobian beside PyKDL and PyBullet"),
    "load": ("physics_bench", "loading and stepping Baxter beside PyBullet's own loaders"),
    "control": ("control_tick_bench", "the controllers of 18 joints beside a physics step"),
    "robot": ("robot_bench", "a tick of Baxter's control logic beside the physics step of the same world"),
    "planning": ("planning_bench", "paths for Baxter and PROBOT beside OMPL's RRTConnect on exact geometry"),
    "servo": ("servo_bench", "random streams of twists in physics: contacts, limits, tracking, dead ends, CPU"),
    "replanning": ("replanning_bench", "obstacles that enter the way of a moving arm: time to another way, stops"),
    "planned": ("planned_bench", "10,000 states of planned trajectories checked by PyBullet: contacts, limits"),
    "tick": ("tick_bench", "a tick of /gazebo beside the physics step in it, CPU time, without other nodes"),
    "collision": ("self_collision_bench", "a physics step of Baxter with self-collision beside one without"),
    "physics": ("world_bench", "the stack at full speed beside bare steps: alone, with objects, clients, contact"),
    "loop": ("loop_bench", "real time: CPU, joint_states jitter, latency, with 0, 5 and 20 subscribers"),
    "keeps_up": ("keeps_up_bench", "real time with the window, rviz, a stopped reader, a busy thread in /gazebo"),
    "window": ("window_bench", "the world's window: pictures per second, CPU of a picture and of a world at rest"),
    "hostile": ("hostile_bench", "hostile descriptions spawned: the longest gap in joint_states, the longest answer"),
    "lockstep": ("lockstep_bench", "two fresh labs in lock-step, the same commands: joint states bit for bit"),
    "services": ("service_bench", "the IK service beside an empty service"),
    "move_group": ("move_group_bench", "move_group's services beside empty ones; its start-up time, and cancels"),
    "tracking": ("tracking_bench", "trajActionServer: the jitter of its commands, the arm's tracking error"),
    "fidelity": ("fidelity_bench", "a recording of a physical robot's arms, replayed: --recording FILE for another"),
    "placing": ("placing_bench", "pick and place by friction, twenty seeds a round: 100 in five"),
    "start": ("start_bench", "launch to /robot/sim/started; memory of each process, CPU of a resting lab"),
    "cameras": ("camera_bench", "pictures beside PyBullet's own; pictures per second, and their cost to physics"),
    "web": ("web_bench", "the page: first sight, cost of viewers, delays of cameras, hands, stop and echoes"),
    "web_soak": ("web_soak_bench", "growth of the page's server under 50 clients that come and go, some misbehaving"),
    "batch": ("batch_bench", "an episode of a batch in a worker process beside one in a bare loop"),
    "batch_nodes": ("batch_nodes_bench", "a batch by two Ray nodes of one core each beside one; as root"),
    "policy": ("policy_bench", "PickPlace by the policy of ./baxter.sh learn over ROS beside its environment"),
    "gym": ("gym_bench", "environments for learning: actions a second; TwoArmLift beside robosuite's"),
    "labs": ("labs_bench", "1, 2 and 4 labs side by side: factor and memory of each"),
    "class": ("class_bench", "6 labs of ./baxter.sh labs, and 16 of which 12 are paused: labs per core and per GB"),
}
# Time limit of a round of a suite [s], and with --all; after that it counts as hung.
LIMIT_S, LIMIT_OF_ALL_S = 1200, 4500


def parse(argv: list[str]) -> argparse.Namespace:
    """The options."""
    parser = Parser(prog="./baxter.sh bench", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", help="suites to run (default: all)")
    parser.add_argument("--rounds", type=int, default=5, help="number of rounds (default: 5)")
    parser.add_argument("--quick", action="store_true", help="a tenth of the work, only to see that it runs")
    parser.add_argument("--all", action="store_true",
                        help="planning: in five rounds all 1,800 bookshelf problems, not a fifth of them; web_soak: "
                             "an hour, not five minutes")
    parser.add_argument("--list", action="store_true", help="list the suites")
    parser.add_argument("--out", type=Path, default=ROOT / ".baxter/bench", help="folder for JSON and pictures")
    parser.add_argument("--recording", type=Path, help="what `fidelity` replays (default: the one in the tree)")
    parser.add_argument("--from", dest="begin", type=seconds(), metavar="S",
                        help="fidelity: begin at this second of the recording, in motion if it is")
    parser.add_argument("--fit", choices=("left", "right", "both"),
                        help="fidelity: fit the actuators' numbers to this arm instead, and test them on the other")
    parser.add_argument("--child", help=argparse.SUPPRESS)
    parser.add_argument("--number", type=int, default=0, help=argparse.SUPPRESS)
    options = parser.parse_args(argv)
    unknown = [name for name in options.names if name not in SUITES]
    if unknown:
        parser.error("unknown suite: %s; the suites are %s%s" % (", ".join(unknown), ", ".join(SUITES),
                                                                 did_you_mean(unknown[0], SUITES)))
    if options.rounds < 1:
        parser.error("--rounds must be at least 1, got %d" % options.rounds)
    if options.recording is not None and not options.recording.is_file():
        parser.error("--recording: there is no file %s" % options.recording)
    if options.fit is not None and options.names != ["fidelity"]:
        parser.error("--fit belongs to fidelity: ./baxter.sh bench fidelity --fit %s" % options.fit)
    return options


def main():
    options = parse(sys.argv[1:])
    if options.list:
        for name, (_, about) in SUITES.items():
            print("%-10s %s" % (name, about))
        return 0
    if options.child:
        return child(options)
    if options.recording is not None:
        os.environ["BENCH_RECORDING"] = str(options.recording.resolve())
    if options.begin:
        os.environ["BENCH_FROM"] = str(options.begin)
    if options.all:
        os.environ["BENCH_ALL"] = "1"
    if options.fit is not None:
        return fit(options)
    names = options.names or list(SUITES)
    options.out.mkdir(parents=True, exist_ok=True)
    install_peers()
    machine = describe_machine(options)
    print("%(cpu)s, %(cores)d cores, load %(load_before)s, commit %(commit)s" % machine)
    rounds, broken = {name: [] for name in names}, []
    for number in range(options.rounds):
        for name in names:
            print("round %d of %d: %s ..." % (number + 1, options.rounds, name), flush=True)
            found, is_whole = run_child(name, number, options)
            if not is_whole:
                broken.append(name)
            if found is not None:
                rounds[name].append(found)
    machine["load_after"] = "%.2f %.2f %.2f" % os.getloadavg()
    rows, samples = [], {}
    for name in names:
        more, distributions = put_together(name, rounds[name])
        rows += more
        samples.update({"%s: %s" % (name, title): entry for title, entry in distributions.items()})
    write(rows, samples, machine, options.out)
    print("\n".join(table(rows)))
    missed = [row for row in rows if row.met is False]
    print("%d figures, %d of %d goals kept; JSON and pictures in %s" % (
        len(rows), sum(row.met is True for row in rows), sum(row.met is not None for row in rows), options.out))
    if broken:
        print("failed: %s; see the lines above" % ", ".join(sorted(set(broken))))
    return 1 if missed or broken else 0


def fit(options):
    """Fit the actuators in this process."""
    from fidelity_bench import QUICK_S, RECORDING
    from fidelity_fit import ROUNDS, main
    main(os.environ.get("BENCH_RECORDING") or RECORDING, options.fit, *((1, QUICK_S) if options.quick else (ROUNDS,)))
    return 0


def child(options):
    """Measure one round of one suite in this process."""
    sys.path.append(str(PEERS))
    report = Report()
    try:
        import_module(SUITES[options.child][0]).measure(report, options.quick, options.number)
    finally:
        # What was measured before a failure is not lost.
        report.save(options.out)
    return 0


def run_child(name, number, options):
    """Return (results, is whole) of one round of a suite; one that failed has what it measured before that, or None.
    Its output is passed through."""
    saved = options.out / ("round_%s.json" % name)
    saved.unlink(missing_ok=True)
    command = [sys.executable, str(HERE / "run.py"), "--child", name, "--number", str(number), "--out", str(saved)]
    process = subprocess.Popen(command + ["--quick"] * options.quick, start_new_session=True)
    limit_s = LIMIT_OF_ALL_S if options.all else LIMIT_S
    try:
        process.wait(limit_s)
    except subprocess.TimeoutExpired:
        print("%s has not ended within %d s" % (name, limit_s))
    finally:
        # An interrupted suite leaves a lab behind; the process group is only the suite's.
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGTERM)
            process.wait()
    if not saved.exists():
        return None, False
    found = json.loads(saved.read_text())
    saved.unlink()
    return found, process.returncode == 0


def install_peers():
    """Install the packages of requirements.txt in a folder that only the bench uses; without a network they are left
    out."""
    wanted = (HERE / "requirements.txt").read_text()
    stamp = PEERS / "installed.txt"
    if stamp.exists() and stamp.read_text() == wanted:
        return
    done = subprocess.run([sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--upgrade", "--target",
                           str(PEERS), "-r", str(HERE / "requirements.txt")])
    if done.returncode:
        print("the peers could not be installed; the comparison with them is left out")
        return
    stamp.write_text(wanted)


def describe_machine(options):
    models = [line.split(":", 1)[1].strip() for line in Path("/proc/cpuinfo").read_text().splitlines()
              if line.startswith("model name")]
    commit = subprocess.run(["git", "-C", str(ROOT), "rev-parse", "--short", "HEAD"], capture_output=True, text=True)
    return {"cpu": models[0] if models else platform.machine(), "cores": len(os.sched_getaffinity(0)),
            "kernel": platform.release(), "python": platform.python_version(),
            "date": datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%d %H:%M UTC"),
            "commit": commit.stdout.strip() or "unknown", "rounds": options.rounds, "quick": options.quick,
            "load_before": "%.2f %.2f %.2f" % os.getloadavg()}


def write(rows, samples, machine, folder):
    (folder / "bench.json").write_text(as_json(rows, samples, machine) + "\n")
    note = "%(cpu)s, %(cores)d cores, %(date)s, commit %(commit)s, %(rounds)d rounds, load before %(load_before)s, " \
        "after %(load_after)s" % machine
    (folder / "bench.md").write_text("\n".join([note, "", *markdown(rows)]) + "\n")
    ratios(rows, folder / "ratios.png")
    for title, entry in samples.items():
        distribution(title, entry, folder / ("".join(c if c.isalnum() else "_" for c in title) + ".png"))


def end(*_):
    """End as after Ctrl-C, so that labs are taken down."""
    raise KeyboardInterrupt


if __name__ == "__main__":
    signal.signal(signal.SIGTERM, end)
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.exit(130)
