# SPDX-License-Identifier: BSD-3-Clause
"""The files of a LeRobot data set, format v3.0: their names, and the one that describes it, meta/info.json.

Beside the format's files there are two: meta/baxter.json, with units and with what `Schema.about` says, and
meta/baxter_episodes.jsonl, with seed, success and frames of each episode.
"""
from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

from .films import CODEC, PIXELS
from .frames import DemonstrationError, Feature, Schema

VERSION = "v3.0"
INFO, STATISTICS, TASKS = "meta/info.json", "meta/stats.json", "meta/tasks.parquet"
EPISODES = "meta/episodes/chunk-%03d/file-%03d.parquet"
DATA = "data/chunk-%03d/file-%03d.parquet"
FILM = "videos/%s/chunk-%03d/file-%03d.mp4"
ABOUT, OUTCOMES = "meta/baxter.json", "meta/baxter_episodes.jsonl"
#: Where unfinished films are.
DRAFTS = ".recording"
PART = ".part"
FILES_OF_A_CHUNK = 1000
DATA_MB, FILMS_MB = 100, 200
#: {key: dtype} of what every set has beside its features.
INDICES = {"timestamp": "float32", "frame_index": "int64", "episode_index": "int64", "index": "int64",
           "task_index": "int64"}


def numbered(count: int) -> tuple[int, int]:
    """(chunk, file) of the file with this number."""
    return divmod(count, FILES_OF_A_CHUNK)


def write_whole(path: Path, write: Callable[[Path], Any]) -> None:
    """Write a file under another name and rename it: it is there as a whole, or as it was before. Raises OSError."""
    path.parent.mkdir(parents=True, exist_ok=True)
    draft = path.with_name(path.name + PART)
    try:
        write(draft)
        with open(draft, "rb") as file:
            os.fsync(file.fileno())
        draft.replace(path)
    except BaseException:
        draft.unlink(missing_ok=True)
        raise


def write_json(path: Path, value: Any) -> None:
    """Write JSON as a whole. Raises OSError."""
    write_whole(path, lambda draft: draft.write_text(json.dumps(value, indent=4), encoding="utf-8"))


def read_json(path: Path) -> Any:
    """Raises DemonstrationError, which names the file."""
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise DemonstrationError("there is no %s: not a LeRobot data set, or its recording never had an episode"
                                 % path) from None
    except (OSError, ValueError) as error:
        raise DemonstrationError("%s cannot be read: %s" % (path, error)) from error


def info_of(schema: Schema, episodes: int, frames: int, tasks: int) -> dict[str, Any]:
    """meta/info.json."""
    features = {key: _described(feature, schema.rate_hz) for key, feature in schema.features.items()}
    features.update({key: {"dtype": dtype, "shape": [1], "names": None} for key, dtype in INDICES.items()})
    return {
        "codebase_version": VERSION, "fps": schema.rate_hz, "features": features, "total_episodes": episodes,
        "total_frames": frames, "total_tasks": tasks, "chunks_size": FILES_OF_A_CHUNK, "data_files_size_in_mb": DATA_MB,
        "video_files_size_in_mb": FILMS_MB,
        "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
        "video_path":
            "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4" if schema.cameras else None,
        "robot_type": schema.robot, "splits": {"train": "0:%d" % episodes}}


def _described(feature, rate_hz):
    found = {"dtype": feature.dtype, "shape": list(feature.shape),
             "names": None if feature.names is None else list(feature.names)}
    if feature.is_picture:
        height, width, _ = feature.shape
        found["info"] = {"video.height": height, "video.width": width, "video.codec": CODEC, "video.pix_fmt": PIXELS,
                         "video.fps": rate_hz, "video.channels": 3, "has_audio": False, "is_depth_map": False}
    return found


def about_of(schema: Schema) -> dict[str, Any]:
    """meta/baxter.json."""
    units = {key: list(feature.units) for key, feature in schema.features.items() if feature.units is not None}
    return {"about": dict(schema.about), "units": units}


def schema_of(folder: Path) -> tuple[Schema, dict[str, Any]]:
    """A set's schema and its meta/info.json. Raises DemonstrationError for other versions and unknown contents."""
    info = read_json(folder / INFO)
    own = read_json(folder / ABOUT) if (folder / ABOUT).is_file() else {}
    try:
        if info["codebase_version"] != VERSION:
            raise DemonstrationError("%s has format %s; this reads %s. lerobot itself upgrades older sets"
                                     % (folder, info["codebase_version"], VERSION))
        units = own.get("units", {})
        features = {key: Feature(value["dtype"], tuple(value["shape"]), _texts(value.get("names")),
                                 _texts(units.get(key)))
                    for key, value in info["features"].items() if key not in INDICES}
        rate_hz, robot = info["fps"], info.get("robot_type") or ""
        if _is_whole(rate_hz):
            rate_hz = int(rate_hz)
        try:
            schema = Schema(rate_hz, features, robot, own.get("about", {}))
        except DemonstrationError as error:
            raise DemonstrationError("%s: %s" % (folder / INFO, error)) from None
        for name in ("total_episodes", "total_frames"):
            if not is_count(info[name]):
                raise DemonstrationError("%s: %s is %r, no count" % (folder / INFO, name, info[name]))
    except (KeyError, TypeError, AttributeError) as error:
        raise DemonstrationError("%s is not as in format %s: %s %s" % (
            folder / INFO, VERSION, type(error).__name__, error)) from error
    return schema, info


def _is_whole(value: Any) -> bool:
    return isinstance(value, float) and value.is_integer()


def is_count(value: Any) -> bool:
    """Whether it is a whole number from 0."""
    return isinstance(value, int) and not isinstance(value, bool) and value >= 0


def outcomes_of(folder: Path) -> dict[int, dict[str, Any]]:
    """{episode: its line} of what was told of each: episode, seed, success, frames. Lines that are cut off have none,
    nor have seeds and frames that are no counts."""
    path, found = folder / OUTCOMES, {}
    for line in path.read_text(encoding="utf-8", errors="replace").splitlines() if path.is_file() else ():
        try:
            outcome = json.loads(line)
            found[outcome["episode"]] = {key: value for key, value in outcome.items()
                                         if key not in ("seed", "frames") or is_count(value)}
        except (ValueError, KeyError, TypeError, AttributeError):
            continue
    return found


def _texts(names):
    """Names as a tuple, or None; LeRobot also has dictionaries of them."""
    if isinstance(names, dict):
        names = next(iter(names.values()), None)
    return None if names is None else tuple(map(str, names))
