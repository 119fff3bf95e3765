# SPDX-License-Identifier: BSD-3-Clause
"""Writes LeRobot data sets, format v3.0, by pyarrow and PyAV alone.

Each episode has files of its own, and meta/info.json is replaced last, so an episode is in the set as a whole or not at
all, whatever ends the program.
"""
from __future__ import annotations

import fcntl
import json
import os
import shutil
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from . import layout
from .films import Film
from .frames import CONDITIONS, DemonstrationError, Episode, Feature, Schema
from .needed import need
from .statistics import NAMES, PictureStatistics, Statistics, as_lists, from_lists, joined, of_numbers


class SetWriter:
    """Appends episodes to the set in `folder`, which is made, or continued if it has the same schema.

    `frame` takes one frame after the other; `keep` ends the episode and writes it, `drop` forgets it. Raises
    DemonstrationError for a folder with something else, for other features, and where another writer is at work there.
    Attribute `episodes`: how many it has.
    """

    def __init__(self, folder: Path, schema: Schema):
        self.folder, self.schema = folder, schema
        self.episodes = self._frames = 0
        self._tasks: list[str] = []
        self._statistics: dict[str, Statistics] = {}
        self._lock: int | None = _locked(folder)
        try:
            if (folder / layout.INFO).exists():
                self._continue()
            else:
                _require_empty(folder)
            need("pyarrow")
            if schema.cameras:
                need("av")
        except Exception:
            self._unlock()
            raise
        self._drafts = folder / layout.DRAFTS
        shutil.rmtree(self._drafts, ignore_errors=True)
        self._rows: dict[str, list[np.ndarray]] = {}
        self._films: dict[str, Any] = {}  # each a Film, or as one
        self._pictures: dict[str, Any] = {}
        self._begin()

    def _unlock(self):
        lock, self._lock = self._lock, None
        if lock is not None:
            os.close(lock)

    def _continue(self):
        found, info = layout.schema_of(self.folder)
        if not info["total_episodes"]:
            return  # nothing that new frames must fit
        if found.rate_hz != self.schema.rate_hz or dict(found.features) != dict(self.schema.features):
            raise DemonstrationError("%s has other frames: %d Hz, %s; new ones have %d Hz, %s" % (
                self.folder, found.rate_hz, _listed(found.features), self.schema.rate_hz,
                _listed(self.schema.features)))
        if found.about.get("task") != self.schema.about.get("task"):
            raise DemonstrationError("%s is of the task %s; new episodes are of %s" % (
                self.folder, found.about.get("task"), self.schema.about.get("task")))
        differs = [key for key in CONDITIONS if found.about.get(key) != self.schema.about.get(key)]
        if differs:
            raise DemonstrationError("%s was recorded in other conditions: %s; record into another folder" % (
                self.folder, ", ".join("%s is %s, that of new episodes is %s" % (
                    key, found.about.get(key, "the usual one"), self.schema.about.get(key, "the usual one"))
                    for key in differs)))
        from .reading import read_tasks, statistics_of

        self.episodes, self._frames = info["total_episodes"], info["total_frames"]
        try:
            self._tasks = read_tasks(self.folder)
        except DemonstrationError as error:
            raise DemonstrationError("%s; `demonstrations repair` copies its whole episodes into a new set, which can "
                                     "be continued" % error) from error
        self._statistics = self._known_statistics()
        counts = {int(part["count"][0]) for key, part in self._statistics.items() if key not in self.schema.cameras}
        if counts != {self._frames}:  # a recorder was ended between this file and the one that counts the episodes
            self._statistics = statistics_of(self.folder, self.episodes) or self._statistics

    def _known_statistics(self):
        """Those of meta/stats.json, none where it is broken."""
        try:
            found = from_lists(layout.read_json(self.folder / layout.STATISTICS))
            return found if all(np.size(part[name]) for part in found.values() for name in NAMES) else {}
        except (DemonstrationError, KeyError, TypeError, ValueError, AttributeError):
            return {}

    def _begin(self):
        self._rows = {key: [] for key, feature in self.schema.features.items() if not feature.is_picture}
        self._films, self._pictures = {}, {key: PictureStatistics() for key in self.schema.cameras}

    @property
    def length(self) -> int:
        """Frames of the present episode."""
        return len(next(iter(self._rows.values())))

    def frame(self, frame: Mapping[str, Any]) -> None:
        """Append a frame to the present episode. Raises DemonstrationError; OSError where a film cannot be written."""
        checked = self.schema.checked(frame)
        for key in self.schema.cameras:
            if key not in self._films:
                self._drafts.mkdir(parents=True, exist_ok=True)
                height, width, _ = self.schema.features[key].shape
                self._films[key] = Film(self._drafts / ("%s.mp4" % key), self.schema.rate_hz, (height, width))
            self._films[key].add(checked[key])
            self._pictures[key].add(checked[key])
        for key, rows in self._rows.items():
            rows.append(checked[key])

    def drop(self) -> None:
        """Forget the present episode."""
        for film in self._films.values():
            film.drop()
        self._begin()

    def keep(self, task: str, success: bool, seed: int | None = None) -> int:
        """Write the present episode; returns its number. Raises DemonstrationError for one without frames or without a
        task, and where the disk refuses it: the set is then as it was before."""
        if not self.length or not task.strip():
            raise DemonstrationError("an episode needs a frame and a task in words; found %d frames, %r"
                                     % (self.length, task))
        columns = {key: np.stack(rows) for key, rows in self._rows.items()}
        try:
            number = self._write(columns, task, success, seed)
        except OSError as error:
            self._remove_files(layout.numbered(self.episodes))  # a full disk needs the room
            self.drop()
            raise DemonstrationError("episode %d of %s is not kept, the %d before are: %s" % (
                self.episodes, self.folder, self.episodes, error)) from error
        self._begin()
        return number

    def add(self, episode: Episode) -> int:
        """Write an episode without pictures; returns its number. Raises DemonstrationError."""
        for row in range(len(episode)):
            self.frame({key: values[row] for key, values in episode.columns.items()})
        return self.keep(episode.task, episode.success, episode.seed)

    def adopt(self, episode: Episode, films: Mapping[str, Path], statistics: Mapping[str, Statistics]) -> int:
        """Write an episode whose films, {camera: file}, are there with these statistics; a film gets a second name, or
        is copied to another disk. Returns the episode's number. Raises DemonstrationError, OSError."""
        self._rows = {key: list(values) for key, values in episode.columns.items()}
        self._drafts.mkdir(parents=True, exist_ok=True)
        for camera, path in films.items():
            draft = self._drafts / ("%s.mp4" % camera)
            draft.unlink(missing_ok=True)
            try:
                os.link(path, draft)
            except OSError:
                shutil.copyfile(path, draft)
            self._films[camera] = _Whole(draft)
            self._pictures[camera] = _Known(statistics[camera])
        return self.keep(episode.task, episode.success, episode.seed)

    def close(self) -> None:
        """Forget an episode that was not kept."""
        self.drop()
        shutil.rmtree(self._drafts, ignore_errors=True)
        self._unlock()

    def __enter__(self) -> SetWriter:
        return self

    def __exit__(self, *_) -> None:
        self.close()

    # -- files

    def _write(self, columns, task, success, seed):
        number, length = self.episodes, self.length
        place = layout.numbered(number)
        tasks = self._tasks if task in self._tasks else [*self._tasks, task]
        columns |= {"timestamp": (np.arange(length) / self.schema.rate_hz).astype("float32"),
                    "frame_index": np.arange(length), "episode_index": np.full(length, number),
                    "index": self._frames + np.arange(length), "task_index": np.full(length, tasks.index(task))}
        statistics = {key: of_numbers(values.reshape(length, -1)) for key, values in columns.items()}
        statistics |= {key: pictures.result() for key, pictures in self._pictures.items()}
        if not number:  # from now on the folder is a set, without episodes until this one is complete
            layout.write_json(self.folder / layout.ABOUT, layout.about_of(self.schema))
            layout.write_json(self.folder / layout.INFO, layout.info_of(self.schema, 0, 0, 0))
        self._move_films(place)
        layout.write_whole(self.folder / (layout.DATA % place), lambda draft: _write_data(draft, self.schema, columns))
        layout.write_whole(self.folder / (layout.EPISODES % place),
                           lambda draft: _write_table(draft, self._episode_row(place, task, length, statistics)))
        if tasks != self._tasks or not number:
            layout.write_whole(self.folder / layout.TASKS, lambda draft: _write_tasks(draft, tasks))
        if not (self.folder / layout.ABOUT).exists():
            layout.write_json(self.folder / layout.ABOUT, layout.about_of(self.schema))
        self._tell_outcome({"episode": number, "seed": seed, "success": bool(success), "frames": length})
        total = {key: joined([self._statistics[key], part]) if key in self._statistics else part
                 for key, part in statistics.items()}
        layout.write_json(self.folder / layout.STATISTICS, as_lists(total))
        layout.write_json(self.folder / layout.INFO,
                          layout.info_of(self.schema, number + 1, self._frames + length, len(tasks)))
        self._statistics, self._tasks = total, tasks
        self.episodes, self._frames = number + 1, self._frames + length
        return number

    def _move_films(self, place):
        for key, film in self._films.items():
            film.close()
            path = self.folder / (layout.FILM % (key, *place))
            path.parent.mkdir(parents=True, exist_ok=True)
            with open(film.path, "rb") as file:
                os.fsync(file.fileno())
            film.path.replace(path)

    def _remove_files(self, place):
        for name in (layout.DATA % place, layout.EPISODES % place,
                     *(layout.FILM % (key, *place) for key in self.schema.cameras)):
            with suppress(OSError):
                (self.folder / name).unlink()

    def _tell_outcome(self, outcome):
        path = self.folder / layout.OUTCOMES
        lines = path.read_bytes().splitlines() if path.exists() else []
        kept = b"".join(line + b"\n" for line in lines[:self.episodes])
        if len(lines) > self.episodes or (path.exists() and len(kept) != path.stat().st_size):
            layout.write_whole(path, lambda draft: draft.write_bytes(kept))  # of an episode that was not kept
        with open(path, "ab") as file:
            file.write(json.dumps(outcome).encode() + b"\n")

    def _episode_row(self, place, task, length, statistics):
        chunk, file = place
        row = {"episode_index": self.episodes, "tasks": [task], "length": length, "data/chunk_index": chunk,
               "data/file_index": file, "dataset_from_index": self._frames, "dataset_to_index": self._frames + length}
        for key in self.schema.cameras:
            row |= {"videos/%s/chunk_index" % key: chunk, "videos/%s/file_index" % key: file,
                    "videos/%s/from_timestamp" % key: 0.0,
                    "videos/%s/to_timestamp" % key: length / self.schema.rate_hz}
        for key, part in as_lists(statistics).items():
            row |= {"stats/%s/%s" % (key, name): value for name, value in part.items()}
        return row | {"meta/episodes/chunk_index": chunk, "meta/episodes/file_index": file}


class _Whole(NamedTuple):
    """A film that was written before; as `Film`."""

    path: Path

    def close(self) -> None:
        """Nothing to finish."""

    def drop(self) -> None:
        """Give the file up."""
        self.path.unlink(missing_ok=True)


class _Known(NamedTuple):
    """Statistics of pictures that were counted before; as `PictureStatistics`."""

    known: Statistics

    def result(self) -> Statistics:
        """Of all pictures."""
        return self.known


def _locked(folder: Path) -> int:
    """A descriptor that holds the folder for this writer alone, until it is closed or its process ends."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        lock = os.open(folder, os.O_RDONLY)
    except OSError as error:
        raise DemonstrationError("%s cannot be made: %s" % (folder, error)) from error
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(lock)
        raise DemonstrationError("another program is recording into %s; wait for its end, or give another folder"
                                 % folder) from None
    return lock


def _require_empty(folder):
    """A set whose first episode was not completed counts as none."""
    if not any(path.name != layout.DRAFTS for path in folder.iterdir()):
        return
    if not (folder / "meta").is_dir() or any((folder / "meta").rglob("episodes/*/*.parquet")):
        raise DemonstrationError("%s holds something else than a LeRobot data set; give an empty or new folder"
                                 % folder)


def _listed(features: Mapping[str, Feature]) -> str:
    return ", ".join("%s %s%s" % (key, feature.dtype, list(feature.shape)) for key, feature in features.items())


def _write_data(path, schema, columns):
    arrow, parquet = need("pyarrow"), need("pyarrow", "parquet")
    arrays = {}
    for key, values in columns.items():
        flat = arrow.array(np.ascontiguousarray(values).reshape(-1))
        width = values.shape[1] if values.ndim == 2 else 1
        arrays[key] = flat if width == 1 else arrow.FixedSizeListArray.from_arrays(flat, width)
    order = [key for key in (*schema.features, *layout.INDICES) if key in arrays]
    # One row group: readers take an episode by it.
    parquet.write_table(arrow.table({key: arrays[key] for key in order}), path, compression="snappy",
                        row_group_size=len(columns["index"]))


def _write_table(path, row):
    arrow, parquet = need("pyarrow"), need("pyarrow", "parquet")
    parquet.write_table(arrow.table({key: [value] for key, value in row.items()}), path)


def _write_tasks(path, tasks):
    """With pandas' own description of the index, without which readers take row numbers for tasks."""
    arrow, parquet = need("pyarrow"), need("pyarrow", "parquet")
    columns = [{"name": name, "field_name": name, "pandas_type": kind, "numpy_type": numpy, "metadata": None}
               for name, kind, numpy in (("task_index", "int64", "int64"), ("task", "unicode", "object"))]
    pandas = {"index_columns": ["task"], "columns": columns, "pandas_version": "2.2.0", "creator": {},
              "column_indexes": [{"name": None, "field_name": None, "pandas_type": "unicode", "numpy_type": "object",
                                  "metadata": {"encoding": "UTF-8"}}]}
    table = arrow.table({"task_index": arrow.array(range(len(tasks)), arrow.int64()), "task": tasks})
    parquet.write_table(table.replace_schema_metadata({"pandas": json.dumps(pandas)}), path)
