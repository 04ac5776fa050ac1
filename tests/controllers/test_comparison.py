"""The same drives on several backends: rows held against the logs behind them, against closed forms, and repeats."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, fields, replace
from typing import Any, ClassVar

import numpy as np
import pytest
from grounds import stepped

from grouser.controllers import (
    ComparisonRow,
    Drive,
    MPCConfig,
    PathTrackingMPC,
    PurePursuit,
    PurePursuitConfig,
    Scenario,
    SlipParameters,
    Solution,
    SolveRecord,
    compare,
    document,
    without_times,
)
from grouser.controllers.scenario import start_state
from grouser.envs import BeltCommand, Corridor, Driver, Lane, Path, VehicleState
from grouser.envs.paths import figure_eight, straight
from grouser.terrain import (
    ConfigurationError,
    Detection,
    FloatArray,
    ForceBackend,
    Ground,
    GuardedBackend,
    InvalidInputError,
    Mode,
    PhysicsBackend,
    RigidTerrain,
    TrackedVehicle,
    named,
    register_backend,
)

M113 = TrackedVehicle.preset("m113")
ASPHALT = named("asphalt")
SLIPPERY = RigidTerrain(mu=0.3)
SHORT = straight(8.0)
# One bend to the left, so that headings differ, too.
BEND = Path.from_points("bend", [[0.0, 0.0], [6.0, 0.0], [11.0, 2.0], [14.0, 6.0]])
# The row that design.md promises.
CONTRACT = {
    "scenario", "terrain", "controller", "backend", "seed", "cross_track_rmse_m", "final_position_difference_m",
    "final_heading_difference_rad", "force_r2", "first_move_difference_rms", "fallback_rate", "force_call_ns",
    "deadline_misses",
}  # fmt: skip


class Scaled(ForceBackend):
    """Physics times a factor."""

    name: ClassVar[str] = "test-scaled"

    def __init__(self, vehicle: TrackedVehicle, mode: Mode, *, factor: float = 1.02) -> None:
        super().__init__(vehicle, mode)
        self.factor = factor
        self._physics = PhysicsBackend(vehicle, mode)

    def forces(self, x: FloatArray) -> FloatArray:
        return self.factor * self._physics.forces(x)

    def forces_and_jacobian(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        forces, jacobian = self._physics.forces_and_jacobian(x)
        return self.factor * forces, self.factor * jacobian


class BreaksOnSlippery(Scaled):
    """Physics that knows no slippery ground."""

    name: ClassVar[str] = "test-breaks"

    def __init__(self, vehicle: TrackedVehicle, mode: Mode, *, value: float = math.nan) -> None:
        super().__init__(vehicle, mode, factor=1.0)
        self.value = value

    def forces_and_jacobian(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        forces, jacobian = super().forces_and_jacobian(x)
        slippery = np.asarray(x)[..., self.interface.index("mu")] < 0.5
        return np.where(slippery[..., None], self.value, forces), jacobian

    def forces(self, x: FloatArray) -> FloatArray:
        return self.forces_and_jacobian(x)[0]


class RunsAway(ForceBackend):
    """Pushes a vehicle slower than 10 m/s back, the harder the slower: it leaves backwards, ever faster."""

    name: ClassVar[str] = "test-runs-away"

    def forces(self, x: FloatArray) -> FloatArray:
        x = self.interface.check(x)
        surplus = x[..., :3] - np.array([10.0, 0.0, 0.0])
        forces: FloatArray = 10.0 * surplus * [self.vehicle.mass, self.vehicle.mass, self.vehicle.yaw_inertia]
        return forces


class SlipperyIsStrange:
    """A detector that knows no slippery ground."""

    def score(self, x: FloatArray) -> FloatArray:
        return np.where(np.asarray(x)[:, 7] < 0.5, 3.0, 0.1)

    def detect(self, row: FloatArray) -> Detection:
        score = float(self.score(row[None])[0])
        return Detection(score, "distance" if score > 1 else "none", "mu")


def _guard(vehicle: TrackedVehicle, mode: Mode) -> GuardedBackend:
    return GuardedBackend(Scaled(vehicle, mode), PhysicsBackend(vehicle, mode), SlipperyIsStrange())


register_backend("test-scaled", Scaled)
register_backend("test-twin", PhysicsBackend)
register_backend("test-breaks", BreaksOnSlippery)
register_backend("test-runs-away", RunsAway)
register_backend("test-guard", _guard)


class Strip:
    """Asphalt, but for a slippery strip across the x axis."""

    mode: Mode = "rigid"

    def __init__(self, begin: float, end: float) -> None:
        self.begin, self.end = begin, end

    def parameters_at(self, x: float, y: float) -> FloatArray:
        return (SLIPPERY if self.begin <= x < self.end else ASPHALT).parameters

    def gradient_at(self, x: float, y: float) -> tuple[float, float]:
        return 0.0, 0.0


class Cruise:
    """Holds both belts at a speed."""

    def __init__(self, speed: float = 5.0, pause: float = 0.0) -> None:
        self.speed, self.pause = speed, pause

    def reset(self) -> None:
        pass

    def command(self, state: VehicleState) -> BeltCommand:
        time.sleep(self.pause)
        return BeltCommand(self.speed, self.speed)


class Records(Cruise):
    """Says of some of its solves that they failed."""

    def __init__(self, failures: Sequence[int]) -> None:
        super().__init__()
        self.failures = failures
        self.records: list[SolveRecord] = []

    def reset(self) -> None:
        self.records = []

    def command(self, state: VehicleState) -> BeltCommand:
        command = super().command(state)
        success = len(self.records) not in self.failures
        move, action = (command, None) if success else (None, "brake")
        status = "Solve_Succeeded" if success else "Infeasible_Problem_Detected"
        self.records.append(
            SolveRecord(state.time, status, success, 3, 1.0, move, command, action, 0.001)  # type: ignore[arg-type]
        )
        return command


def scenario(
    path: Path = SHORT,
    ground: Ground = ASPHALT,
    drivers: dict[str, Callable[[], Driver]] | None = None,
    name: str = "yard",
    **settings: Any,
) -> Scenario:
    drivers = drivers if drivers is not None else {"pursuit": lambda: PurePursuit(path, M113, 5.0)}
    return Scenario(name, "asphalt", ground, path, M113, 5.0, drivers, **settings)


def by_backend(drives: Sequence[Drive]) -> dict[str, Drive]:
    return {drive.row.backend: drive for drive in drives}


@pytest.fixture(scope="module")
def bent() -> dict[str, Drive]:
    """A bend on physics, on its twin, and on physics at four fifths."""
    options = {"test-scaled": {"factor": 0.8}}
    return by_backend(compare([scenario(BEND, backend_options=options)], ["test-scaled", "test-twin"]))


def test_rows_hold_the_fields_of_the_contract(bent: dict[str, Drive]) -> None:
    rows = document(list(bent.values()), {})["rows"]
    for row in rows:
        assert set(row) >= CONTRACT
        assert set(row) == {field.name for field in fields(ComparisonRow)}
        assert len(row["force_r2"]) == 3
    assert [row["backend"] for row in rows] == ["physics", "test-scaled", "test-twin"]


@pytest.mark.parametrize("name", ["physics", "test-twin"])
def test_physics_held_against_itself_shows_no_difference(bent: dict[str, Drive], name: str) -> None:
    row = bent[name].row
    assert row.finished
    assert row.final_position_difference_m == 0.0
    assert row.final_heading_difference_rad == 0.0
    assert row.first_move_difference_rms == 0.0
    assert row.force_r2 == pytest.approx([1.0, 1.0, 1.0], abs=1e-12)
    assert (row.failed_solves, row.fallback_rate, row.switches) == (0, 0.0, 0)


@pytest.mark.parametrize("factor", [0.8, 1.02])
def test_r2_is_against_physics_at_the_inputs_of_the_drive_itself(factor: float) -> None:
    options = {"test-scaled": {"factor": factor}}
    drive = compare([scenario(BEND, backend_options=options)], ["test-scaled"])[1]
    # What the physics says there is what was logged, over the factor.
    truth = drive.log.forces / factor
    error = np.sum((drive.log.forces - truth) ** 2, axis=0)
    r2 = 1.0 - error / np.sum((truth - truth.mean(axis=0)) ** 2, axis=0)
    assert drive.row.force_r2 == pytest.approx(r2.tolist(), rel=1e-9)
    assert all(value is not None and value < 1.0 for value in drive.row.force_r2)


def test_r2_is_none_where_physics_does_not_vary() -> None:
    # At rest, and staying there.
    still = replace(scenario(drivers={"cruise": lambda: Cruise(0.0)}, time_limit=0.5), speed=0.0)
    drives = compare([still], ["test-scaled"])
    for drive in drives:
        assert np.all(drive.log.forces == 0.0)
        assert drive.row.force_r2 == [None, None, None]
        assert not drive.row.finished
    json.dumps(document(drives, {}), allow_nan=False)


def test_final_differences_are_those_of_the_logs_when_the_shorter_drive_ended(bent: dict[str, Drive]) -> None:
    physics, scaled = bent["physics"].log, bent["test-scaled"].log
    last = min(len(physics), len(scaled))
    x, y = (scaled.state(name)[last] - physics.state(name)[last] for name in ("x", "y"))
    heading = scaled.state("heading")[last] - physics.state("heading")[last]
    row = bent["test-scaled"].row
    assert row.final_position_difference_m == pytest.approx(math.sqrt(x * x + y * y), rel=1e-12)
    assert row.final_heading_difference_rad == pytest.approx(abs(heading), rel=1e-12)
    assert row.final_position_difference_m > 1e-3
    assert row.final_heading_difference_rad > 1e-4


def test_drives_of_unequal_length_are_compared_at_the_end_of_the_shorter() -> None:
    # Slippery ground lets the weak backend fall behind: both stop at the path's end, at different times.
    uneven = scenario(
        straight(12.0),
        drivers={"rush": lambda: Cruise(9.0)},
        backend_options={"test-scaled": {"factor": 0.1}},
    )
    physics, scaled = compare([uneven], ["test-scaled"])
    assert len(physics.log) < len(scaled.log)
    last = len(physics.log)
    gap = scaled.log.states[last, :2] - physics.log.states[last, :2]
    assert scaled.row.final_position_difference_m == pytest.approx(float(np.hypot(*gap)), rel=1e-12)
    assert scaled.row.finished


def test_first_moves_are_compared_at_control_instants_over_the_training_speed(bent: dict[str, Drive]) -> None:
    physics, scaled = bent["physics"].log, bent["test-scaled"].log
    squares = [
        (scaled.commands[i, 0] - physics.commands[i, 0]) ** 2 + (scaled.commands[i, 1] - physics.commands[i, 1]) ** 2
        for i in range(0, min(len(physics), len(scaled)), 10)
    ]
    expected = math.sqrt(sum(squares) / len(squares)) / M113.training_speed
    assert expected > 0
    assert bent["test-scaled"].row.first_move_difference_rms == pytest.approx(expected, rel=1e-12)


def test_cross_track_error_of_a_straight_path_is_y() -> None:
    for drive in compare([scenario()], ["test-scaled"], seeds=(3,)):
        y = drive.log.state("y")
        assert drive.row.cross_track_rmse_m == pytest.approx(math.sqrt(np.mean(y * y)), rel=1e-6)


def test_corridor_violation_is_that_of_the_worst_corner() -> None:
    lane = Lane(2.0, 6.0, -1.0, 1.1)
    tight = Path.from_points("tight", [[0.0, 0.0], [4.0, 0.0], [8.0, 0.0]], corridor=Corridor((lane,)))
    for drive in compare([scenario(tight)], ["test-scaled"], seeds=(1,)):
        worst = 0.0
        for x, y, heading in drive.log.states[:, :3].tolist():
            for ahead in (0.5, -0.5):
                for aside in (0.5, -0.5):
                    along, left = ahead * M113.contact_length, aside * M113.overall_width
                    corner_x = x + along * math.cos(heading) - left * math.sin(heading)
                    corner_y = y + along * math.sin(heading) + left * math.cos(heading)
                    if lane.start <= corner_x <= lane.end:
                        worst = max(worst, corner_y - lane.left, lane.right - corner_y)
        assert worst > 0
        assert drive.row.corridor_violation_m == pytest.approx(worst, rel=1e-9)


def test_without_a_corridor_there_is_no_violation(bent: dict[str, Drive]) -> None:
    assert bent["physics"].row.corridor_violation_m is None


def test_a_guard_that_falls_back_for_good_is_counted() -> None:
    onto = scenario(ground=stepped(ASPHALT, SLIPPERY, 4.0))
    drive = by_backend(compare([onto], ["test-guard"]))["test-guard"]
    # Two votes of three: from the second tick on that starts on slippery ground.
    strange = np.flatnonzero(drive.log.state("x")[:-1] >= 4.0)
    assert drive.row.switches == 1
    assert drive.row.fallback_rate == pytest.approx((len(drive.log) - strange[1]) / len(drive.log), rel=1e-12)
    assert drive.row.finished


def test_a_guard_that_comes_back_is_counted_twice() -> None:
    drive = by_backend(compare([scenario(straight(12.0), Strip(3.0, 4.0))], ["test-guard"]))["test-guard"]
    x = drive.log.state("x")[:-1]
    strange = np.flatnonzero((x >= 3.0) & (x < 4.0))
    # 0.3 s below the exit level after the last strange tick; four ticks of blending, the last of which is at 0.
    begin, end = strange[1], strange[-1] + 30 + 4 - 1
    assert drive.row.switches == 2
    assert drive.row.fallback_rate == pytest.approx((end - begin) / len(drive.log), abs=1.01 / len(drive.log))
    assert drive.row.fallback_rate == np.mean(drive.log.fallback_weight > 0)


def test_backends_without_a_guard_neither_fall_back_nor_switch() -> None:
    for drive in compare([scenario(ground=Strip(3.0, 4.0))], ["test-scaled"]):
        assert (drive.row.fallback_rate, drive.row.switches) == (0.0, 0)


def test_failed_solves_are_counted() -> None:
    drives = compare(
        [scenario(drivers={"solver": lambda: Records((1, 4)), "cruise": lambda: Cruise()})], ["test-scaled"]
    )
    assert [(d.row.controller, d.row.failed_solves) for d in drives] == [
        ("solver", 2), ("solver", 2), ("cruise", 0), ("cruise", 0),
    ]  # fmt: skip


def test_failed_solves_of_the_mpc_are_counted() -> None:
    path = straight(3.0)
    made: list[PathTrackingMPC] = []

    def failing() -> Driver:
        mpc = PathTrackingMPC(path, M113, SlipParameters(), MPCConfig(speed=5.0))
        calls = 0

        def solve(parameters: FloatArray, guess: Solution) -> Solution:
            nonlocal calls
            calls += 1
            solution = mpc.problem(parameters, guess)
            return replace(solution, success=False) if calls in (2, 3, 5) else solution

        mpc._solver = solve  # type: ignore[misc]
        made.append(mpc)
        return mpc

    (drive,) = compare([scenario(path, drivers={"mpc": failing})], ["physics"])
    assert len(made[0].records) == math.ceil(len(drive.log) / 10)
    assert drive.row.failed_solves == 3


def test_a_drive_that_runs_out_of_time_is_not_finished() -> None:
    for drive in compare([scenario(time_limit=1.0)], ["test-scaled"]):
        assert not drive.row.finished
        assert len(drive.log) == 100


def test_a_drive_to_the_end_is_finished() -> None:
    (drive,) = compare([scenario()], ["physics"])
    assert drive.row.finished
    assert drive.log.state("x")[-1] >= SHORT.length
    # Looked at once a control period.
    assert drive.log.state("x")[-11] < SHORT.length


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_backend_that_breaks_on_the_way_leaves_a_row_and_the_others_alone(value: float) -> None:
    options = {"test-breaks": {"value": value}}
    onto = scenario(ground=stepped(ASPHALT, SLIPPERY, 4.0), backend_options=options)
    drives = compare([onto], ["test-breaks", "test-scaled"])
    rows = by_backend(drives)
    broken = rows["test-breaks"]
    assert [drive.row.backend for drive in drives] == ["physics", "test-breaks", "test-scaled"]
    assert not broken.row.finished
    assert 4.0 - 0.06 < broken.log.state("x")[-1] < 4.0 + 0.06
    assert np.isfinite(broken.log.forces).all()
    assert len(broken.log.states) == len(broken.log.inputs) + 1
    # Until then it was physics itself.
    assert broken.row.final_position_difference_m == 0.0
    assert broken.row.force_r2 == pytest.approx([1.0] * 3, abs=1e-9)
    json.dumps(document(drives, {}), allow_nan=False)
    alone = by_backend(compare([onto], ["test-scaled"]))
    for name in ("physics", "test-scaled"):
        assert without_times(document([rows[name]], {})) == without_times(document([alone[name]], {}))


def test_a_backend_that_runs_away_leaves_a_row_that_json_holds() -> None:
    drives = compare([scenario()], ["test-runs-away"])
    assert not drives[1].row.finished
    json.dumps(document(drives, {}), allow_nan=False)


def test_a_backend_that_breaks_at_once_does_not_lose_the_others() -> None:
    # The documented errors of compare() are those of an empty comparison.
    drives = compare([scenario(ground=SLIPPERY)], ["test-breaks", "test-scaled"])
    assert [drive.row.backend for drive in drives] == ["physics", "test-breaks", "test-scaled"]
    assert [drive.row.finished for drive in drives] == [True, False, True]
    json.dumps(document(drives, {}), allow_nan=False)


def test_a_seed_starts_every_backend_and_controller_alike_and_another_seed_elsewhere() -> None:
    drivers: dict[str, Callable[[], Driver]] = {
        "pursuit": lambda: PurePursuit(SHORT, M113, 5.0),
        "cruise": lambda: Cruise(),
    }
    drives = compare([scenario(drivers=drivers, time_limit=0.1)], ["test-scaled"], seeds=(0, 1, 2))
    starts: dict[int, set[bytes]] = {}
    for drive in drives:
        starts.setdefault(drive.row.seed, set()).add(drive.log.states[0].tobytes())
    assert [len(states) for states in starts.values()] == [1, 1, 1]
    assert len(set.union(*starts.values())) == 3


def test_starts_lie_within_their_bounds_and_roll_along_the_path() -> None:
    # From (2, 3) straight along y.
    path = Path.from_points("up", [[2.0, 3.0], [2.0, 8.0], [2.0, 13.0]])
    states = [start_state(scenario(path), seed) for seed in range(200)]
    lateral = np.array([2.0 - state.x for state in states])
    heading = np.array([state.heading - math.pi / 2 for state in states])
    for offset, bound in ((lateral, 0.1), (heading, 0.01)):
        assert np.abs(offset).max() <= bound
        assert offset.max() > 0.9 * bound
        assert offset.min() < -0.9 * bound
    assert abs(np.corrcoef(lateral, heading)[0, 1]) < 0.3
    for state in states:
        assert state.y == pytest.approx(3.0)
        assert (state.vx, state.vy, state.yaw_rate, state.v_left, state.v_right) == (5.0, 0.0, 0.0, 5.0, 5.0)


@pytest.mark.parametrize("seed", range(4))
def test_a_path_that_crosses_itself_at_its_start_is_driven_from_its_start(seed: int) -> None:
    # The vehicle rolls along x, up to a hand's breadth beside a point through which the path also passes along y.
    path = figure_eight()
    (drive,) = compare(
        [scenario(path, drivers={"pursuit": lambda: PurePursuit(path, M113, 5.0)}, time_limit=3.0)],
        ["physics"],
        seeds=(seed,),
    )
    x, y = drive.log.states[-1, :2].tolist()
    assert path.project(x, y, near=14.0).arc_length == pytest.approx(14.5, abs=1.5)
    assert drive.row.cross_track_rmse_m < 0.5


def test_two_comparisons_are_equal_but_for_their_times() -> None:
    def once() -> list[Drive]:
        onto = scenario(BEND, stepped(ASPHALT, SLIPPERY, 7.0))
        return compare([onto], ["test-guard", "test-scaled"], seeds=(0, 5))

    first, second = once(), once()
    one, two = (document(drives, {"times": {"seconds": n}}) for n, drives in enumerate((first, second)))
    assert without_times(one) == without_times(two)
    for a, b in zip(first, second, strict=True):
        assert np.array_equal(a.log.states, b.log.states)
        assert np.array_equal(a.log.forces, b.log.forces)


def test_without_times_takes_the_times_and_nothing_else(bent: dict[str, Drive]) -> None:
    full = document(list(bent.values()), {"config": {"speed": 5.0}, "times": {"seconds": 1.5}})
    before = json.dumps(full)
    bare = without_times(full)
    assert json.dumps(full) == before
    assert set(full["meta"]) - set(bare["meta"]) == {"times"}
    assert bare["meta"]["config"] == {"speed": 5.0}
    for row, left in zip(full["rows"], bare["rows"], strict=True):
        assert set(row) - set(left) == {"force_call_ns", "deadline_misses"}
        assert all(row[key] == value for key, value in left.items())


def test_a_document_is_json(bent: dict[str, Drive]) -> None:
    drives = list(bent.values())
    compared = document(drives, {"config": {"speed": 5.0}})
    assert set(compared) == {"meta", "rows"}
    assert compared["meta"]["config"] == {"speed": 5.0}
    assert json.loads(json.dumps(compared, allow_nan=False)) == compared
    assert compared["rows"] == [asdict(drive.row) for drive in drives]


def test_a_straight_drive_is_json_too() -> None:
    # Where R² is not defined, there is no NaN.
    drives = compare([scenario(drivers={"cruise": lambda: Cruise()})], ["test-scaled", "test-guard"])
    json.dumps(document(drives, {}), allow_nan=False)


def test_drives_come_by_scenario_controller_seed_and_backend_physics_first() -> None:
    drivers: dict[str, Callable[[], Driver]] = {"b": lambda: Cruise(), "a": lambda: Cruise(4.0)}
    scenarios = [scenario(name=name, drivers=drivers, time_limit=0.1) for name in ("second", "first")]
    said: list[str] = []
    drives = compare(scenarios, ["test-scaled", "physics", "test-twin"], seeds=(7, 3), progress=said.append)
    expected = [
        (name, controller, seed, backend)
        for name in ("second", "first")
        for controller in ("b", "a")
        for seed in (7, 3)
        for backend in ("physics", "test-scaled", "test-twin")
    ]
    assert [(d.row.scenario, d.row.controller, d.row.seed, d.row.backend) for d in drives] == expected
    assert len(said) == len(drives)
    for words, (name, controller, _, backend) in zip(said, expected, strict=True):
        assert name in words
        assert controller in words
        assert backend in words


def test_physics_is_driven_where_it_was_not_asked_for() -> None:
    drives = compare([scenario(time_limit=0.1)], ["test-twin"])
    assert [drive.row.backend for drive in drives] == ["physics", "test-twin"]


def test_every_drive_gets_a_fresh_driver() -> None:
    made: list[Cruise] = []

    def fresh() -> Driver:
        made.append(Cruise())
        return made[-1]

    drives = compare([scenario(drivers={"cruise": fresh}, time_limit=0.1)], ["test-twin"], seeds=(0, 1))
    assert len(made) == len(drives) == 4


@pytest.mark.parametrize("period", [0.05, 0.2])
def test_commands_hold_for_the_control_period(period: float) -> None:
    pursuit: dict[str, Callable[[], Driver]] = {
        "pursuit": lambda: PurePursuit(BEND, M113, 5.0, config=PurePursuitConfig(period=period))
    }
    (drive,) = compare([scenario(BEND, drivers=pursuit, time_limit=1.0)], ["physics"], control_period=period)
    ticks = round(period / 0.01)
    held = drive.log.commands.reshape(-1, ticks, 2)
    assert np.array_equal(held, np.repeat(held[:, :1], ticks, axis=1))
    assert len(np.unique(held[:, 0], axis=0)) == len(held)


def test_a_driver_of_another_period_is_refused() -> None:
    with pytest.raises(ConfigurationError, match="control period"):
        compare([scenario(BEND, time_limit=1.0)], ["physics"], control_period=0.2)


def test_late_commands_are_counted_and_change_nothing() -> None:
    def drives(pause: float) -> list[Drive]:
        lazy = scenario(drivers={"cruise": lambda: Cruise(pause=pause)}, time_limit=0.1)
        return compare([lazy], ["test-scaled"], control_period=0.01)

    late, prompt = drives(0.012), drives(0.0)
    assert [drive.row.deadline_misses for drive in late] == [10, 10]
    assert without_times(document(late, {})) == without_times(document(prompt, {}))


def test_a_force_call_takes_time(bent: dict[str, Drive]) -> None:
    for drive in bent.values():
        assert drive.row.force_call_ns is not None
        assert 0 < drive.row.force_call_ns < math.inf


@pytest.mark.parametrize("missing", ["scenarios", "backends", "seeds", "drivers"])
def test_nothing_to_compare_is_refused(missing: str) -> None:
    scenarios = [] if missing == "scenarios" else [scenario(drivers={} if missing == "drivers" else None)]
    backends = [] if missing == "backends" else ["physics"]
    with pytest.raises(InvalidInputError):
        compare(scenarios, backends, seeds=() if missing == "seeds" else (0,))


def test_an_unknown_backend_is_answered_with_the_nearest() -> None:
    with pytest.raises(ConfigurationError, match="did you mean 'test-scaled'"):
        compare([scenario()], ["physics", "test-scald"])


def test_an_unknown_backend_option_is_refused() -> None:
    with pytest.raises(ConfigurationError, match="fctor"):
        compare([scenario(backend_options={"test-scaled": {"fctor": 2.0}})], ["test-scaled"])
