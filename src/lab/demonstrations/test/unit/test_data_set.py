# SPDX-License-Identifier: BSD-3-Clause
"""LeRobot data sets: what is written, what is read back, and what is left of a broken one."""
import json
import os
import resource
import signal
import subprocess
import sys

import numpy as np
import pytest

from demonstrations import layout, robomimic, statistics
from demonstrations.card import card
from demonstrations.editing import listed
from demonstrations.films import Film, frames_of
from demonstrations.frames import (
    ACTION,
    ENVIRONMENT,
    PICTURES,
    STATE,
    DemonstrationError,
    Episode,
    Feature,
    Schema,
    numbers,
    picture,
)
from demonstrations.needed import need
from demonstrations.reading import DataSet, repair, survey
from demonstrations.writing import SetWriter

CAMERA = PICTURES + "head"
ABOUT = {"task": "Reach", "control": "osc_pose"}
SCHEMA = Schema(20, {ACTION: numbers([("a", ""), ("b", "")]), STATE: numbers([("s", "rad")]),
                     ENVIRONMENT: numbers([("x", "m"), ("y", "m"), ("z", "m")]), "next.done": Feature("bool", (1,))},
                about=ABOUT)
FILMED = Schema(10, {ACTION: numbers([("a", "")]), CAMERA: picture(32, 48)}, about=ABOUT)


def episode(length, seed=0, task="Reach it."):
    random = np.random.default_rng(seed)
    columns = {key: random.standard_normal((length, *feature.shape)).astype(feature.dtype)
               for key, feature in SCHEMA.features.items()}
    return Episode(task, columns, True, seed)


def filled(folder, lengths=(5, 3, 7)):
    with SetWriter(folder, SCHEMA) as writer:
        for seed, length in enumerate(lengths):
            writer.add(episode(length, seed, "Reach it." if seed % 2 == 0 else "Reach it again."))
    return folder


def grey(level):
    return np.full((32, 48, 3), level, np.uint8)


def test_what_is_written_is_read_back_to_the_last_bit(tmp_path):
    data = DataSet(filled(tmp_path / "set"))
    assert len(data) == 3 and data.tasks == ["Reach it.", "Reach it again."] and data.schema == SCHEMA
    for seed, length in enumerate((5, 3, 7)):
        found, wanted = data.episode(seed), episode(length, seed)
        assert found.seed == seed and found.success and found.task == data.tasks[seed % 2]
        for key, values in wanted.columns.items():
            np.testing.assert_array_equal(found.columns[key], values)
            assert found.columns[key].dtype == values.dtype


def test_files_are_those_of_the_format(tmp_path):
    """By the format's published description: names, types, order of columns, indices."""
    parquet, arrow = need("pyarrow", "parquet"), need("pyarrow")
    folder = filled(tmp_path / "set")
    info = json.loads((folder / "meta/info.json").read_text())
    assert info["codebase_version"] == "v3.0" and info["fps"] == 20 and info["splits"] == {"train": "0:3"}
    assert (info["total_episodes"], info["total_frames"], info["total_tasks"]) == (3, 15, 2)
    assert info["features"]["timestamp"] == {"dtype": "float32", "shape": [1], "names": None}
    assert info["features"][ACTION] == {"dtype": "float32", "shape": [2], "names": ["a", "b"]}
    assert (folder / info["data_path"].format(chunk_index=0, file_index=2)).is_file() and info["video_path"] is None
    file = parquet.ParquetFile(folder / "data/chunk-000/file-002.parquet")
    table = file.read()
    assert file.num_row_groups == 1
    assert table.column_names == [*SCHEMA.features, "timestamp", "frame_index", "episode_index", "index", "task_index"]
    assert table.schema.field(ACTION).type == arrow.list_(arrow.float32(), 2)
    assert table.schema.field(STATE).type == arrow.float32() and table.schema.field("next.done").type == arrow.bool_()
    assert table["index"].to_pylist() == list(range(8, 15)) and table["frame_index"].to_pylist() == list(range(7))
    np.testing.assert_array_equal(table["timestamp"], np.arange(7, dtype="float64").astype("float32") / np.float32(20))
    row = parquet.read_table(folder / "meta/episodes/chunk-000/file-001.parquet").to_pylist()[0]
    assert (row["dataset_from_index"], row["dataset_to_index"], row["length"]) == (5, 8, 3)
    assert row["tasks"] == ["Reach it again."] and row["stats/%s/count" % ACTION] == [3]
    assert len(row["stats/%s/q99" % ENVIRONMENT]) == 3 and row["meta/episodes/file_index"] == 1
    tasks = parquet.read_table(folder / "meta/tasks.parquet")
    assert json.loads(tasks.schema.metadata[b"pandas"])["index_columns"] == ["task"]
    stats = json.loads((folder / "meta/stats.json").read_text())
    assert stats["index"]["count"] == [15] and stats["index"]["max"] == [14]


def test_statistics_of_all_are_those_of_the_parts_joined():
    values = np.random.default_rng(0).normal(3.0, 2.0, (50, 4))
    parts = statistics.joined([statistics.of_numbers(values[:10]), statistics.of_numbers(values[10:])])
    whole = statistics.of_numbers(values)
    for name in ("min", "max", "mean", "std", "count"):
        np.testing.assert_allclose(parts[name], whole[name])


def test_pictures_come_back_and_have_statistics(tmp_path):
    with SetWriter(tmp_path, FILMED) as writer:
        for _ in range(2):
            for level in range(6):
                writer.frame({ACTION: [level], CAMERA: grey(40 * level)})
            writer.keep("Look.", True)
    data = DataSet(tmp_path)
    for level, pixels in enumerate(data.pictures(1, CAMERA)):
        assert abs(float(pixels.mean()) - 40 * level) < 4.0
    assert level == 5 and survey(tmp_path).good == [0, 1]
    stats = json.loads((tmp_path / "meta/stats.json").read_text())[CAMERA]
    np.testing.assert_allclose(stats["mean"], np.full((3, 1, 1), 100.0 / 255.0))
    assert stats["count"] == [12] and stats["max"] == np.full((3, 1, 1), 200.0 / 255.0).tolist()
    av = need("av")
    with av.open(str(tmp_path / "videos" / CAMERA / "chunk-000/file-001.mp4")) as film:
        stream = film.streams.video[0]
        times = [frame.time for frame in film.decode(stream)]
        np.testing.assert_allclose(times, np.arange(6) / 10.0, atol=1e-6)
        assert stream.codec_context.name == "h264" and stream.average_rate == 10


def test_a_set_is_continued(tmp_path):
    filled(tmp_path, (5, 3))
    with SetWriter(tmp_path, SCHEMA) as writer:
        assert writer.add(episode(4, 9)) == 2
    assert [len(DataSet(tmp_path).episode(number)) for number in range(3)] == [5, 3, 4]
    assert json.loads((tmp_path / "meta/stats.json").read_text())["index"]["count"] == [12]


def test_other_frames_and_other_folders_are_refused(tmp_path):
    filled(tmp_path / "set")
    with pytest.raises(DemonstrationError, match="other frames"):
        SetWriter(tmp_path / "set", FILMED)
    (tmp_path / "notes").mkdir()
    (tmp_path / "notes/a.txt").write_text("mine")
    with pytest.raises(DemonstrationError, match="something else"):
        SetWriter(tmp_path / "notes", SCHEMA)
    with pytest.raises(DemonstrationError, match="there is no .*info.json"):
        DataSet(tmp_path / "notes")


@pytest.mark.parametrize(("change", "text"), [
    ({STATE: [np.nan]}, "finite"), ({STATE: [1.0, 2.0]}, r"\(1,\)"), ({"other": 1}, "exactly"),
    ({STATE: "x"}, "array")])
def test_a_bad_frame_is_refused_and_the_episode_goes_on(tmp_path, change, text):
    good = {key: values[0] for key, values in episode(1).columns.items()}
    with SetWriter(tmp_path, SCHEMA) as writer:
        writer.frame(good)
        with pytest.raises(DemonstrationError, match=text):
            writer.frame({**good, **change})
        writer.frame(good)
        writer.keep("Reach it.", True)
    assert len(DataSet(tmp_path).episode(0)) == 2


@pytest.mark.parametrize(("key", "feature"), [
    ("image", numbers([("a", "")])), (CAMERA, Feature("video", (31, 48, 3))), ("a/b", numbers([("a", "")])),
    ("x", Feature("complex64", (1,)))])
def test_features_that_readers_refuse_are_refused(key, feature):
    with pytest.raises(DemonstrationError, match="a/b|even|pictures|numbers"):
        Schema(20, {ACTION: numbers([("a", "")]), key: feature})


BREAK = {"data/chunk-000/file-001.parquet": b"PAR1 half a file", "meta/episodes/chunk-000/file-001.parquet": b""}


@pytest.mark.parametrize("name", BREAK)
def test_the_other_episodes_of_a_broken_set_are_kept(tmp_path, name):
    folder = filled(tmp_path / "set")
    (folder / name).write_bytes(BREAK[name])
    found = repair(folder, tmp_path / "mended")
    assert found.good == [0, 2] and name in found.broken[1] or "episode 1" in found.broken[1]
    mended = DataSet(tmp_path / "mended")
    np.testing.assert_array_equal(mended.episode(1).columns[ACTION], episode(7, 2).columns[ACTION])
    assert mended.episode(1).seed == 2 and survey(tmp_path / "mended").broken == {}


def _changed_row(name, change):
    def break_(folder):
        parquet = need("pyarrow", "parquet")
        table = parquet.read_table(folder / name)
        row = {key: table[key].to_pylist() for key in table.column_names}
        change(row)
        parquet.write_table(need("pyarrow").table(row), folder / name)

    return break_


def _changed_info(**values):
    def break_(folder):
        path = folder / layout.INFO
        path.write_text(json.dumps({**json.loads(path.read_text()), **values}))

    return break_


def _text(name, text):
    return lambda folder: (folder / name).write_text(text)


ROW = "meta/episodes/chunk-000/file-001.parquet"
NUMBERS = "data/chunk-000/file-001.parquet"


@pytest.mark.parametrize(("break_", "good", "said"), [
    (_changed_row(ROW, lambda row: row.pop("length")), [0, 2], "no column length"),
    (_changed_row(ROW, lambda row: row.update(length=["x"])), [0, 2], "length is 'x'"),
    (_changed_row(ROW, lambda row: row.update(length=[None])), [0, 2], "length is None"),
    (_changed_row(ROW, lambda row: row.update({"data/chunk_index": ["a"]})), [0, 2], "data/chunk_index is 'a'"),
    (_changed_row(ROW, lambda row: row.update(tasks=[[]])), [0, 2], "tasks is "),
    (_changed_row(NUMBERS, lambda row: row.update({STATE: [float("nan")] * 3})), [0, 2], "not finite"),
    (_changed_row(NUMBERS, lambda row: row.update({STATE: [1.0, None, 1.0]})), [0, 2], "missing or not finite"),
    (_changed_row(NUMBERS, lambda row: [row[key].insert(1, row[key][0]) for key in row] and
                  row["episode_index"].__setitem__(1, 7)), [0, 2], "other frames among those of episode 1"),
    (lambda folder: (folder / layout.TASKS).unlink(), [0, 1, 2], "tasks.parquet is missing"),
    (_changed_row(NUMBERS, lambda row: row.update(timestamp=[0.0, 0.2, 0.4])), [0, 2], "they go to"),
    (_changed_row(NUMBERS, lambda row: row.pop("timestamp")), [0, 2], "no column timestamp"),
    (_changed_row(layout.TASKS, lambda row: row.update(task=[None, "x"])), [0, 1, 2], "no text"),
    (_text(layout.OUTCOMES, '5\n{"episode": 0, "seed": "x", "frames": "many"}\n{"episode": 1, "seed": 1.5}\n'),
     [0, 1, 2], ""),
    (_text(layout.STATISTICS, "[]"), [0, 1, 2], ""),
    (_text(layout.STATISTICS, '{"index": {"count": []}}'), [0, 1, 2], ""),
])
def test_what_is_whole_in_a_broken_set_is_kept_and_the_rest_named(tmp_path, break_, good, said):
    folder = filled(tmp_path / "set")
    break_(folder)
    found = repair(folder, tmp_path / "mended")
    assert found.good == good and said in " ".join([*found.broken.values(), *found.faults])
    mended = DataSet(tmp_path / "mended")
    assert [len(mended.episode(number)) for number in range(len(good))] == [(5, 3, 7)[number] for number in good]
    assert all(row.frames in (0, 3, 5, 7) for row in listed(folder)[0]) and card(mended)


def test_a_set_is_not_repaired_into_one_that_is_there(tmp_path):
    """Its episodes were appended to themselves."""
    folder = filled(tmp_path / "set")
    for into in (folder, folder / layout.INFO):
        with pytest.raises(DemonstrationError, match="not empty"):
            repair(folder, into)
    assert survey(folder).good == [0, 1, 2]
    (tmp_path / "empty").mkdir()
    assert repair(folder, tmp_path / "empty").good == [0, 1, 2]


def test_a_set_without_its_tasks_is_not_continued_but_repaired(tmp_path):
    folder = filled(tmp_path / "set")
    (folder / layout.TASKS).unlink()
    with pytest.raises(DemonstrationError, match=r"tasks.parquet is missing; .*repair"):
        SetWriter(folder, SCHEMA)


@pytest.mark.parametrize("text", [None, "[]", '{"index": {"count": []}}', '{"index": {"mean": "x"}}'])
def test_lost_statistics_come_back_from_those_of_the_episodes(tmp_path, text):
    folder = filled(tmp_path / "set")
    (folder / layout.STATISTICS).unlink()
    if text is not None:
        (folder / layout.STATISTICS).write_text(text)
    with SetWriter(folder, SCHEMA) as writer:
        writer.add(episode(4, 3, "Reach it again."))
    whole = filled(tmp_path / "whole", (5, 3, 7, 4))
    assert (folder / layout.STATISTICS).read_text() == (whole / layout.STATISTICS).read_text()


@pytest.mark.parametrize("values", [
    {"fps": "twenty"}, {"fps": float("inf")}, {"fps": 20.5}, {"fps": None}, {"total_episodes": True},
    {"total_episodes": "3"}, {"features": {"action": {"dtype": "float32", "shape": [0]}}}])
def test_a_broken_description_is_named(tmp_path, values):
    folder = filled(tmp_path / "set")
    _changed_info(**values)(folder)
    with pytest.raises(DemonstrationError, match="info.json"):
        survey(folder)
    with pytest.raises(DemonstrationError, match="info.json"):
        SetWriter(folder, SCHEMA)


def test_a_cut_off_film_is_named(tmp_path):
    with SetWriter(tmp_path, FILMED) as writer:
        for _ in range(2):
            for level in range(4):
                writer.frame({ACTION: [level], CAMERA: grey(level)})
            writer.keep("Look.", True)
    film = tmp_path / "videos" / CAMERA / "chunk-000/file-000.mp4"
    film.write_bytes(film.read_bytes()[:-200])
    found = survey(tmp_path)
    assert found.good == [1] and "file-000.mp4" in found.broken[0]
    film.write_bytes(film.read_bytes()[:film.stat().st_size // 2])
    with pytest.raises(DemonstrationError, match="no readable film"):
        list(frames_of(film))


def test_a_finished_film_takes_no_more_pictures(tmp_path):
    film = Film(tmp_path / "film.mp4", 10, (32, 48))
    film.add(grey(50))
    film.close()
    with pytest.raises(ValueError, match="film.mp4 is finished"):
        film.add(grey(60))
    assert len(list(frames_of(film.path))) == 1


RECORD = """
import os, signal, sys
sys.path[:0] = %r
from pathlib import Path
from test_data_set import SCHEMA, episode
from demonstrations.writing import SetWriter
from demonstrations import layout
writer = SetWriter(Path(sys.argv[1]), SCHEMA)
for seed in range(int(sys.argv[3])):
    writer.add(episode(5, seed))
write_whole = layout.write_whole
def killed(path, write):
    if path.match(sys.argv[2]) and (path.name != "info.json" or (path.parent / "stats.json").exists()):
        os.kill(os.getpid(), signal.SIGKILL)
    write_whole(path, write)
layout.write_whole = killed
writer.add(episode(7, seed=7))
"""


def killed_at(folder, name, before):
    """A recorder is killed when it would write this file of the episode after `before` others."""
    here = os.path.dirname(__file__)
    program = [sys.executable, "-c", RECORD % [here, *sys.path], str(folder), name, str(before)]
    done = subprocess.run(program, timeout=60)
    assert done.returncode == -signal.SIGKILL


@pytest.mark.parametrize("name", ["info.json", "stats.json"])
def test_a_killed_recorder_leaves_the_complete_episodes(tmp_path, name):
    killed_at(tmp_path, name, 2)
    found = survey(tmp_path)
    assert found.good == [0, 1] and found.strays == ["data/chunk-000/file-002.parquet"]
    with SetWriter(tmp_path, SCHEMA) as writer:
        writer.add(episode(6, 8))
    data = DataSet(tmp_path)
    assert survey(tmp_path).strays == [] and [data.episode(number).seed for number in range(3)] == [0, 1, 8]
    filled_at_once = tmp_path / "at_once"
    with SetWriter(filled_at_once, SCHEMA) as writer:
        for length, seed in ((5, 0), (5, 1), (6, 8)):
            writer.add(episode(length, seed))
    assert (tmp_path / layout.STATISTICS).read_text() == (filled_at_once / layout.STATISTICS).read_text()


@pytest.mark.parametrize("name", ["data/*/*.parquet", "tasks.parquet", "info.json"])
def test_a_recorder_killed_in_its_first_episode_leaves_a_folder_to_record_into(tmp_path, name):
    killed_at(tmp_path, name, 0)
    data = DataSet(tmp_path)
    assert (len(data), data.seeds, survey(tmp_path).good) == (0, [], [])
    with SetWriter(tmp_path, SCHEMA) as writer:
        writer.add(episode(6, 8))
    assert survey(tmp_path).good == [0] and DataSet(tmp_path).episode(0).seed == 8


def test_a_full_disk_costs_the_present_episode_alone(tmp_path):
    filled(tmp_path, (5,))
    writer = SetWriter(tmp_path, SCHEMA)
    before = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (2000, hard))
    try:
        with pytest.raises(DemonstrationError, match="episode 1 of .* is not kept"):
            writer.add(episode(4000, 1))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        signal.signal(signal.SIGXFSZ, before)
    assert survey(tmp_path).good == [0] and survey(tmp_path).strays == []
    writer.add(episode(6, 2))
    assert DataSet(tmp_path).episode(1).seed == 2


@pytest.mark.parametrize("name", ["file-001.parquet", "stats.json", "info.json"])
def test_an_episode_that_a_full_disk_refused_takes_no_room(tmp_path, monkeypatch, name):
    def frames(writer):
        for level in range(4):
            writer.frame({ACTION: [level], CAMERA: grey(level)})

    def full(path, write):
        if "meta" in path.parts and path.name == name:
            raise OSError(28, "No space left on device")
        write_whole(path, write)

    write_whole = layout.write_whole
    with SetWriter(tmp_path, FILMED) as writer:
        frames(writer)
        writer.keep("Look.", True)
        monkeypatch.setattr(layout, "write_whole", full)
        frames(writer)
        with pytest.raises(DemonstrationError, match="episode 1 of .* is not kept, the 1 before are: .*No space"):
            writer.keep("Look.", True)
        monkeypatch.undo()
        assert (survey(tmp_path).good, survey(tmp_path).strays) == ([0], [])
        assert not list(tmp_path.rglob("file-001.*"))
        frames(writer)
        writer.keep("Look.", True)
    assert survey(tmp_path).good == [0, 1]


def test_robomimics_file_has_its_groups(tmp_path):
    h5py = pytest.importorskip("h5py", reason="the workspace has it; elsewhere it is optional")
    data = DataSet(filled(tmp_path / "set"))
    assert robomimic.write(data, tmp_path / "set.hdf5") == 3
    with h5py.File(tmp_path / "set.hdf5") as file:
        group = file["data"]
        assert group.attrs["total"] == 15 and json.loads(group.attrs["env_args"])["env_name"] == "gym_baxter/Reach-v0"
        demo = group["demo_2"]
        assert demo.attrs["num_samples"] == 7 and demo["actions"].shape == (7, 2) and demo["states"].shape == (7, 4)
        assert demo["obs/object-state"].shape == demo["next_obs/object-state"].shape == (7, 3)
        np.testing.assert_array_equal(demo["next_obs/object-state"][:-1], demo["obs/object-state"][1:])
        names = [*file["mask/train"], *file["mask/valid"]]
        assert sorted(names) == [b"demo_0", b"demo_1", b"demo_2"]


def test_numbers_of_files_go_on_in_the_next_chunk():
    assert layout.numbered(999) == (0, 999) and layout.numbered(1000) == (1, 0)


def test_two_writers_do_not_meet_in_one_folder(tmp_path):
    filled(tmp_path / "set")
    with SetWriter(tmp_path / "set", SCHEMA) as first:
        with pytest.raises(DemonstrationError, match="another program is recording into"):
            SetWriter(tmp_path / "set", SCHEMA)
        first.add(episode(4))
    with SetWriter(tmp_path / "set", SCHEMA) as second:
        assert second.episodes == 4
        second.close()


def test_a_place_where_no_folder_can_be_is_named(tmp_path):
    (tmp_path / "file").write_text("")
    for folder in (tmp_path / "file" / "set", tmp_path / "file"):
        with pytest.raises(DemonstrationError, match="file"):
            SetWriter(folder, SCHEMA)
