# SPDX-License-Identifier: BSD-3-Clause
"""Reads LeRobot data sets, format v3.0, and finds what is broken in them. By pyarrow and PyAV."""
from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from . import layout
from .films import frame_count, frames_of
from .frames import DemonstrationError, Episode
from .needed import need
from .statistics import NAMES, Statistics, from_lists, joined


def _read_table(path: Path, columns: list[str] | None = None) -> Any:
    parquet = need("pyarrow", "parquet")
    try:
        return parquet.ParquetFile(path).read(columns=columns)
    except FileNotFoundError:
        raise DemonstrationError("%s is missing" % path) from None
    except (OSError, ValueError) as error:  # pyarrow's own errors derive from these
        raise DemonstrationError("%s cannot be read: %s" % (path, error)) from error


def read_tasks(folder: Path) -> list[str]:
    """The tasks in the order of their index. Raises DemonstrationError."""
    table = _read_table(folder / layout.TASKS)
    try:
        rows = sorted(zip(table["task_index"].to_pylist(), table["task"].to_pylist(), strict=True))
    except (KeyError, TypeError) as error:
        raise DemonstrationError("%s is not as in the format: %s" % (folder / layout.TASKS, error)) from None
    if not all(isinstance(task, str) for _, task in rows):
        raise DemonstrationError("%s has a task that is no text" % (folder / layout.TASKS))
    return [task for _, task in rows]


def statistics_of(folder: Path, episodes: int) -> dict[str, Statistics] | None:
    """{key: of all frames} of the first episodes, joined from what is said of each; None where an episode's cannot be
    read."""
    found: dict[str, Statistics] = {}
    count = 0
    for path in sorted((folder / "meta/episodes").glob("chunk-*/file-*.parquet")):
        try:
            rows = _read_table(path).to_pylist()
        except DemonstrationError:
            return None
        for row in rows[:episodes - count]:
            count += 1
            said: dict[str, dict[str, Any]] = {}
            for column, value in row.items():
                if column.startswith("stats/"):
                    key, name = column[len("stats/"):].rsplit("/", 1)
                    said.setdefault(key, {})[name] = value
            for key, part in from_lists(said).items():
                if not set(NAMES) <= set(part):
                    return None
                found[key] = joined([found[key], part]) if key in found else part
    return found if count == episodes else None


class DataSet:
    """A set in a folder. Attributes: `folder`, `schema`, `tasks`, and `faults`: what is wrong with files that say of
    the episodes where they are and what they show. len() is the number of its episodes. Raises DemonstrationError,
    which names the file, also from its methods."""

    _NEEDED = ("episode_index", "tasks", "length", "data/chunk_index", "data/file_index", "dataset_from_index")

    def __init__(self, folder: Path):
        self.folder = Path(folder)
        self.schema, self._info = layout.schema_of(self.folder)
        self.faults: list[str] = []
        self._rows = self._episode_rows()
        self.tasks = self._read_tasks()
        self._outcomes = layout.outcomes_of(self.folder)
        self._data: tuple[tuple[int, int], Any] | None = None

    def __len__(self) -> int:
        return int(self._info["total_episodes"])

    @property
    def seeds(self) -> list[int | None]:
        """The seed that each episode began by."""
        return [self._outcomes.get(number, {}).get("seed") for number in range(len(self))]

    def _read_tasks(self):
        """Without their file: as the episodes say."""
        try:
            return read_tasks(self.folder) if len(self) else []
        except DemonstrationError as error:
            self.faults.append(str(error))
            return list(dict.fromkeys(row["tasks"][0] for row in self._rows.values()))

    def _episode_rows(self):
        rows: dict[int, dict[str, Any]] = {}
        for path in sorted((self.folder / "meta/episodes").glob("chunk-*/file-*.parquet")):
            if len(rows) >= len(self):
                break
            try:
                table = _read_table(path)
                names = [name for name in table.column_names if not name.startswith("stats/")]
                if missing := [name for name in self._NEEDED if name not in names]:
                    raise DemonstrationError("%s has no column %s" % (path, ", ".join(missing)))
                for row in table.select(names).to_pylist():
                    _require_row(path, row)
                    rows[row["episode_index"]] = row
            except DemonstrationError as error:
                self.faults.append(str(error))
        return rows

    def _row(self, number):
        if not 0 <= number < len(self):
            raise DemonstrationError("%s has the episodes 0 to %d, not %d" % (self.folder, len(self) - 1, number))
        if number not in self._rows:
            raise DemonstrationError("%s: no readable file in meta/episodes has episode %d%s" % (
                self.folder, number, "".join("; " + fault for fault in self.faults)))
        return self._rows[number]

    def length(self, number: int) -> int:
        """Frames of an episode."""
        return int(self._row(number)["length"])

    def episode(self, number: int) -> Episode:
        """The numbers of an episode."""
        row = self._row(number)
        place = row["data/chunk_index"], row["data/file_index"]
        path = self.folder / (layout.DATA % place)
        if self._data is None or self._data[0] != place:
            self._data = place, _read_table(path)
        table = self._data[1]
        try:
            mine = np.flatnonzero(table["episode_index"].to_numpy() == number)
            if len(mine) != row["length"]:
                raise DemonstrationError("%s has %d frames of episode %d, which has %d" % (
                    path, len(mine), number, row["length"]))
            if len(mine) and mine[-1] - mine[0] != len(mine) - 1:
                raise DemonstrationError("%s has other frames among those of episode %d" % (path, number))
            part = table.slice(mine[0] if len(mine) else 0, len(mine))
            columns = {key: _column(part[key], feature) for key, feature in self.schema.features.items()
                       if not feature.is_picture}
        except (KeyError, ValueError) as error:
            raise DemonstrationError("%s is not as in its description: %s" % (path, error)) from error
        outcome = self._outcomes.get(number, {})
        return Episode(row["tasks"][0], columns, bool(outcome.get("success", True)), outcome.get("seed"))

    def pictures(self, number: int, camera: str) -> Iterator[np.ndarray]:
        """The pictures of an episode, (height, width, 3) uint8. camera: key of the feature."""
        row, path = self._row(number), self._film(number, camera)
        first = round(row.get("videos/%s/from_timestamp" % camera, 0.0) * self.schema.rate_hz)
        for index, pixels in enumerate(frames_of(path)):
            if first <= index < first + row["length"]:
                yield pixels

    def _film(self, number, camera):
        row = self._row(number)
        try:
            return self.folder / (layout.FILM % (camera, row["videos/%s/chunk_index" % camera],
                                                 row["videos/%s/file_index" % camera]))
        except KeyError as error:
            raise DemonstrationError("%s has no film of %s: no column %s" % (self.folder, camera, error)) from None

    def films(self, number: int) -> tuple[dict[str, Path], dict[str, Statistics]]:
        """{camera: file} of an episode, and {camera: statistics}. Raises DemonstrationError where the files have other
        episodes, too."""
        places = {(row["data/chunk_index"], row["data/file_index"]) for row in self._rows.values()}
        if len(places) < len(self._rows):
            raise DemonstrationError("%s has several episodes in a file; lerobot-edit-dataset changes such sets"
                                     % self.folder)
        row = self._row(number)
        path = self.folder / (layout.EPISODES % (row["meta/episodes/chunk_index"], row["meta/episodes/file_index"]))
        table = _read_table(path)
        said = {camera: {name: np.asarray(table["stats/%s/%s" % (camera, name)][0].as_py()) for name in NAMES}
                for camera in self.schema.cameras}
        return {camera: self._film(number, camera) for camera in self.schema.cameras}, said

    def check(self, number: int) -> None:
        """Read an episode, and look whether its numbers are finite, its times are those of the set's rate, and its
        films have enough frames. Raises DemonstrationError."""
        self.check_numbers(number)
        self._check_times(number)
        for camera in self.schema.cameras:
            row, path = self._row(number), self._film(number, camera)
            end = round(row["videos/%s/to_timestamp" % camera] * self.schema.rate_hz)
            if frame_count(path) < end:
                raise DemonstrationError("%s has %d frames; episode %d ends at frame %d" % (
                    path, frame_count(path), number, end))

    def check_numbers(self, number: int) -> None:
        """Read an episode without its films. Raises DemonstrationError where a number is missing or not finite."""
        for key, values in self.episode(number).columns.items():
            if values.dtype.kind == "f" and not np.isfinite(values).all():
                raise DemonstrationError("episode %d of %s has numbers in %s that are missing or not finite"
                                         % (number, self.folder, key))

    def _check_times(self, number):
        row = self._row(number)
        path = self.folder / (layout.DATA % (row["data/chunk_index"], row["data/file_index"]))
        table = _read_table(path, ["episode_index", "timestamp"])
        if "timestamp" not in table.column_names:
            raise DemonstrationError("%s has no column timestamp" % path)
        times = table["timestamp"].to_numpy()[table["episode_index"].to_numpy() == number]
        expected = np.arange(len(times)) / self.schema.rate_hz
        if len(times) and not np.abs(times - expected).max() < 0.5 / self.schema.rate_hz:
            raise DemonstrationError("%s has times of episode %d to %g s; at the set's rate, %g Hz, they go to %g s" % (
                path, number, times[-1], self.schema.rate_hz, expected[-1]))


def _require_row(path, row):
    """Raises DemonstrationError where a row of meta/episodes has no counts, or no task."""
    for name in DataSet._NEEDED:
        if name != "tasks" and not layout.is_count(row[name]):
            raise DemonstrationError("%s: %s is %r, no count" % (path, name, row[name]))
    tasks = row["tasks"]
    if not (isinstance(tasks, list) and tasks and isinstance(tasks[0], str)):
        raise DemonstrationError("%s: tasks is %r, no list of texts" % (path, tasks))


def _column(values, feature):
    array = values.combine_chunks()
    flat = array.flatten() if feature.shape[0] > 1 else array
    return flat.to_numpy(zero_copy_only=False).reshape(-1, *feature.shape).astype(feature.dtype, copy=False)


@dataclass
class Survey:
    """good: numbers of whole episodes; broken: {number: why}; strays: files of no episode; faults: of `DataSet`."""

    good: list[int] = field(default_factory=list)
    broken: dict[int, str] = field(default_factory=dict)
    strays: list[str] = field(default_factory=list)
    faults: list[str] = field(default_factory=list)


def survey(folder: Path) -> Survey:
    """Read a whole set. Raises DemonstrationError where not even its description can be read."""
    data = DataSet(folder)
    found = Survey(faults=data.faults)
    for number in range(len(data)):
        try:
            data.check(number)
            found.good.append(number)
        except DemonstrationError as error:
            found.broken[number] = str(error)
    listed = {path for row in data._rows.values() for path in _files_of(data, row)}
    for pattern in ("data/*/*", "videos/*/*/*", "meta/**/*" + layout.PART, layout.DRAFTS + "/*"):
        found.strays += sorted(str(path.relative_to(folder)) for path in Path(folder).glob(pattern)
                               if str(path.relative_to(folder)) not in listed)
    return found


def _files_of(data, row):
    yield layout.DATA % (row["data/chunk_index"], row["data/file_index"])
    for camera in data.schema.cameras:
        yield layout.FILM % (camera, row.get("videos/%s/chunk_index" % camera, 0),
                             row.get("videos/%s/file_index" % camera, 0))


def repair(folder: Path, into: Path) -> Survey:
    """Copy the whole episodes of a set into a new one; returns what was found. Raises DemonstrationError, also where
    something is in the new one's folder."""
    from .writing import SetWriter

    if Path(into).exists() and (not Path(into).is_dir() or any(Path(into).iterdir())):
        raise DemonstrationError("%s is not empty; whole episodes are copied into a new folder" % into)
    found, data = survey(folder), DataSet(folder)
    with SetWriter(into, data.schema) as writer:
        for number in found.good:
            copy(data, number, writer)
    return found


def copy(data: DataSet, number: int, writer: Any) -> None:
    """Append an episode of a set to another, a `SetWriter`. Raises DemonstrationError."""
    episode = data.episode(number)
    films = {camera: data.pictures(number, camera) for camera in data.schema.cameras}
    for row in range(len(episode)):
        writer.frame({**{key: values[row] for key, values in episode.columns.items()},
                      **{camera: next(film) for camera, film in films.items()}})
    writer.keep(episode.task, episode.success, episode.seed)
