"""Catalogues: every number has a source, a user's file works wherever a name does, and what is wrong is named."""

import math
import re
from dataclasses import fields
from pathlib import Path

import gymnasium
import pytest

from grouser.envs import Simulator
from grouser.terrain import (
    ConfigurationError,
    InvalidInputError,
    RigidTerrain,
    Sheet,
    SoilTerrain,
    TrackedVehicle,
    make_backend,
    named,
    read_terrains,
    read_vehicles,
    resolve_ground,
    resolve_terrain,
    resolve_vehicle,
    terrain_names,
    terrain_sheet,
    vehicle_names,
    vehicle_sheet,
)
from grouser.terrain.catalogue import UNITS
from grouser.terrain.catalogue_file import KINDS

PAGE = Path(__file__).parents[2] / "docs" / "vehicles-and-terrains.md"
GROUND = """
[references.guess]
text = "a guess"
kind = "assumed"

[peat]
c_kpa = { value = 2, source = "guess" }
phi_deg = { value = 25.0, source = "guess" }
fr = { value = 0.15, source = "guess" }
k = { value = 0.03, source = "guess" }
"""
OTHER = """
[mine]
mode = "rigid"
summary = "a yard"
mu = { value = 0.7, source = "guess" }
fr = { value = 0.05, source = "guess" }
k = { value = 0.02, source = "guess" }
"""


@pytest.fixture
def examples(tmp_path: Path) -> tuple[Path, Path]:
    """The vehicle and the ground of the documentation, each as a file."""
    blocks = re.findall(r"```toml\n(.*?)```", PAGE.read_text(encoding="utf-8"), flags=re.DOTALL)
    assert len(blocks) == 2
    made = (tmp_path / "vehicle.toml", tmp_path / "ground.toml")
    for file, block in zip(made, blocks, strict=True):
        file.write_text(block, encoding="utf-8")
    return made


def ground_file(folder: Path, text: str) -> Path:
    file = folder / "ground.toml"
    file.write_text(text, encoding="utf-8")
    return file


def sheets() -> list[Sheet]:
    return [*map(vehicle_sheet, vehicle_names()), *map(terrain_sheet, terrain_names())]


@pytest.mark.parametrize("sheet", sheets(), ids=lambda sheet: sheet.name)
def test_every_shipped_number_has_a_unit_a_source_and_a_kind(sheet: Sheet) -> None:
    assert sheet.summary
    for number in sheet.numbers:
        assert number.unit == UNITS[number.name]
        assert number.source.strip()
        assert number.kind in KINDS


def test_a_shipped_vehicle_leaves_no_number_to_a_default() -> None:
    words = {"name", "contact", "source", "synthetic"}
    numbers = {field.name for field in fields(TrackedVehicle)} - words
    for name in vehicle_names():
        assert numbers - set(vehicle_sheet(name).values) <= {"patch_length", "hull_length", "hull_width"}
    assert set(vehicle_sheet("warthog").values) == numbers


def test_numbers_come_in_one_order_and_sources_once(tmp_path: Path) -> None:
    file = ground_file(tmp_path, GROUND)
    assert list(terrain_sheet(file).values) == ["c_kpa", "phi_deg", "fr", "k"]
    assert terrain_sheet(file).sources == ("a guess",)


def test_the_examples_of_the_documentation_work_wherever_a_name_does(examples: tuple[Path, Path]) -> None:
    vehicle, ground = map(str, examples)
    mine, field = TrackedVehicle.preset(vehicle), named(ground)
    assert (mine.name, mine.mass, mine.road_wheels, mine.contact) == ("rover", 320.0, 3, "per_wheel")
    assert mine.synthetic is False
    assert mine.source.startswith("weighed and measured")
    assert field == SoilTerrain(c=2500.0, phi=math.radians(29.8), fr=0.09, k=0.025)
    assert mine == resolve_vehicle(vehicle) == resolve_vehicle(examples[0]) == resolve_vehicle(f"{vehicle}#rover")
    assert field == resolve_terrain(ground) == resolve_ground(ground) == named(examples[1]) == named(f"{ground}#field")
    backend = make_backend("physics", mode="soil", vehicle=vehicle)
    assert backend.vehicle == mine
    simulator = Simulator(vehicle, backend, ground)
    assert (simulator.vehicle, simulator.ground) == (mine, field)
    environment = gymnasium.make("grouser/PathTracking-v0", backend="physics", vehicle=vehicle, terrain=ground)
    environment.reset(seed=0)
    environment.step(environment.action_space.sample())
    environment.close()


def test_a_path_is_a_file_whatever_its_suffix(tmp_path: Path) -> None:
    file = tmp_path / "grounds.txt"
    file.write_text(GROUND, encoding="utf-8")
    assert named(file) == SoilTerrain(c=2000.0, phi=math.radians(25.0), fr=0.15, k=0.03)
    with pytest.raises(ConfigurationError, match="unknown terrain"):
        named(str(file))


def test_a_file_of_several_is_asked_for_one(tmp_path: Path) -> None:
    file = ground_file(tmp_path, GROUND + OTHER)
    assert set(read_terrains(file)) == {"peat", "mine"}
    assert named(f"{file}#mine") == RigidTerrain(0.7, 0.05, 0.02)
    assert named(Path(f"{file}#peat")).mode == "soil"
    with pytest.raises(
        ConfigurationError, match=r"several terrains, peat, mine: ask for one, such as .*ground.toml#peat"
    ):
        named(str(file))
    with pytest.raises(ConfigurationError, match=r"unknown terrain of .*ground.toml 'pete'; did you mean 'peat'"):
        named(f"{file}#pete")


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ('fr = { value = 0.15, source = "guess" }', "fr = 0.15", r"\[peat\], fr must be { value = NUMBER, source"),
        ('0.15, source = "guess"', "0.15", r"\[peat\], fr has no source: name a key of \[references\]"),
        ('0.15, source = "guess"', '0.15, source = "gess"', r"\[peat\], fr: unknown reference 'gess'; .* 'guess'"),
        ('0.15, source = "guess"', "0.15, source = 3", r"\[peat\], fr, source must be text in quotes, got 3"),
        ('0.15, source = "guess"', '0.15, sauce = "guess"', r"\[peat\], fr: unknown key 'sauce'; .* 'source'"),
        ("value = 0.15", 'value = "0.15"', r"\[peat\], fr, value must be a finite number, got '0.15'"),
        ("value = 0.15", "value = true", r"\[peat\], fr, value must be a finite number, got True"),
        ("value = 0.15", "value = nan", r"\[peat\], fr, value must be a finite number, got nan"),
        ("value = 0.15, ", "", r"\[peat\], fr, value must be a finite number, got None"),
        ("value = 0.15", "value = 1.5", r"ground.toml: fr must lie in \[0, 1\], got 1.5"),
        ("phi_deg", "fi_deg", r"\[peat\]: unknown key of a soil 'fi_deg'; did you mean 'phi_deg'"),
        ("phi_deg = {", "# {", r"\[peat\] lacks phi_deg: a soil needs c_kpa, phi_deg, fr, k"),
        ("c_kpa", "mu", r"\[peat\]: unknown key of a rigid ground 'phi_deg'"),
        ("[peat]", '[peat]\nmode = "rigid"', r"\[peat\]: mode is 'rigid', but the keys are those of 'soil' ground"),
        ("[peat]", '[peat]\nmode = "soul"', r"\[peat\]: unknown mode 'soul'; did you mean 'soil'"),
        ("[peat]", "[peat]\nsummary = 3", r"\[peat\], summary must be text in quotes, got 3"),
        ("[peat]", "weather = 3\n[peat]", r"unknown key 'weather'"),
        ('kind = "assumed"', 'kind = "asumed"', r"\[references.guess\]: unknown kind 'asumed'; did you mean 'assumed'"),
        ('kind = "assumed"', "", r"\[references.guess\] lacks kind"),
        ('text = "a guess"', 'text = ""', r"\[references.guess\], text must be text in quotes, got ''"),
        ("[peat]", "[peat", r"ground.toml is not TOML: .*line 6"),
        (GROUND, "", r"ground.toml holds no terrain: give it a table"),
        (GROUND, "peat = 3", r"\[peat\] must be a table, got 3"),
        (GROUND, "[peat]\nmv = 1", r"\[peat\]: unknown key 'mv'; did you mean 'mu'"),
        (GROUND, '[peat]\nsummary = "wet"', r"\[peat\] needs mu, of rigid ground, or c_kpa and phi_deg, of soil"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said_by_file_table_and_key(tmp_path: Path, old: str, new: str, expected: str) -> None:
    assert old in GROUND
    file = ground_file(tmp_path, GROUND.replace(old, new))
    with pytest.raises((InvalidInputError, ConfigurationError), match=expected) as caught:
        named(file)
    assert str(caught.value).startswith(str(file))


def test_a_file_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match=r"cannot read .*none.toml: No such file"):
        TrackedVehicle.preset(str(tmp_path / "none.toml"))
    binary = tmp_path / "binary.toml"
    binary.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InvalidInputError, match=r"binary.toml is not TOML"):
        read_vehicles(binary)


def test_an_impossible_vehicle_is_refused_with_its_file(examples: tuple[Path, Path]) -> None:
    vehicle = examples[0]
    text = vehicle.read_text(encoding="utf-8")
    vehicle.write_text(text.replace('"per_wheel"', '"per_weel"'), encoding="utf-8")
    with pytest.raises(ConfigurationError, match=r"vehicle.toml: unknown contact option 'per_weel'; .* 'per_wheel'"):
        TrackedVehicle.preset(vehicle)
    vehicle.write_text(text.replace("value = 3,", "value = 2.5,"), encoding="utf-8")
    with pytest.raises(InvalidInputError, match=r"vehicle.toml: road_wheels must be a whole number .*, got 2.5"):
        TrackedVehicle.preset(vehicle)
