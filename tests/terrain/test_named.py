"""Grounds by name, against the published tables."""

import math

import pytest

from grouser.terrain import (
    ConfigurationError,
    RigidTerrain,
    SoilTerrain,
    named,
    parameter_ranges,
    resolve_terrain,
    terrain_names,
)

SOILS = {  # c in kPa, phi in degrees, as printed
    "dry-sand": (1.04, 28.0),
    "sandy-loam-15": (1.72, 29.0),
    "sandy-loam-22": (1.38, 38.0),
    "sandy-loam-11": (4.83, 20.0),
    "clayey-soil-38": (4.14, 13.0),
    "clayey-soil-55": (2.07, 10.0),
    "heavy-clay-25": (68.95, 34.0),
    "heavy-clay-40": (20.69, 6.0),
    "lete-sand": (1.3, 31.1),
    "upland-sandy-loam": (3.3, 33.7),
    "rubicon-loam": (3.7, 29.8),
    "north-gower-clayey-loam": (6.1, 26.6),
    "grenville-loam": (3.1, 29.8),
    "snow-us": (1.03, 19.7),
    "snow-harrison": (0.62, 23.2),
    "snow-sweden": (6.0, 20.7),
}

GROUNDS = {  # θ in SI units, to the bit; whether it lies in the wide and in the paper ranges
    "asphalt": ((0.8, 0.03, 0.025), True, True),
    "clayey-soil-38": ((4140.0, 0.22689280275926285, 0.09, 0.006), True, True),
    "clayey-soil-55": ((2070.0, 0.17453292519943295, 0.1, 0.006), True, True),
    "concrete-rubber-pads": ((0.9, 0.03, 0.025), True, True),
    "concrete-steel": ((0.5, 0.03, 0.025), True, True),
    "dry-sand": ((1040.0, 0.4886921905584123, 0.13, 0.012), True, False),
    "gravel": ((0.6, 0.06, 0.025), True, True),
    "grenville-loam": ((3100.0, 0.5201081170943103, 0.09, 0.025), True, False),
    "hard-ground": ((0.6, 0.06, 0.025), True, True),
    "heavy-clay-25": ((68950.0, 0.5934119456780721, 0.08, 0.006), True, False),
    "heavy-clay-40": ((20690.0, 0.10471975511965978, 0.1, 0.006), True, False),
    "ice": ((0.1, 0.03, 0.025), True, False),
    "lete-sand": ((1300.0, 0.5427973973702365, 0.13, 0.012), True, False),
    "north-gower-clayey-loam": ((6100.0, 0.4642575810304917, 0.09, 0.025), True, False),
    "rubicon-loam": ((3700.0, 0.5201081170943103, 0.09, 0.025), True, False),
    "sandy-loam-11": ((4830.0, 0.3490658503988659, 0.09, 0.025), True, True),
    "sandy-loam-15": ((1720.0, 0.5061454830783556, 0.09, 0.025), True, False),
    "sandy-loam-22": ((1380.0, 0.6632251157578453, 0.09, 0.025), True, False),
    "snow-harrison": ((620.0, 0.40491638646268446, 0.17, 0.04), True, False),
    "snow-packed": ((0.16, 0.15, 0.04), True, False),
    "snow-sweden": ((6000.0, 0.3612831551628262, 0.17, 0.04), True, False),
    "snow-us": ((1030.0, 0.3438298626428829, 0.17, 0.04), True, False),
    "upland-sandy-loam": ((3300.0, 0.5881759579220891, 0.09, 0.025), True, False),
}


def test_every_named_ground_says_what_it_is_and_whether_training_ranges_hold_it() -> None:
    found = {
        name: (
            tuple(named(name).parameters.tolist()),
            *(parameter_ranges(ranges, named(name).mode).contains(named(name)) for ranges in ("wide", "paper")),
        )
        for name in terrain_names()
    }
    assert found == GROUNDS


@pytest.mark.parametrize("name", SOILS)
def test_soils_hold_the_published_strength_in_si_units(name: str) -> None:
    soil = named(name)
    assert isinstance(soil, SoilTerrain)
    cohesion, angle = SOILS[name]
    assert soil.c == pytest.approx(cohesion * 1e3, rel=1e-12)
    assert soil.phi == pytest.approx(math.radians(angle), rel=1e-12)


@pytest.mark.parametrize(
    ("kind", "low", "high"), [("sand", 0.01, 0.025), ("clay", 0.005, 0.007), ("snow", 0.025, 0.05)]
)
def test_shear_moduli_lie_in_the_published_range_of_their_kind(kind: str, low: float, high: float) -> None:
    of_kind = {
        "sand": ("dry-sand", "lete-sand"),
        "clay": ("heavy-clay-25", "heavy-clay-40", "clayey-soil-38"),
        "snow": ("snow-us", "snow-harrison", "snow-sweden"),
    }
    assert all(low <= named(name).k <= high for name in of_kind[kind])


def test_lete_sand_has_its_measured_modulus() -> None:
    assert named("lete-sand").k == 0.012


@pytest.mark.parametrize(
    ("name", "low", "high"),
    [
        ("concrete-rubber-pads", 0.90, 0.90),
        ("concrete-steel", 0.50, 0.50),
        ("asphalt", 0.7, 0.9),
        ("gravel", 0.6, 0.6),
        ("hard-ground", 0.55, 0.65),
        ("snow-packed", 0.12, 0.20),
        ("ice", 0.10, 0.15),
    ],
)
def test_firm_grounds_hold_a_friction_of_the_published_range(name: str, low: float, high: float) -> None:
    ground = named(name)
    assert isinstance(ground, RigidTerrain)
    assert low <= ground.mu <= high


@pytest.mark.parametrize(
    ("name", "low", "high"),
    [
        ("asphalt", 0.02, 0.045),
        ("hard-ground", 0.06, 0.07),
        ("sandy-loam-15", 0.08, 0.10),
        ("dry-sand", 0.12, 0.15),
        ("lete-sand", 0.12, 0.15),
        ("snow-us", 0.15, 0.20),
        ("snow-packed", 0.15, 0.20),
    ],
)
def test_rolling_resistance_lies_in_the_published_range(name: str, low: float, high: float) -> None:
    assert low <= named(name).fr <= high


def test_the_names_are_sorted_and_all_resolve() -> None:
    assert list(terrain_names()) == sorted(terrain_names())
    assert {named(name).mode for name in terrain_names()} == {"rigid", "soil"}


def test_an_unknown_ground_is_answered_with_the_nearest() -> None:
    with pytest.raises(ConfigurationError, match="did you mean 'lete-sand'"):
        named("leta-sand")


def test_a_terrain_is_resolved_from_its_name_or_itself() -> None:
    assert resolve_terrain("ice") == named("ice")
    ground = RigidTerrain(0.5)
    assert resolve_terrain(ground) is ground
