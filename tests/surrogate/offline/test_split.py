"""Runs are split, never samples; each side has every maneuver."""

import json
from collections import Counter

import pytest

from grouser.surrogate.offline.maneuvers import MANEUVERS
from grouser.surrogate.offline.manifest import RunRecord
from grouser.surrogate.offline.split import RunSplit, split_runs
from grouser.terrain import InvalidInputError


def table(runs: int) -> list[RunRecord]:
    return [RunRecord(run, MANEUVERS[run % 6], {"mu": 0.5}, {}, 10, 0) for run in range(runs)]


def sides(split: RunSplit) -> tuple[tuple[int, ...], ...]:
    return split.train, split.validation, split.test


@pytest.mark.parametrize("runs", [18, 19, 24, 60, 301])
@pytest.mark.parametrize("seed", [0, 7])
def test_sides_are_disjoint_sorted_and_cover_every_run(runs: int, seed: int) -> None:
    split = split_runs(table(runs), seed=seed)
    together = [run for side in sides(split) for run in side]
    assert sorted(together) == list(range(runs))
    assert all(list(side) == sorted(side) for side in sides(split))


@pytest.mark.parametrize("runs", [18, 24, 60, 300])
def test_each_side_has_every_maneuver(runs: int) -> None:
    records = table(runs)
    for side in sides(split_runs(records)):
        assert {records[run].maneuver for run in side} == set(MANEUVERS)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_three_hundred_runs_split_as_in_the_paper(seed: int) -> None:
    split = split_runs(table(300), seed=seed)
    assert [len(side) for side in sides(split)] == [210, 45, 45]


def test_shares_hold_for_every_maneuver() -> None:
    records = table(120)
    split = split_runs(records, validation=0.2, test=0.1)
    counts = [Counter(records[run].maneuver for run in side) for side in sides(split)]
    assert counts == [dict.fromkeys(MANEUVERS, share) for share in (14, 4, 2)]


def test_three_runs_of_a_maneuver_go_one_to_each_side() -> None:
    assert [len(side) for side in sides(split_runs(table(18), validation=0.45, test=0.45))] == [6, 6, 6]


def test_the_seed_decides_and_the_order_of_the_table_does_not() -> None:
    records = table(60)
    assert split_runs(records, seed=4) == split_runs(list(reversed(records)), seed=4)
    assert split_runs(records, seed=4) != split_runs(records, seed=5)


def test_it_is_not_in_the_order_of_generation() -> None:
    split = split_runs(table(60))
    assert max(split.train) > min(split.test)
    assert max(split.test) > min(split.train)


@pytest.mark.parametrize("runs", [1, 6, 12, 17])
def test_too_few_runs_of_a_maneuver_are_refused(runs: int) -> None:
    with pytest.raises(InvalidInputError, match=r"maneuver '\w+' has [12] runs"):
        split_runs(table(runs))


def test_no_runs_at_all_are_refused() -> None:
    with pytest.raises(InvalidInputError):
        split_runs([])


@pytest.mark.parametrize(
    ("validation", "test"),
    [(0.0, 0.15), (0.15, 0.0), (0.5, 0.5), (-0.1, 0.2), (1.0, 0.1), (float("nan"), 0.1), (0.1, float("nan"))],
)
def test_shares_that_leave_a_side_empty_are_refused(validation: float, test: float) -> None:
    with pytest.raises(InvalidInputError, match="shares"):
        split_runs(table(18), validation=validation, test=test)


def test_json_holds_it() -> None:
    split = split_runs(table(18))
    loaded = json.loads(json.dumps(split.to_dict()))
    assert RunSplit(**{name: tuple(side) for name, side in loaded.items()}) == split
