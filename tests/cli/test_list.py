"""What has a name is listed; of one vehicle or ground, where every number comes from."""

from pathlib import Path
from typing import Any

import pytest

from grouser.controllers import load_policy, shipped_policies
from grouser.envs import path_names
from grouser.terrain import Sheet, backend_names, terrain_names, terrain_sheet, vehicle_names, vehicle_sheet

GROUND = """
[references.guess]
text = "a guess [of mine]"
kind = "assumed"

[yard]
mu = { value = 1.2, source = "guess" }
fr = { value = 0.05, source = "guess" }
k = { value = 0.02, source = "guess" }
"""


@pytest.fixture
def ground(tmp_path: Path) -> Path:
    """A ground outside of the training ranges, in a file of another name."""
    file = tmp_path / "ground.toml"
    file.write_text(GROUND, encoding="utf-8")
    return file


def row(out: str, name: str) -> list[str]:
    """Return the cells of the row that starts with a name."""
    (found,) = (line.split() for line in out.splitlines() if line.split()[:1] == [name])
    return found


def test_vehicles_are_listed_with_their_numbers_and_marks(call: Any) -> None:
    out = call("list", "vehicles").out
    assert row(out, "m113")[-10:] == ["11300", "37300", "2.667", "2.159", "0.38", "5", "18*", "6", "of", "16"]
    assert row(out, "ugv")[-10:-8] == ["4500†", "6500†"]
    assert all(vehicle_sheet(name).summary in " ".join(row(out, name)) for name in vehicle_names())
    assert "* assumed, † synthetic" in out


def test_terrains_are_listed_with_mode_ranges_and_parameters(call: Any) -> None:
    out = call("list", "terrains").out
    assert row(out, "ice")[-8:] == ["rigid", "yes", "no", "0.1*", "–", "–", "0.03*", "0.025*"]
    assert row(out, "lete-sand")[-8:] == ["soil", "yes", "no", "–", "1.3", "31.1", "0.13*", "0.012"]
    assert all(terrain_sheet(name).summary in " ".join(row(out, name)) for name in terrain_names())


@pytest.mark.parametrize(
    ("what", "sheet"), [("vehicles", vehicle_sheet("warthog")), ("terrains", terrain_sheet("lete-sand"))]
)
def test_of_one_every_number_comes_with_unit_kind_and_source(call: Any, what: str, sheet: Sheet) -> None:
    out = call("list", what, sheet.name).out
    assert sheet.summary in out
    for number in sheet.numbers:
        rest = " ".join(row(out, number.name)[1:])
        assert rest == " ".join(f"{number.value:.10g} {number.unit} {number.kind} {number.source}".split())


def test_of_one_it_says_what_else_matters(call: Any) -> None:
    assert "contact    per_wheel" in call("list", "vehicles", "warthog").out
    assert "synthetic  yes" in call("list", "vehicles", "ugv").out
    out = call("list", "terrains", "ice").out
    assert "in wide ranges   yes" in out
    assert "in paper ranges  no" in out


def test_a_file_of_the_users_is_shown_as_a_name_is(call: Any, ground: Path) -> None:
    out = call("list", "terrains", ground).out
    assert row(out, "mu") == ["mu", "1.2", "assumed", "a", "guess", "[of", "mine]"]
    assert "in wide ranges   no" in out
    assert "did you mean 'asphalt'" in call("list", "terrains", "asfalt", code=2).err


def test_backends_and_paths_are_listed_one_a_line(call: Any) -> None:
    assert call("list", "backends").out.splitlines() == list(backend_names())
    assert call("list", "paths").out.splitlines() == list(path_names())


def test_policies_are_listed_with_what_they_were_trained_in(call: Any) -> None:
    out = call("list", "policies").out
    for name in shipped_policies():
        policy = load_policy(name)
        _, environment, algorithm, vehicle, *trained_on, sealed, steps, _ = row(out, name)
        assert environment == policy.environment["id"]
        assert (algorithm, vehicle) == (policy.architecture.algorithm, policy.environment["vehicle"]["name"])
        assert " ".join(trained_on).startswith(f"native, {policy.environment['arguments']['terrain']}")
        assert policy.content_hash.startswith(sealed)
        assert int(steps) == policy.recipe["steps"]


def test_verbs_take_files_and_call_rows_after_them(call: Any, ground: Path, short_path: Path, tmp_path: Path) -> None:
    options = ("--controller", "pure-pursuit", "--path", short_path, "--vehicle", "warthog", "--speed", 2)
    assert "100 % of short" in call("drive", "--backend", "physics", "--terrain", ground, *options).out
    grounds = f"{ground},{ground}#yard,asphalt"
    call("compare", "--terrain", grounds, "--backends", "physics", *options, "--output", tmp_path / "out")
    assert {file.name for file in (tmp_path / "out").glob("*.png")} == {
        "ground-pure-pursuit.png", "yard-pure-pursuit.png", "asphalt-pure-pursuit.png",
    }  # fmt: skip
    twice = call("compare", "--terrain", f"{ground},{tmp_path}/../{tmp_path.name}/ground.toml", *options, code=2).err
    assert "two grounds of one name" in twice
