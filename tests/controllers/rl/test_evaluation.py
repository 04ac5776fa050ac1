"""Evaluation: the same episodes one by one, in a batch, and through the file; figures against their definitions."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from policies import make_policy

from grouser.controllers import EnvironmentSpec, Evaluation, evaluate, load_policy
from grouser.controllers.rl import EpisodeResult, environment_id, environment_ids, short_name
from grouser.terrain import ConfigurationError, InvalidInputError

TASK: dict[str, Any] = {"backend": "physics", "action_mode": "twist", "time_limit": 3.0, "random_start": True}
TRACKING = EnvironmentSpec("grouser/PathTracking-v0", TASK)


def by_hand(policy: Any, spec: EnvironmentSpec, seed: int) -> tuple[float, int, list[float], bool]:
    """Return, length, cross-track errors and whether it terminated, of an episode driven as Gymnasium has it."""
    environment = spec.make()
    observation, info = environment.reset(seed=seed)
    total, length, errors = 0.0, 0, []
    terminated = truncated = False
    while not (terminated or truncated):
        observation, reward, terminated, truncated, info = environment.step(policy.act(observation))
        total += float(reward)
        length += 1
        errors.append(info["cross_track_error"])
    environment.close()
    return total, length, errors, terminated


def test_a_batch_is_the_single_episodes_to_the_bit() -> None:
    policy = make_policy(seed=2, drive=0.5, **TASK)
    found = evaluate(policy, TRACKING, episodes=5, seed=7)
    lengths = set()
    for index, episode in enumerate(found.episodes):
        total, length, errors, terminated = by_hand(policy, TRACKING, 7 + index)
        assert (episode.seed, episode.episode_return, episode.length) == (7 + index, total, length)
        assert episode.ended == ("terminated" if terminated else "truncated")
        rmse = math.sqrt(sum(error**2 for error in errors) / length)
        assert episode.measures["cross_track_error_rmse"] == pytest.approx(rmse, rel=1e-12)
        lengths.add(length)
    assert len(lengths) > 1


def test_neither_threads_nor_the_number_of_episodes_change_one() -> None:
    policy = make_policy(seed=2, drive=0.5, **TASK)
    few, many = (evaluate(policy, TRACKING, episodes=n, seed=3, threads=t) for n, t in ((2, 1), (9, 2)))
    assert many.episodes[:2] == few.episodes


def test_what_is_not_compiled_is_driven_one_by_one_to_the_same_bits() -> None:
    policy = make_policy(seed=2, drive=0.5, **TASK)
    compiled = evaluate(policy, TRACKING.changed(path="straight"), episodes=1)
    # Vector environments take no engine.
    single = TRACKING.changed(path="straight", engine="compiled")
    assert single.make_batch(1) is None
    alone = evaluate(policy, single, episodes=1)
    assert alone.episodes == compiled.episodes


def test_a_saved_policy_earns_the_same_returns(tmp_path: Path) -> None:
    policy = make_policy(seed=2, drive=0.5, **TASK)
    loaded = load_policy(policy.save(tmp_path / "policy.safetensors"))
    before, after = (evaluate(each, each.environment_spec(), episodes=3) for each in (policy, loaded))
    assert before.rows() == after.rows()


def test_the_librarys_own_evaluation_agrees() -> None:
    from stable_baselines3.common.evaluation import evaluate_policy

    policy = make_policy(seed=2, drive=0.5, **TASK)
    environment = TRACKING.make_vec_env(1)
    environment.seed(11)
    found = evaluate_policy(policy, environment, n_eval_episodes=1)
    assert found[0] == pytest.approx(evaluate(policy, TRACKING, episodes=1, seed=11).return_mean, rel=1e-9)


def episode(total: float, length: int = 10, success: bool | None = None, **measures: float) -> EpisodeResult:
    return EpisodeResult(0, total, length, "truncated", success, measures)


def test_the_interval_of_the_mean_is_that_of_the_normal_distribution() -> None:
    returns = np.random.default_rng(0).normal(3.0, 2.0, 400)
    found = Evaluation(tuple(episode(value) for value in returns))
    assert found.return_mean == pytest.approx(returns.mean())
    assert found.return_margin == pytest.approx(1.96 * returns.std(ddof=1) / 20.0, rel=1e-4)
    assert math.isnan(Evaluation((episode(1.0),)).return_margin)
    assert Evaluation((episode(1.0),)).summary()["return_margin_95"] is None


def test_wilsons_interval_holds_the_rates_that_a_score_test_does_not_reject() -> None:
    count, successes = 40, 37
    found = Evaluation(tuple(episode(0.0, success=index < successes) for index in range(count)))
    rate = successes / count
    assert found.success_rate == rate
    assert found.success_interval is not None
    for bound in found.success_interval:
        assert abs(rate - bound) / math.sqrt(bound * (1 - bound) / count) == pytest.approx(1.96, abs=1e-3)
    assert Evaluation((episode(0.0),)).success_interval is None


def test_an_rmse_is_pooled_over_all_steps() -> None:
    generator = np.random.default_rng(1)
    errors = [generator.normal(size=size) for size in (3, 50)]
    found = Evaluation(
        tuple(episode(0.0, len(e), error_rmse=float(np.sqrt(np.mean(e**2))), progress=len(e)) for e in errors)
    )
    assert found.measures["error_rmse"] == pytest.approx(float(np.sqrt(np.mean(np.concatenate(errors) ** 2))))
    assert found.measures["progress"] == 26.5


@pytest.mark.parametrize(("name", "value"), [("episodes", 0), ("episodes", 1.5), ("threads", 0)])
def test_impossible_numbers_are_refused(name: str, value: Any) -> None:
    with pytest.raises(InvalidInputError, match=name):
        evaluate(make_policy(**TASK), TRACKING, **{"episodes": 1, name: value})


def test_a_policy_that_observes_otherwise_is_refused() -> None:
    with pytest.raises(InvalidInputError, match="22 numbers"):
        evaluate(make_policy(observe_terrain=True), TRACKING, episodes=1)


def test_an_environment_goes_by_its_id_and_two_short_names() -> None:
    assert {environment_id(n) for n in ("grouser/PathTracking-v0", "PathTracking-v0", "path-tracking")} == {TRACKING.id}
    assert [environment_id(short_name(id)) for id in environment_ids()] == list(environment_ids())
    with pytest.raises(ConfigurationError, match="did you mean 'speed-tracking'"):
        environment_id("speed-trackin")


def test_arguments_must_be_what_json_holds() -> None:
    from grouser.envs.paths import straight

    with pytest.raises(InvalidInputError, match="backend_options"):
        TRACKING.changed(path=straight()).facts()


def test_a_wrong_argument_is_named_by_every_way_to_make_the_environment() -> None:
    wrong = TRACKING.changed(action_mod="twist")
    for make in (wrong.make, wrong.facts, lambda: wrong.make_batch(2), lambda: wrong.make_vec_env(2)):
        with pytest.raises(ConfigurationError, match="did you mean 'action_mode'"):
            make()
