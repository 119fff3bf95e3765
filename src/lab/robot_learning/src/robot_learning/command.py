# SPDX-License-Identifier: BSD-3-Clause
"""Learn a task of gym_baxter from an expert's demonstrations and corrections, and measure how often it is done."""
from __future__ import annotations

import argparse
import datetime
import os
import platform
import secrets
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from command_line.options import MAX_SEED, MAX_WORKERS, Parser, did_you_mean, number
from demonstrations.collecting import Collected, CollectingWork, collect
from demonstrations.environment import PROFILES, Conditions
from demonstrations.experts import EXPERTS
from demonstrations.frames import DemonstrationError
from demonstrations.layout import INFO, write_json
from demonstrations.reading import DataSet
from lab_batch import JobError

from . import onnx_writing
from .corrections import correct
from .evaluation import Score, core_for, evaluate
from .pictures import choose, draw_curve, film
from .policy import PolicyError, load
from .training import LossCurve, TrainingSettings, contract_of, train

#: Seeds of demonstrations and of corrections begin here: those of the evaluation are below.
FIRST_DEMONSTRATION, FIRST_CORRECTION, MAX_CORRECTIONS = 100_000, 10_000_000, 100_000
DEMONSTRATIONS, ROUNDS, CORRECTIONS, EPISODES, NOISE = 100, 0, 50, 100, 1.0
POLICY, CURVE, FILM, SCORE, SET = "policy.npz", "curve.png", "episodes.mp4", "score.json", "demonstrations"
#: Hidden seeds of the judge lie between these; a policy passes with this share of its episodes.
HIDDEN, PASSING = (1_000_000_000, 2_000_000_000), 0.8
#: The policy that is corrected.
STUDENT = "student.npz"


def parse(argv: Sequence[str] | None) -> argparse.Namespace:
    """The command line's options."""
    parser = Parser(
        prog="./baxter.sh learn", description=__doc__,
        epilog="Without --data the expert shows the task first. Exit status: 0 done, 1 something is missing or broken, "
               "2 wrong options, 3 the judged policy has not passed, 130 after Ctrl-C. "
               "`python3 -m robot_learning` is the same without ROS.")
    parser.add_argument("task", metavar="TASK", nargs="?", help="one of %s" % ", ".join(EXPERTS))
    parser.add_argument("--evaluate", type=Path, metavar="POLICY", help="only measure this policy file, npz or ONNX")
    parser.add_argument("--judge", type=Path, metavar="POLICY",
                        help="the exercise: measure this policy file, of TASK where that is given, by seeds that "
                             "nobody knows beforehand; %d %%%% must succeed" % round(100 * PASSING))
    parser.add_argument("--out", type=Path, metavar="FOLDER",
                        help="of the results (default: .baxter/learned/TASK; TASK-robot, TASK-randomised for what is "
                             "learned with --profile robot, --randomised; TASK-evaluated for --evaluate and --judge)")
    parser.add_argument("--data", type=Path, metavar="FOLDER", help="learn from this LeRobot data set")
    parser.add_argument("--demonstrations", type=number(int, 1, 1_000_000), default=DEMONSTRATIONS, metavar="N",
                        help="of the expert (default %(default)s)")
    parser.add_argument("--rounds", type=number(int, 0, 100), default=ROUNDS, metavar="N",
                        help="of corrections: the policy acts, and the expert says what it would have done; not with "
                             "--data (default %(default)s)")
    parser.add_argument("--corrections", type=number(int, 1, MAX_CORRECTIONS), default=CORRECTIONS, metavar="N",
                        help="episodes of a round (default %(default)s)")
    parser.add_argument("--steps", type=number(int, 1, 10**8), default=TrainingSettings.steps, metavar="N",
                        help="of training (default %(default)s)")
    parser.add_argument("--chunk", type=number(int, 1, 1000), default=TrainingSettings.chunk, metavar="N",
                        help="actions that are predicted at once (default %(default)s)")
    parser.add_argument("--seed", type=number(int, 0, MAX_SEED), default=0, help="of the training's chance")
    parser.add_argument("--episodes", type=number(int, 0, FIRST_DEMONSTRATION), default=EPISODES, metavar="N",
                        help="of the evaluation, seeds 0 to N - 1 (default %(default)s; 0: none)")
    parser.add_argument("--workers", type=number(int, 1, MAX_WORKERS), default=os.cpu_count() or 1, metavar="N",
                        help="processes at a time (default: one for each processor, %(default)s)")
    parser.add_argument("--profile", choices=PROFILES, default=PROFILES[0],
                        help="of the robot, in the demonstrations that this run makes and in the evaluation: robot has "
                             "the physical one's lag and noise (default: %(default)s)")
    parser.add_argument("--randomised", action="store_true",
                        help="in these demonstrations and in the evaluation, things have other weights and frictions "
                             "in each episode")
    parser.add_argument("--no-film", action="store_true", help="do not film good and bad episodes")
    options = parser.parse_args(argv)
    if options.judge and (options.evaluate or options.episodes < EPISODES):
        parser.error("--judge plays %d episodes or more, and goes without --evaluate" % EPISODES)
    options.evaluate = options.judge or options.evaluate
    if options.evaluate and (options.data or not options.episodes):
        parser.error("--evaluate and --judge play some episodes, and learn nothing, so that --data has no effect")
    for path in (options.evaluate, options.data):
        if path is not None and not path.exists():
            parser.error("there is no %s" % path)
    if options.evaluate is None and options.task not in EXPERTS:
        parser.error("TASK is one of %s; found %s%s" % (
            ", ".join(EXPERTS), options.task or "none", did_you_mean(options.task or "", EXPERTS)))
    return options


def _say(text: str, end: bool = False) -> None:
    """Progress: one line on a terminal, and only its last state elsewhere."""
    if sys.stderr.isatty():
        print("\r\x1b[K" + text, end="\n" if end else "", file=sys.stderr, flush=True)
    elif end:
        print(text, file=sys.stderr, flush=True)


def _versions() -> dict[str, str]:
    return {"python": platform.python_version(), "numpy": np.__version__}


def _tried(source: Path, first: int, end: int) -> int:
    """How many seeds from `first`, below `end`, are behind a set: the greatest that it has, and all before."""
    seeds = DataSet(source).seeds if (source / INFO).exists() else []
    return max((seed + 1 - first for seed in seeds if seed is not None and first <= seed < end), default=0)


def _conditions(options: argparse.Namespace) -> Conditions:
    return Conditions.named(options.profile, options.randomised)


def _demonstrate(options: argparse.Namespace, source: Path) -> None:
    if (source / INFO).exists() and (found := Conditions.of(DataSet(source).schema.about)) != _conditions(options):
        raise DemonstrationError("%s has demonstrations with %s, not with %s; choose another --out" % (
            source, found, _conditions(options)))
    have = _tried(source, FIRST_DEMONSTRATION, FIRST_CORRECTION)
    if have < options.demonstrations:
        seeds = range(FIRST_DEMONSTRATION + have, FIRST_DEMONSTRATION + options.demonstrations)
        _told(collect(options.task, source, seeds, NOISE, CollectingWork(options.workers, _say),
                      conditions=_conditions(options)),
              "demonstrations", options.task)


def _told(found: Collected, what: str, task: str) -> None:
    _say("%d %s of %s: %d frames; the expert failed %d times" % (found.kept, what, task, found.frames, found.failed),
         True)


def _chosen(options: argparse.Namespace, data: DataSet) -> list[int]:
    """The episodes that are learned from: of --data all, else as many demonstrations and rounds as are asked for, of
    those that earlier runs have made."""
    if options.data is not None:
        return list(range(len(data)))
    ends = {FIRST_DEMONSTRATION: FIRST_DEMONSTRATION + options.demonstrations}
    ends |= {first: first + options.corrections for first in _rounds(options)}
    return [number for number, seed in enumerate(data.seeds)
            if seed is None or any(first <= seed < end for first, end in ends.items())]


def _rounds(options: argparse.Namespace) -> list[int]:
    """The first seed of each round of corrections."""
    return [FIRST_CORRECTION + round_ * MAX_CORRECTIONS for round_ in range(options.rounds)]


def _train(options: argparse.Namespace, source: Path, path: Path, steps: int) -> LossCurve:
    """Learn from the chosen episodes that are there, and write the policy."""
    data = DataSet(source)
    contract = contract_of(data, options.chunk)
    if options.task != contract.task:
        raise DemonstrationError("%s has demonstrations of %s, not of %s" % (source, contract.task, options.task))
    core_for(contract).close()  # what cannot be played is told before minutes of training
    chosen = _chosen(options, data)
    if len(chosen) < len(data):
        _say("learns from %d of the %d episodes in %s" % (len(chosen), len(data), source), True)
    settings = TrainingSettings(chunk=options.chunk, steps=steps, seed=options.seed)
    made = {"date": datetime.date.today().isoformat(), "demonstrations": len(chosen), "steps": settings.steps,
            "seed": settings.seed, "conditions": str(Conditions.of(data.schema.about)), "versions": _versions()}
    policy, curve = train(data, settings, made, lambda step, training, validation: _say(
        "step %d of %d: loss %.4f, %.4f of episodes that only judge" % (step, settings.steps, training, validation)),
        chosen)
    _say("%d steps in %.0f s: loss %.4f, %.4f of episodes that only judge" % (
        settings.steps, curve.seconds, curve.training[-1], curve.validation[-1]), True)
    policy.save(path)
    onnx_writing.save(policy, path.with_suffix(".onnx"))
    return curve


def learn(options: argparse.Namespace, folder: Path) -> Path:
    """Demonstrations, rounds of corrections, training, the curve; returns the policy's file. Demonstrations of an
    earlier run, and rounds that it began, are not done again. Raises DemonstrationError, JobError, OSError."""
    source, path = options.data or folder / SET, folder / POLICY
    if options.data is None:
        _demonstrate(options, source)
        for first in _rounds(options):
            if (have := _tried(source, first, first + MAX_CORRECTIONS)) < options.corrections:
                if not have or not (folder / STUDENT).exists():
                    _train(options, source, folder / STUDENT, max(options.steps // 2, 1))
                seeds = range(first + have, first + options.corrections)
                _told(correct(folder / STUDENT, source, seeds, options.workers, _say, _conditions(options)),
                      "corrections", options.task)
    curve, contract = _train(options, source, path, options.steps), load(path).contract
    draw_curve(curve, "%s: %d demonstrations" % (contract.task, contract.made["demonstrations"]), folder / CURVE)
    print("policy in %s, learning curve in %s" % (path, folder / CURVE))
    return path


def measure(options: argparse.Namespace, path: Path, folder: Path) -> Score:
    """Evaluation and film. Raises PolicyError, JobError, OSError."""
    low, high = HIDDEN
    first = low + secrets.randbelow(high - low) if options.judge else 0
    score = evaluate(path, range(first, first + options.episodes), options.workers, lambda done, good: _say(
        "%d of %d episodes, %d succeeded" % (done, options.episodes, good)), profile=options.profile,
        randomised=dict(_conditions(options).randomised))
    _say("", sys.stderr.isatty())
    print("%s: %s" % (load(path).contract.task, score))
    for seed, error in score.errors.items():
        print("seed %d did not run: %s" % (seed, error))
    (folder / FILM).unlink(missing_ok=True)  # of another score
    write_json(folder / SCORE, {"successes": score.successes, "count": score.count, "episodes": score.results})
    if chosen := ([] if options.no_film else choose(score)):
        policy = load(path)
        core = core_for(policy.contract, **_conditions(options).choices)
        try:
            film(core, policy, chosen, folder / FILM)
        finally:
            core.close()
        print("film of the seeds %s in %s" % (", ".join(map(str, chosen)), folder / FILM))
    return score


def run(options: argparse.Namespace) -> int:
    """The exit status. Raises DemonstrationError, PolicyError, JobError, OSError."""
    root = Path(os.environ.get("LAB_ROOT", Path.cwd()))
    name = options.task
    if options.evaluate:
        contract = load(options.evaluate).contract
        if options.task:
            contract.require(task=options.task)
        name = contract.task
    name += "-robot" * (options.profile == "robot") + "-randomised" * options.randomised
    name += "-evaluated" * bool(options.evaluate)
    folder = options.out or root / ".baxter" / "learned" / name
    folder.mkdir(parents=True, exist_ok=True)
    path = options.evaluate or learn(options, folder)
    score = measure(options, path, folder) if options.episodes else None
    return judged(score) if options.judge and score else 0


def judged(score: Score) -> int:
    """Print the exercise's points; returns the exit status."""
    passed = score.successes >= PASSING * score.count
    print("%s: %d of 100 points (%d are due)" % (
        "passed" if passed else "not passed", 100 * score.successes // score.count, round(100 * PASSING)))
    return 0 if passed else 3


def main(argv: Sequence[str] | None = None) -> int:
    """The program."""
    options = parse(argv)
    try:
        return run(options)
    except (DemonstrationError, PolicyError, JobError, OSError) as error:
        _say("", sys.stderr.isatty())
        print("learn: %s" % error, file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("learn: stopped; demonstrations that were complete are kept, and the same command goes on with them",
              file=sys.stderr)
        return 130


