#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Bring world files up, one after the other and without a master, and write what became of each.

    ./baxter.sh sim python3 tests/worlds/run.py --models GAZEBO/models --out worlds.csv GAZEBO/worlds GAZEBO/test/worlds

Each world is in a separate process, with its models and plugins, for some seconds of simulated time. A world that
includes a model that is in none of the folders is left out. Columns: ``world``; ``models``; ``comes up`` (yes, or what
is wrong); ``Gazebo's values``: how far those of ``checks.py`` are met; ``without an effect``: elements and plugins that
the simulator names; ``notes``.
"""
import argparse
import csv
import json
import os
import re
import subprocess
import sys
import time
from pathlib import Path

from checks import CHECKS, outcome

_COLUMNS = ("world", "models", "comes up", "Gazebo's values", "without an effect", "notes")
_DEADLINE_S = 120.0  # of one world, by the wall
_INCLUDED = re.compile(r"<uri>\s*(?:model|https?)://([^<\s]+?)/?\s*</uri>")
_FAST = 40.0  # m/s: more than a body has after a fall of some seconds
_DEEP = -5.0  # m below the floor


def bring_up(path, model_folders, seconds):
    """Return the row of a world as a dictionary. Runs in the process of that world."""
    import rospkg

    from bullet_sim import World
    from gazebo_ros.plugin_table import PluginTable
    from gazebo_ros.simulation import Simulation
    from gazebo_ros.spawning import Spawner, SpawnLookups
    from gazebo_ros.world_file import read_world
    from loop_ros.request_queue import RequestQueue
    from loop_ros.testing import FakeFaults, FakeLog, FakeRos
    from model_files.resources import ResourceFinder, plugin_tables
    from sdf_model import ModelFolders

    packages, log, faults = rospkg.RosPack(), FakeLog(), FakeFaults()
    folders = ModelFolders(model_folders)
    read = read_world(path, folders)
    config = Path(packages.get_path("gazebo_ros")) / "config" / "model_plugins.yaml"
    table = PluginTable.from_yaml(config, None, plugin_tables(packages), log.warn)
    finder = ResourceFinder(packages)
    world = World(time_step_s=read.time_step_s, gravity=read.gravity, find_mesh=finder, warn=log.warn, error=log.error)
    simulation = Simulation(world, RequestQueue(), log, faults)
    spawner = Spawner(simulation, SpawnLookups(table, finder, folders), FakeRos(), log, lambda: None)
    spawner.spawn_world(read.models)
    check = CHECKS.get(path.name)
    seconds = seconds if check is None else check.seconds
    begin = time.perf_counter()
    steps = round(seconds / world.time_step_s)
    for done in range(steps):
        simulation.do_tick()
        if time.perf_counter() - begin > _DEADLINE_S / 2:
            steps = done + 1
            break
    faulty = [*read.problems, *log.of("error"), *(() if check else _astray(world))]
    said = "; ".join(filter(None, (read.warning, *log.of("warn"))))
    return {"models": len(world.models), "comes up": "; ".join(faulty) or "yes", "without an effect": summary(said),
            "Gazebo's values": outcome(path.name, world),
            "notes": "%g of %g s" % (steps * world.time_step_s, seconds) if steps * world.time_step_s < seconds else ""}


def summary(said):
    """The names in the simulator's warnings: elements and plugins without an effect, the number of missing meshes."""
    said = re.sub(r"known plugins: .*?(?=; model|$)", "", said)
    said = re.sub(r"not as SDF has it, but read: .*?(?=; (?:without an effect here|not known and left out|model)|$)",
                  "", said)
    elements = dict.fromkeys(re.findall(r"([A-Za-z_@]\w*) \([^()]*?line [^()]*\)", said))
    plugins = dict.fromkeys(re.findall(r"'(lib[\w.]+)'", said))
    meshes = set(re.findall(r"mesh (\S+) cannot be found", said))
    parts = (("elements", elements), ("plugins", plugins))
    return "; ".join([*("%s: %s" % (what, ", ".join(names)) for what, names in parts if names),
                      *(["%d meshes missing" % len(meshes)] if meshes else [])])


def _astray(world):
    """Models that fall for ever on a world with a floor, or are faster than anything there falls."""
    has_floor = any(model.static for model in world.models.values())
    for name, model in world.models.items():
        position, speed = model.model_pose().position, model.model_twist()[0]
        touches = any(link.collisions for link in model.merged.links.values())
        if has_floor and touches and not model.static and position[2] < _DEEP:
            yield "%s is at z = %.0f m" % (name, position[2])
        elif sum(value * value for value in speed) > _FAST ** 2:
            yield "%s moves at %.0f m/s" % (name, sum(value * value for value in speed) ** 0.5)


def worlds_of(places):
    """[(name, path)] of the world files in folders and below them, or given as files."""
    for place in map(Path, places):
        if place.is_file():
            yield place.name, place
        for path in sorted(place.rglob("*.world")) if place.is_dir() else ():
            if "deprecated" in str(path.relative_to(place)):
                continue  # of the time before SDF, which Gazebo does not read either
            yield str(path.relative_to(place.parent.parent if place.parent.name == "test" else place.parent)), path


def missing_models(path, folders):
    """Names of the included models of a world file that are in none of the folders."""
    names = dict.fromkeys(_INCLUDED.findall(path.read_text(encoding="utf-8", errors="replace")))
    return [name for name in names if not any((Path(folder) / name).exists() for folder in folders)]


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("places", nargs="+", metavar="FOLDER_OR_FILE")
    parser.add_argument("--models", nargs="*", default=[], metavar="FOLDER", help="folders of models")
    parser.add_argument("--seconds", type=float, default=2.0, help="simulated time of each world (%(default)s)")
    parser.add_argument("--out", metavar="FILE", help="a CSV file for the rows")
    parser.add_argument("--one", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    import rospkg

    from model_files.resources import model_folders
    os.environ["GAZEBO_MODEL_PATH"] = ":".join(filter(None, (*options.models, os.environ.get("GAZEBO_MODEL_PATH"))))
    folders = [str(folder) for folder in model_folders(rospkg.RosPack())]
    if options.one:
        print("row:" + json.dumps(bring_up(Path(options.places[0]), folders, options.seconds)))
        sys.stdout.flush()
        os._exit(0)
    rows = []
    for name, path in worlds_of(options.places):
        missing = missing_models(path, folders)
        if missing:
            continue
        row = {"world": name, **_in_a_process(path, options)}
        rows.append(row)
        print("%-60s %s %s" % (name, row["comes up"][:200], row["Gazebo's values"]), flush=True)
    if options.out:
        with open(options.out, "w", encoding="utf-8", newline="") as file:
            writer = csv.DictWriter(file, _COLUMNS, lineterminator="\n")
            writer.writeheader()
            writer.writerows(rows)
    good = sum(row["comes up"] == "yes" and not row["Gazebo's values"].startswith("OFF") for row in rows)
    print("%d worlds, %d come up" % (len(rows), good))
    return 0 if good == len(rows) else 1


def _in_a_process(path, options):
    command = [sys.executable, __file__, "--one", "--seconds", str(options.seconds), "--models", *options.models, "--",
               str(path)]
    failed = dict.fromkeys(_COLUMNS[1:], "")
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=_DEADLINE_S, check=False)
    except subprocess.TimeoutExpired:
        return {**failed, "comes up": "not within %g s" % _DEADLINE_S}
    _, found, row = done.stdout.partition("row:")  # PyBullet prints, too, and ends no line
    if found:
        return json.loads(row.splitlines()[0])
    lines = done.stderr.strip().splitlines() or ["exit code %d" % done.returncode]
    return {**failed, "comes up": lines[-1]}


if __name__ == "__main__":
    sys.exit(main())
