# SPDX-License-Identifier: BSD-3-Clause
"""Demonstrations as robomimic's HDF5. By h5py."""
from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from .frames import ACTION, CONDITIONS, DONE, ENVIRONMENT, PICTURES, REWARD, STATE, DemonstrationError
from .layout import write_whole
from .reading import DataSet

#: {key of a set: name among the observations there}
_NAMES = {STATE: "robot0_proprio-state", ENVIRONMENT: "object-state"}
#: robomimic's number for environments of Gymnasium.
_GYM = 2
_VALID_SHARE = 0.1


def write(data: DataSet, path: Path) -> int:
    """Write all episodes of a set into an HDF5 file, with the filters train and valid; returns their number. Raises
    DemonstrationError, also where the disk refuses it: the file is then as it was before."""
    try:
        import h5py
    except ImportError as error:
        raise DemonstrationError("robomimic's HDF5 needs h5py, which is not installed: pip install h5py") from error
    try:
        write_whole(Path(path), lambda draft: _write(h5py, data, draft))
    except OSError as error:
        raise DemonstrationError("%s cannot be written: %s" % (path, error)) from error
    return len(data)


def _write(h5py, data, path):
    about = data.schema.about
    environment = {"env_name": "gym_baxter/%s-v0" % about.get("task"), "type": _GYM,
                   "env_kwargs": {"control": about.get("control"), "control_freq": data.schema.rate_hz},
                   **{key: about[key] for key in CONDITIONS if key in about}}
    total = 0
    with h5py.File(path, "w") as file:
        group = file.create_group("data")
        for number in range(len(data)):
            episode = data.episode(number)
            total += len(episode)
            demo = group.create_group("demo_%d" % number)
            demo.attrs["num_samples"] = len(episode)
            demo["actions"] = episode.columns[ACTION].astype(np.float64)
            state = [values for key, values in episode.columns.items() if key in (STATE, ENVIRONMENT)]
            demo["states"] = np.concatenate(state, axis=1)
            last = np.arange(len(episode)) == len(episode) - 1
            demo["rewards"] = episode.columns[REWARD][:, 0] if REWARD in episode.columns else last.astype(np.float64)
            demo["dones"] = (episode.columns[DONE][:, 0] if DONE in episode.columns else last).astype(np.int64)
            observations = {_NAMES[key]: values for key, values in episode.columns.items() if key in _NAMES}
            observations |= {"%s_image" % camera[len(PICTURES):]: np.stack(list(data.pictures(number, camera)))
                             for camera in data.schema.cameras}
            for name, values in observations.items():
                demo["obs/" + name] = values
                # Of the last frame there is no next one.
                demo["next_obs/" + name] = np.concatenate([values[1:], values[-1:]])
        group.attrs["total"] = total
        group.attrs["env_args"] = json.dumps(environment)
        names = np.array(["demo_%d" % number for number in range(len(data))], dtype="S")
        valid = max(round(_VALID_SHARE * len(names)), 1) if len(names) > 1 else 0
        file["mask/train"], file["mask/valid"] = names[:len(names) - valid], names[len(names) - valid:]
