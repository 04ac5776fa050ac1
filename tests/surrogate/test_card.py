"""The model card says of an artifact what it holds, and no more."""

import pytest

from grouser.surrogate import Surrogate, model_card, shipped_names
from grouser.terrain import OUTPUT_NAMES, interface


@pytest.mark.parametrize("name", shipped_names())
def test_a_shipped_artifact_has_a_whole_card(name: str) -> None:
    surrogate = Surrogate.load(name)
    card = model_card(surrogate, name)
    assert card.startswith(f"# {name}\n")
    for expected in (
        surrogate.content_hash,
        surrogate.dataset_hash,
        "## Recipe",
        "## Unseen runs",
        "## Known failures",
    ):
        assert expected in card
    for output in OUTPUT_NAMES:
        assert f"{surrogate.metrics['test'][output]['r2']:.5f}" in card
    for column, low in zip(interface(surrogate.mode).inputs, surrogate.detector.low, strict=True):
        assert f"| {column.name} | {column.unit} | {low:.4g} |" in card
    for maneuver in surrogate.metrics["maneuvers"]:
        assert f"| {maneuver} |" in card


def test_what_an_artifact_does_not_hold_is_left_out() -> None:
    bare = Surrogate.load(shipped_names()[0]).with_metrics({})
    card = model_card(bare, "bare")
    assert "## Unseen runs" not in card
    assert "Worst unseen run" not in card
    assert "## Where to trust it" in card
