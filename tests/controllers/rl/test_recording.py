"""Episodes as a Minari dataset, read back by Minari."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from policies import make_policy

from grouser.controllers.rl import record_dataset
from grouser.terrain import ConfigurationError, InvalidInputError, make_backend

pytest.importorskip("minari")
pytest.importorskip("pyarrow")

TASK: dict[str, Any] = {"action_mode": "twist", "time_limit": 2.0, "random_start": True}
NAME = "grouser/path-tracking/random-v0"


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> tuple[Any, Path]:
    root = tmp_path_factory.mktemp("minari")
    policy = make_policy(seed=2, drive=0.5, **TASK)
    record_dataset(policy, policy.environment_spec(backend="native"), NAME, episodes=3, seed=4, root=root)
    return policy, root


def test_minari_finds_the_dataset_by_its_name(recorded: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    import minari

    monkeypatch.setenv("MINARI_DATASETS_PATH", str(recorded[1]))
    assert list(minari.list_local_datasets()) == [NAME]
    assert minari.load_dataset(NAME).total_episodes == 3


def test_episodes_are_those_of_the_environment_to_the_bit(recorded: Any) -> None:
    import minari

    policy, root = recorded
    dataset = minari.MinariDataset(root / NAME / "data")
    environment = dataset.recover_environment()
    for index, episode in enumerate(dataset.iterate_episodes()):
        observation, _ = environment.reset(seed=4 + index)
        for step in range(len(episode.rewards)):
            assert np.array_equal(episode.observations[step], observation)
            action = policy.act(observation)
            assert np.array_equal(episode.actions[step], action)
            observation, reward, terminated, truncated, info = environment.step(action)
            assert (episode.rewards[step], episode.infos["progress"][step + 1]) == (reward, info["progress"])
            assert (episode.terminations[step], episode.truncations[step]) == (terminated, truncated)
        assert terminated or truncated
        assert np.array_equal(episode.observations[-1], observation)
        assert next(iter(dataset.storage.get_episode_metadata([index])))["seed"] == 4 + index


def test_the_metadata_say_where_the_episodes_come_from(recorded: Any) -> None:
    import minari

    policy, root = recorded
    metadata: Any = minari.MinariDataset(root / NAME / "data").storage.metadata
    told = metadata["grouser"]
    assert told["environment"]["backend"]["backend"] == "native"
    expected = make_backend("native", mode="rigid", vehicle="m113").describe()["artifact"]
    assert told["artifact"] == expected
    assert len(expected) == 64
    assert told["environment"]["arguments"]["terrain"] == "asphalt"
    assert told["terrain_parameters"][0] == 0.8
    assert told["environment"]["vehicle"]["name"] == "m113"
    assert told["policy"] == policy.content_hash
    assert {"grouser", "minari", "gymnasium"} <= set(told["versions"])


def test_a_dataset_is_not_overwritten_and_nothing_is_left_beside_it(recorded: Any) -> None:
    policy, root = recorded
    with pytest.raises(ConfigurationError, match="choose another version"):
        record_dataset(policy, policy.environment_spec(), NAME, episodes=1, root=root)
    assert sorted(item.name for item in root.iterdir()) == ["grouser"]


def test_a_name_that_minari_does_not_take_is_refused(tmp_path: Path) -> None:
    policy = make_policy(**TASK)
    with pytest.raises(InvalidInputError, match="ppo-v0"):
        record_dataset(policy, policy.environment_spec(), "no version", episodes=1, root=tmp_path)
    assert not list(tmp_path.iterdir())


def test_a_missing_library_is_named_with_its_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    policy = make_policy(**TASK)
    monkeypatch.setitem(sys.modules, "minari", None)
    with pytest.raises(ConfigurationError, match=r"grouser\[offline\]"):
        record_dataset(policy, policy.environment_spec(), NAME, episodes=1, root=tmp_path)
