# SPDX-License-Identifier: BSD-3-Clause
"""Sets without one of their episodes, strips of films, and sets as one file with a card."""
import io
import zipfile

import numpy as np
import pytest

from demonstrations import editing, layout
from demonstrations.frames import ACTION, PICTURES, DemonstrationError, Schema, numbers, picture
from demonstrations.reading import DataSet, survey
from demonstrations.writing import SetWriter

CAMERA = PICTURES + "head"
SCHEMA = Schema(10, {ACTION: numbers([("a", "")]), CAMERA: picture(64, 96)}, about={"task": "on the robot"})


def write(folder, levels):
    """An episode for each level: as many frames as its number and 4, of a grey that grows from it by 5."""
    with SetWriter(folder, SCHEMA) as writer:
        for number, level in enumerate(levels):
            for frame in range(number + 4):
                writer.frame({ACTION: [level + frame], CAMERA: np.full((64, 96, 3), level + 5 * frame, np.uint8)})
            writer.keep("Task %d." % (level % 2), number != 1)
    return folder


def texts(folder):
    """Everything but films, by name."""
    files = {path.relative_to(folder): path for path in folder.rglob("*") if path.suffix in (".json", ".jsonl")}
    return {str(name): path.read_text() for name, path in files.items()}


@pytest.mark.parametrize("number", [0, 1, 2])
def test_without_an_episode_a_set_is_as_if_it_had_never_been_there(tmp_path, number):
    folder = write(tmp_path / "set", (20, 61, 100))
    before = DataSet(folder)
    others = [other for other in range(3) if other != number]
    wanted = [(before.episode(other), list(before.pictures(other, CAMERA))) for other in others]
    editing.delete(folder, number)
    data = DataSet(folder)
    assert len(data) == 2 and survey(folder).good == [0, 1] and not survey(folder).strays
    for now, (episode, pictures) in enumerate(wanted):
        np.testing.assert_array_equal(data.episode(now).columns[ACTION], episode.columns[ACTION])
        np.testing.assert_array_equal(list(data.pictures(now, CAMERA)), pictures)
        assert (data.episode(now).task, data.episode(now).success) == (episode.task, episode.success)
    info = layout.read_json(folder / layout.INFO)
    assert info["total_frames"] == sum(len(episode) for episode, _ in wanted)
    with SetWriter(folder, SCHEMA) as writer:  # and it goes on
        writer.frame({ACTION: [1.0], CAMERA: np.zeros((64, 96, 3), np.uint8)})
        assert writer.keep("Task 0.", True) == 2
    assert [path.name for path in tmp_path.iterdir()] == ["set"]


def test_the_statistics_are_those_of_the_rest(tmp_path):
    editing.delete(write(tmp_path / "set", (20, 61, 100)), 2)
    alone = write(tmp_path / "alone", (20, 61))
    assert texts(tmp_path / "set") == texts(alone)


def test_the_last_episode_can_go_too(tmp_path):
    folder = write(tmp_path / "set", (20,))
    editing.delete(folder, 0)
    assert not list(folder.iterdir())
    assert len(DataSet(write(folder, (20,)))) == 1


def test_nothing_is_deleted_while_somebody_records_or_where_there_is_none(tmp_path):
    folder = write(tmp_path / "set", (20, 61))
    with SetWriter(folder, SCHEMA), pytest.raises(DemonstrationError, match="recording"):
        editing.delete(folder, 0)
    with pytest.raises(DemonstrationError, match="episodes 0 to 1, not 2"):
        editing.delete(folder, 2)
    assert len(DataSet(folder)) == 2 and [path.name for path in tmp_path.iterdir()] == ["set"]


def test_a_list_needs_texts_alone(tmp_path, monkeypatch):
    folder = write(tmp_path / "set", (20, 61))
    monkeypatch.setattr("demonstrations.needed.need", None)
    assert editing.listed(folder) == ([(0, 4, True), (1, 5, False)], (CAMERA,), 10)


def test_a_strip_goes_from_the_first_picture_to_the_last(tmp_path):
    folder = write(tmp_path / "set", (20, 61))
    found = editing.strip(folder, 1, CAMERA, count=3, height=32)
    assert found.shape == (32, 3 * 48, 3)
    np.testing.assert_allclose([found[:, 48 * k:48 * k + 48].mean() for k in range(3)], (61, 71, 81), atol=3)
    assert editing.strip(folder, 0, CAMERA, count=6).shape == (64, 6 * 96, 3)  # fewer pictures than places
    with pytest.raises(DemonstrationError, match="no camera"):
        editing.strip(folder, 0, "observation.images.left_hand")


def test_a_set_as_one_file_is_a_set(tmp_path):
    folder, packed = write(tmp_path / "blocks", (20, 61)), io.BytesIO()
    editing.write_zip(folder, packed)
    zipfile.ZipFile(packed).extractall(tmp_path / "there")
    assert survey(tmp_path / "there" / "blocks").good == [0, 1] and not survey(folder).strays
    text = (tmp_path / "there" / "blocks" / "README.md").read_text()
    assert text.startswith("---\n") and "| episodes | 2, of which 1 are successes |" in text
    assert "| shown | Task 0.; Task 1. |" in text and "| frames | 9 at 10 Hz; an episode has 4 to 5" in text
    assert "| `observation.images.head` | 64 x 96 x 3 | - |" in text
