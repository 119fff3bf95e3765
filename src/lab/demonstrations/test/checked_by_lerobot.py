# SPDX-License-Identifier: BSD-3-Clause
"""LeRobot itself reads, joins, continues, trains on and evaluates a set, and finds the plugins: `checked_by_lerobot.py
SET SCRATCH [STEP...]`. SET: of at least 3 episodes of `python3 -m demonstrations record`. For a Python 3.12 with
`lerobot[dataset,training]`, `baxter-lab[gym,lerobot]` of this workspace, and the plugins beside this folder.

With LAB_ROSBRIDGE (ws://localhost:9090) and LAB_PICTURES (http://localhost:8080) in the environment, it also records
and replays with a robot: a lab that is enabled, in which something moves the arms until this program says "replaying".
"""
import dataclasses
import json
import os
import subprocess
import sys
import time
from pathlib import Path

os.environ["HF_HUB_OFFLINE"] = "1"

import numpy as np

sys.path.insert(0, str(Path(__file__).parent / "unit"))
import lerobot_stand_ins

SET, SCRATCH = (Path(name).resolve() for name in sys.argv[1:3])
_BIN = Path(sys.executable).parent
#: As small as a policy can be: whether it learns is not the question.
_SMALL = ["--policy.type=act", "--policy.device=cpu", "--policy.push_to_hub=false", "--policy.dim_model=32",
          "--policy.n_heads=2", "--policy.dim_feedforward=32", "--policy.n_encoder_layers=1",
          "--policy.n_vae_encoder_layers=1", "--policy.chunk_size=8", "--policy.n_action_steps=8"]


def done(what, began):
    print("%-60s %.1f s" % (what, time.monotonic() - began), flush=True)


def run(*command):
    subprocess.run([str(_BIN / command[0]), *map(str, command[1:])], check=True, cwd=SCRATCH)


def stand_ins_are_as_lerobot_is():
    import importlib

    for module, members in lerobot_stand_ins.MODULES.items():
        real = importlib.import_module(module)
        for stand_in in members:
            found = getattr(real, stand_in.__name__)
            if wanted := lerobot_stand_ins.ABSTRACT.get(stand_in.__name__):
                assert set(found.__abstractmethods__) == wanted, (stand_in, found.__abstractmethods__)
            if hasattr(stand_in, "__members__"):
                assert set(stand_in.__members__) <= set(found.__members__), stand_in
            elif dataclasses.is_dataclass(stand_in):
                names = {field.name for field in dataclasses.fields(found)}
                assert {field.name for field in dataclasses.fields(stand_in)} <= names, stand_in


def plugins_are_found():
    from lerobot.envs.configs import EnvConfig
    from lerobot.robots import RobotConfig, make_robot_from_config
    from lerobot.teleoperators import TeleoperatorConfig, make_teleoperator_from_config
    from lerobot.utils.import_utils import register_third_party_plugins

    register_third_party_plugins()
    robot = make_robot_from_config(RobotConfig.get_choice_class("baxter")(id="one", camera_names=["head"]))
    device = make_teleoperator_from_config(TeleoperatorConfig.get_choice_class("baxter")(id="one"))
    assert robot.action_features == device.action_features and len(robot.cameras) == 1
    assert EnvConfig.get_choice_class("baxter")().gym_id == "gym_baxter/PickPlace-v0"


def loaded(folder, **choices):
    from lerobot.datasets.lerobot_dataset import LeRobotDataset

    return LeRobotDataset("local/%s" % Path(folder).name, root=folder, **choices)


def set_is_read():
    from demonstrations.reading import DataSet

    ours, theirs, row = DataSet(SET), loaded(SET), 0
    assert (theirs.num_episodes, theirs.fps, theirs.meta.robot_type) == (len(ours), ours.schema.rate_hz, "baxter")
    for number in range(len(ours)):
        episode = ours.episode(number)
        for at in (0, len(episode) - 1):
            item = theirs[row + at]
            assert item["task"] == episode.task and int(item["episode_index"]) == number
            for key, values in episode.columns.items():
                np.testing.assert_array_equal(np.asarray(item[key]).reshape(-1), values[at])
            for camera in ours.schema.cameras:
                picture = list(ours.pictures(number, camera))[at]
                off = np.abs(np.asarray(item[camera]).transpose(1, 2, 0) * 255.0 - picture)
                assert off.mean() < 2.0, (number, at, off.mean())
        row += len(episode)
    assert row == theirs.num_frames
    ahead = loaded(SET, delta_timestamps={"action": [step / ours.schema.rate_hz for step in range(4)]})[row - 2]
    assert ahead["action_is_pad"].tolist() == [False, False, True, True]
    np.testing.assert_array_equal(ahead["action"][0], episode.columns["action"][-2])


def sets_are_joined_cut_and_continued():
    from lerobot.datasets.dataset_tools import delete_episodes, merge_datasets
    from lerobot.datasets.lerobot_dataset import LeRobotDataset

    from demonstrations.reading import DataSet, survey

    one = loaded(SET)
    count = one.num_episodes
    assert merge_datasets([one, loaded(SET)], "local/joined", SCRATCH / "joined").num_episodes == 2 * count
    assert delete_episodes(one, [1], SCRATCH / "cut", "local/cut").num_episodes == count - 1
    for name, length in (("joined", 2 * count), ("cut", count - 1)):
        found = survey(SCRATCH / name)
        assert (found.good, found.broken) == (list(range(length)), {}), found
    subprocess.run(["cp", "-r", SET, SCRATCH / "continued"], check=True)
    more = LeRobotDataset.resume("local/continued", SCRATCH / "continued")
    item = one[0]
    skipped = {"timestamp", "frame_index", "episode_index", "index", "task_index"}
    for _ in range(5):
        more.add_frame({"task": item["task"], **{
            key: (np.asarray(item[key]).transpose(1, 2, 0) * 255).astype(np.uint8) if feature["dtype"] == "video"
            else np.asarray(item[key]).reshape(feature["shape"]).astype(feature["dtype"])
            for key, feature in one.features.items() if key not in skipped}})
    more.save_episode()
    more.finalize()
    found = survey(SCRATCH / "continued")
    assert (found.good, found.broken) == (list(range(count + 1)), {}), found
    last = DataSet(SCRATCH / "continued").episode(count)
    assert len(last) == 5
    np.testing.assert_array_equal(last.columns["action"][4], np.asarray(item["action"]))


def a_policy_is_trained_and_evaluated():
    run("lerobot-train", "--dataset.repo_id=local/%s" % SET.name, "--dataset.root=%s" % SET, *_SMALL, "--steps=2",
        "--batch_size=4", "--num_workers=0", "--output_dir=%s" % (SCRATCH / "trained"), "--wandb.enable=false")
    about = json.loads((SET / "meta/baxter.json").read_text(encoding="utf-8"))["about"]
    policy = next((SCRATCH / "trained/checkpoints").glob("*2/pretrained_model"))
    for name, batch in (("alone", 1), ("together", 2)):
        run("lerobot-eval", "--policy.path=%s" % policy, "--policy.device=cpu", "--env.type=baxter",
            "--env.task=%s-v0" % about["task"], "--env.control=%s" % about["control"], "--env.episode_length=5",
            "--eval.n_episodes=2", "--eval.batch_size=%d" % batch, "--output_dir=%s" % (SCRATCH / name))
        info = json.loads((SCRATCH / name / "eval_info.json").read_text(encoding="utf-8"))
        assert info["overall"]["n_episodes"] == 2, info["overall"]


def a_robot_is_recorded_and_replayed():
    from demonstrations.reading import DataSet, survey

    if not os.environ.get("LAB_ROSBRIDGE"):
        print("not done, without LAB_ROSBRIDGE: ", end="")
        return
    # A busy machine is silent for seconds.
    robot = ["--robot.type=baxter", "--robot.id=one", "--robot.seen_s=30",
             "--robot.address=%s" % os.environ["LAB_ROSBRIDGE"]]
    dataset = ["--dataset.repo_id=local/shown", "--dataset.root=%s" % (SCRATCH / "shown")]
    run("lerobot-record", *robot, "--robot.drive=false", "--robot.camera_names=[head]",
        "--robot.pictures=%s" % os.environ["LAB_PICTURES"], "--teleop.type=baxter", "--teleop.id=one",
        "--teleop.seen_s=30", "--teleop.address=%s" % os.environ["LAB_ROSBRIDGE"], *dataset,
        "--dataset.num_episodes=2", "--dataset.fps=10", "--dataset.episode_time_s=6",
        "--dataset.reset_time_s=1", "--dataset.single_task=Wave.", "--dataset.push_to_hub=false",
        "--play_sounds=false", "--display_data=false")
    found = survey(SCRATCH / "shown")
    assert (found.good, found.broken) == ([0, 1], {}), found
    episode = DataSet(SCRATCH / "shown").episode(1)
    actions, states = episode.columns["action"], episode.columns["observation.state"]
    assert np.ptp(states, axis=0).max() > 0.1, "nothing moved"
    print("replaying", flush=True)
    run("lerobot-replay", *robot, *dataset, "--dataset.episode=1", "--play_sounds=false")
    from lerobot.robots import RobotConfig, make_robot_from_config

    baxter = make_robot_from_config(RobotConfig.get_choice_class("baxter")(
        id="one", address=os.environ["LAB_ROSBRIDGE"], drive=False))
    baxter.connect()
    ended = np.array(list(baxter.get_observation().values()))
    baxter.disconnect()
    arms = [index for index in range(len(ended)) if index not in (7, 15)]
    assert np.abs(ended - actions[-1])[arms].max() < 0.05, (ended, actions[-1])


if __name__ == "__main__":
    SCRATCH.mkdir(parents=True, exist_ok=True)
    for step in (stand_ins_are_as_lerobot_is, plugins_are_found, set_is_read, sets_are_joined_cut_and_continued,
                 a_policy_is_trained_and_evaluated, a_robot_is_recorded_and_replayed):
        if sys.argv[3:] and step.__name__ not in sys.argv[3:]:
            continue
        begin = time.monotonic()
        step()
        done(step.__name__.replace("_", " "), begin)
