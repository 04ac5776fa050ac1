"""The simulator: rest, pose, memory, belts, determinism, guard, ground and what it refuses."""

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from grounds import stepped

from grouser.envs import (
    INTEGRATORS,
    BeltCommand,
    Integrator,
    Simulator,
    TickRecord,
    VehicleState,
    advance_belts,
    rollout,
)
from grouser.surrogate import Surrogate
from grouser.terrain import (
    ConfigurationError,
    Detection,
    FloatArray,
    ForceBackend,
    GuardedBackend,
    GuardMode,
    GuardState,
    InvalidInputError,
    Mode,
    PhysicsBackend,
    RigidTerrain,
    SimulationDivergedError,
    SoilTerrain,
    SwitchingPolicy,
    Terrain,
    TrackedVehicle,
    make_backend,
    named,
    parameter_ranges,
    terrain_names,
)

Make = Callable[..., ForceBackend]
Weave = Callable[[Simulator, int], tuple[list[BeltCommand], list[TickRecord]]]
M113 = TrackedVehicle.preset("m113")
ASPHALT = named("asphalt")
IDLE = BeltCommand(0.0, 0.0)


def brake(
    vehicle: TrackedVehicle, terrain: Terrain, *, yaw_rate: float = 0.0, integrator: Integrator = "implicit"
) -> list[TickRecord]:
    """Brake from min(5 m/s, training speed) to a command of zero, for v₀/(μ g) + 5 s."""
    speed = min(5.0, vehicle.training_speed)
    friction = terrain.mu if isinstance(terrain, RigidTerrain) else math.tan(terrain.phi)
    half = yaw_rate * vehicle.tread / 2
    start = VehicleState(vx=speed, yaw_rate=yaw_rate, v_left=speed - half, v_right=speed + half)
    simulator = Simulator(vehicle, "physics", terrain, integrator=integrator, state=start)
    return [simulator.step(IDLE) for _ in range(math.floor((speed / (friction * 9.81) + 5.0) / 0.01))]


def chatter(records: list[TickRecord], output: int, weight: float) -> float:
    """Largest force in N that changes sign from one tick to the next, once nearly at rest.

    Nearly at rest is from the first tick on that ends below 1 mm/s. What stays below 1e-9 of the weight is the
    rounding of a standing vehicle. A single change of sign would count: a stop ends monotonically.
    """
    near = next(index for index, record in enumerate(records) if abs(record.state.vx) < 1e-3)
    force = np.array([record.forces[output] for record in records[near:]])
    amplitude = np.minimum(np.abs(force[1:]), np.abs(force[:-1]))[force[1:] * force[:-1] < 0]
    largest = float(amplitude.max(initial=0.0))
    return largest if largest > 1e-9 * weight else 0.0


def assert_at_rest(state: VehicleState) -> None:
    assert abs(state.vx) < 1e-6
    assert abs(state.vy) < 1e-6
    assert abs(state.yaw_rate) < 1e-6


class TestBraking:
    @pytest.mark.parametrize("vehicle", ["m113", "marder", "ugv", "maxxii"])
    @pytest.mark.parametrize("mu", [0.1, 0.35, 0.7, 1.0])
    @pytest.mark.parametrize("k", [0.005, 0.025, 0.06])
    def test_straight_on_firm_ground(self, vehicle: str, mu: float, k: float) -> None:
        preset = TrackedVehicle.preset(vehicle)
        records = brake(preset, RigidTerrain(mu, 0.03, k))
        assert_at_rest(records[-1].state)
        assert chatter(records, 0, preset.weight) == 0.0
        assert all(record.forces[1] == 0.0 and record.state.vy == 0.0 for record in records)
        assert max(abs(record.forces[2]) for record in records) <= 1e-10 * preset.weight
        assert max(abs(record.state.yaw_rate) for record in records) < 1e-12
        # It never rolls back.
        assert min(record.state.vx for record in records) > -1e-10

    @pytest.mark.parametrize("vehicle", ["m113", "marder", "ugv", "maxxii"])
    @pytest.mark.parametrize("ground", ["lete-sand", "heavy-clay-25", "snow-harrison"])
    def test_straight_on_soil(self, vehicle: str, ground: str) -> None:
        preset = TrackedVehicle.preset(vehicle)
        records = brake(preset, named(ground))
        assert_at_rest(records[-1].state)
        assert chatter(records, 0, preset.weight) == 0.0
        assert all(record.forces[1] == 0.0 and record.state.vy == 0.0 for record in records)

    @pytest.mark.parametrize("vehicle", ["m113", "marder", "ugv", "maxxii"])
    @pytest.mark.parametrize(("mu", "k"), [(0.1, 0.005), (0.7, 0.025), (1.0, 0.005)])
    def test_out_of_a_turn(self, vehicle: str, mu: float, k: float) -> None:
        preset = TrackedVehicle.preset(vehicle)
        records = brake(preset, RigidTerrain(mu, 0.03, k), yaw_rate=0.2)
        assert_at_rest(records[-1].state)
        assert chatter(records, 0, preset.weight) == 0.0

    @pytest.mark.parametrize("mu", [0.35, 1.0])
    def test_with_sdirk2(self, mu: float) -> None:
        records = brake(M113, RigidTerrain(mu, 0.03, 0.005), integrator="sdirk2")
        assert_at_rest(records[-1].state)

    def test_explicit_euler_chatters_by_tens_of_kilonewtons_where_the_implicit_tick_does_not(self) -> None:
        terrain = RigidTerrain(1.0, 0.03, 0.005)
        explicit, implicit = (brake(M113, terrain, integrator=name) for name in ("euler", "implicit"))
        last = np.array([record.forces[0] for record in explicit[-100:]])
        assert np.mean(last[1:] * last[:-1] < 0) > 0.8
        assert np.abs(last).max() > 30e3
        assert chatter(implicit, 0, M113.weight) == 0.0
        assert np.abs([record.forces[0] for record in implicit[-100:]]).max() < 1.0

    def test_at_rest_it_stays_at_rest_exactly(self) -> None:
        simulator = Simulator(M113, "physics", ASPHALT)
        for _ in range(50):
            record = simulator.step(IDLE)
            assert record.forces.tolist() == [0.0, 0.0, 0.0]
        assert replace(simulator.get_state(), time=0.0) == VehicleState()


@pytest.mark.parametrize("terrain", [ASPHALT, named("lete-sand")], ids=["rigid", "soil"])
def test_a_straight_run_has_no_moment_and_no_sideways_motion(terrain: Terrain) -> None:
    simulator = Simulator(M113, "physics", terrain)
    for command in [BeltCommand(6.0, 6.0)] * 200 + [BeltCommand(-2.0, -2.0)] * 350:
        record = simulator.step(command)
        assert record.forces[1] == 0.0
        assert abs(record.forces[2]) <= 1e-10 * M113.weight
    state = simulator.get_state()
    assert state.vy == 0.0
    assert (state.y, state.heading) == pytest.approx((0.0, 0.0), abs=1e-12)
    assert state.vx == pytest.approx(-2.0, abs=0.05)


def start_turn_and_stop(vehicle: str, terrain: Terrain) -> VehicleState:
    simulator = Simulator(vehicle, "physics", terrain)
    top = simulator.vehicle.training_speed
    for left, right, ticks in ((0.6, 0.6, 80), (0.1, 0.7, 80), (-0.4, 0.4, 80), (0.0, 0.0, 160)):
        for _ in range(ticks):
            record = simulator.step(BeltCommand(left * top, right * top))
    return record.state


class TestEveryGround:
    """The tick is solved wherever data are generated and a ground has a name."""

    @pytest.mark.parametrize("vehicle", ["m113", "marder", "ugv", "maxxii"])
    @pytest.mark.parametrize("ground", terrain_names())
    def test_with_a_name(self, vehicle: str, ground: str) -> None:
        state = start_turn_and_stop(vehicle, named(ground))
        assert max(abs(state.vx), abs(state.vy)) < TrackedVehicle.preset(vehicle).training_speed

    @pytest.mark.parametrize("vehicle", ["m113", "marder", "ugv", "maxxii"])
    @pytest.mark.parametrize("mode", ["rigid", "soil"])
    def test_of_the_wide_ranges(self, vehicle: str, mode: Mode) -> None:
        generator, diverged = np.random.default_rng(3), []
        for _ in range(12):
            terrain = parameter_ranges("wide", mode).sample(generator)
            try:
                start_turn_and_stop(vehicle, terrain)
            except SimulationDivergedError:
                diverged.append(terrain)
        assert diverged == []


class TestPose:
    def test_is_the_trapezoid_of_the_velocities(self, weave: Weave) -> None:
        simulator = Simulator(M113, "physics", ASPHALT, state=VehicleState(x=3.0, y=-2.0, heading=1.0))
        a = simulator.get_state()
        for record in weave(simulator, 200)[1]:
            b = record.state
            assert b.heading == pytest.approx(a.heading + 0.005 * (a.yaw_rate + b.yaw_rate), abs=1e-14)
            ground_a, ground_b = (
                complex(s.vx, s.vy) * complex(math.cos(s.heading), math.sin(s.heading)) for s in (a, b)
            )
            expected = complex(a.x, a.y) + 0.005 * (ground_a + ground_b)
            assert (b.x, b.y) == pytest.approx((expected.real, expected.imag), abs=1e-13)
            a = b

    @pytest.mark.parametrize("integrator", INTEGRATORS)
    @pytest.mark.parametrize("tick", [0.01, 0.02, 0.04])
    def test_constant_turn(self, constant_turn: Make, tick: float, integrator: Integrator) -> None:
        speed, side, yaw_rate, duration = 3.0, 0.4, 0.6, 4.0
        start = VehicleState(heading=0.3, vx=speed, vy=side, yaw_rate=yaw_rate)
        backend = constant_turn(M113, "rigid")
        simulator = Simulator(M113, backend, ASPHALT, tick=tick, integrator=integrator, state=start)
        for _ in range(round(duration / tick)):
            state = simulator.step(IDLE).state
        turned = yaw_rate * duration
        assert (state.vx, state.vy, state.yaw_rate) == pytest.approx((speed, side, yaw_rate), abs=1e-8)
        assert state.heading == pytest.approx(0.3 + turned, abs=1e-9)
        start_velocity = complex(speed, side) * complex(math.cos(0.3), math.sin(0.3))
        exact = start_velocity * (complex(math.cos(turned), math.sin(turned)) - 1.0) / (1j * yaw_rate)
        # The trapezoid shortens a chord by (θ/2) cot(θ/2), θ = ω h: by θ²/12.
        assert abs(complex(state.x, state.y) - exact) <= 1.01 * abs(exact) * (yaw_rate * tick) ** 2 / 12 + 1e-8

    def test_heading_is_not_wrapped(self, constant_turn: Make) -> None:
        simulator = Simulator(M113, constant_turn(M113, "rigid"), ASPHALT, state=VehicleState(yaw_rate=2.0))
        for _ in range(400):
            simulator.step(IDLE)
        assert simulator.get_state().heading == pytest.approx(8.0)


class TestMemory:
    @pytest.mark.parametrize("integrator", INTEGRATORS)
    @pytest.mark.parametrize("terrain", [ASPHALT, named("lete-sand")], ids=["rigid", "soil"])
    def test_the_block_sees_the_accelerations_of_the_previous_tick(
        self, weave: Weave, integrator: Integrator, terrain: Terrain
    ) -> None:
        simulator = Simulator(M113, "physics", terrain, integrator=integrator)
        assert (simulator.get_state().ax, simulator.get_state().ay) == (0.0, 0.0)
        _, records = weave(simulator, 200)
        assert records[0].row[3:5].tolist() == [0.0, 0.0]
        for before, after in itertools.pairwise(records):
            assert after.row[3:5].tolist() == (before.forces[:2] / M113.mass).tolist()
            assert (before.state.ax, before.state.ay) == tuple((before.forces[:2] / M113.mass).tolist())
        # Without the delay these would be equal.
        same = [np.abs(record.row[3:5] - record.forces[:2] / M113.mass).max() for record in records]
        assert max(same) > 0.1
        assert np.mean(np.array(same) > 1e-6) > 0.9

    def test_initial_memory_is_seen_by_the_first_tick(self) -> None:
        simulator = Simulator(M113, "physics", ASPHALT, state=replace(VehicleState.rolling(3.0), ax=-1.5, ay=0.5))
        assert simulator.step(BeltCommand(3.0, 3.0)).row[3:5].tolist() == [-1.5, 0.5]


class TestBelts:
    @pytest.mark.parametrize("integrator", INTEGRATORS)
    def test_the_block_sees_them_half_a_tick_on_or_with_euler_at_the_start(
        self, weave: Weave, integrator: Integrator
    ) -> None:
        simulator = Simulator(M113, "physics", ASPHALT, integrator=integrator)
        belts = (0.0, 0.0)
        for command, record in zip(*weave(simulator, 150), strict=True):
            seen = belts if integrator == "euler" else advance_belts(M113, belts, command, 0.005)
            assert record.row[5:7].tolist() == list(seen)
            belts = advance_belts(M113, belts, command, 0.01)
            assert (record.state.v_left, record.state.v_right) == belts

    def test_euler_logs_the_start_of_the_tick(self, weave: Weave) -> None:
        simulator = Simulator(M113, "physics", ASPHALT, integrator="euler", state=VehicleState.rolling(2.0))
        before = simulator.get_state()
        for record in weave(simulator, 150)[1]:
            assert record.row[:7].tolist() == [
                getattr(before, name) for name in ("vx", "vy", "yaw_rate", "ax", "ay", "v_left", "v_right")
            ]
            before = record.state

    @pytest.mark.parametrize("integrator", ["implicit", "sdirk2"])
    def test_an_implicit_tick_logs_a_body_at_its_end(self, weave: Weave, integrator: Integrator) -> None:
        simulator = Simulator(M113, "physics", ASPHALT, integrator=integrator)
        for record in weave(simulator, 150)[1]:
            end = [record.state.vx, record.state.vy, record.state.yaw_rate]
            # SDIRK2's last stage is the end of the tick, too.
            assert record.row[:3].tolist() == end


class TestDeterminism:
    @staticmethod
    def backend_of(name: str, mode: Mode, surrogate: Surrogate) -> ForceBackend:
        options: dict[str, Any] = {} if name == "physics" else {"artifact": surrogate}
        return make_backend(name, mode=mode, **options)

    @pytest.mark.parametrize("mode", ["rigid", "soil"])
    @pytest.mark.parametrize("backend", ["physics", "native", "torch", "guarded"])
    def test_the_same_state_and_commands_give_the_same_bits(
        self, make_surrogate: Callable[[Mode], Surrogate], weave: Weave, backend: str, mode: Mode
    ) -> None:
        terrain = named("asphalt" if mode == "rigid" else "lete-sand")
        drives = []
        for _ in range(2):
            simulator = Simulator(M113, self.backend_of(backend, mode, make_surrogate(mode)), terrain)
            drives.append(weave(simulator, 120)[1])
        for first, second in zip(*drives, strict=True):
            assert first.state == second.state
            assert first.forces.tobytes() == second.forces.tobytes()
            assert first.row.tobytes() == second.row.tobytes()
            assert first.detection == second.detection

    @pytest.mark.parametrize("integrator", INTEGRATORS)
    @pytest.mark.parametrize("backend", ["physics", "native", "guarded"])
    def test_a_state_taken_in_mid_drive_reproduces_the_future(
        self, make_surrogate: Callable[[Mode], Surrogate], weave: Weave, backend: str, integrator: Integrator
    ) -> None:
        built = self.backend_of(backend, "rigid", make_surrogate("rigid"))
        simulator = Simulator(M113, built, ASPHALT, integrator=integrator)
        weave(simulator, 93)
        middle = simulator.get_state()
        future = [record.state for record in weave(simulator, 100)[1]]
        simulator.set_state(middle)
        assert simulator.get_state() == middle
        assert [record.state for record in weave(simulator, 100)[1]] == future
        other = Simulator(M113, built, ASPHALT, integrator=integrator, state=middle)
        assert [record.state for record in weave(other, 100)[1]] == future

    def test_time_and_pose_do_not_move_the_vehicle(self, weave: Weave) -> None:
        here, there = (
            weave(Simulator(M113, "physics", ASPHALT, state=state), 100)[1]
            for state in (VehicleState(), VehicleState(x=50.0, y=-7.0, heading=2.0, time=99.0))
        )
        for a, b in zip(here, there, strict=True):
            assert a.forces.tobytes() == b.forces.tobytes()


@dataclass
class BandDetector:
    """Scores a row by its friction coefficient: 2 below 0.3, 0.9 up to 0.5, else 0.5. Counts its calls."""

    reason: str = "distance"
    calls: int = 0

    def score(self, x: FloatArray) -> FloatArray:
        mu = np.atleast_2d(x)[:, 7]
        return np.where(mu < 0.3, 2.0, np.where(mu < 0.5, 0.9, 0.5))

    def detect(self, row: FloatArray) -> Detection:
        self.calls += 1
        score = float(self.score(row)[0])
        return Detection(score, self.reason if score > 1 else "none", "mu")


@dataclass
class Bands:
    """Firm ground whose friction is given by the position along x, a band a meter."""

    frictions: tuple[float, ...]
    mode: Mode = "rigid"

    def parameters_at(self, x: float, y: float) -> FloatArray:
        return np.array([self.frictions[min(max(int(x), 0), len(self.frictions) - 1)], 0.03, 0.025])

    def gradient_at(self, x: float, y: float) -> tuple[float, float]:
        return 0.0, 0.0


class Spy(ForceBackend):
    """Passes calls on and counts them."""

    name = "spy"

    def __init__(self, inner: ForceBackend) -> None:
        super().__init__(inner.vehicle, inner.mode)
        self.inner = inner
        self.calls = 0

    def forces(self, x: FloatArray) -> FloatArray:
        return self.inner.forces(x)

    def forces_and_jacobian(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        self.calls += 1
        return self.inner.forces_and_jacobian(x)


class TestGuard:
    """At 10 m/s a band of a meter lasts ten ticks."""

    POLICY = SwitchingPolicy(
        entry_votes=2, entry_window=3, exit_score=0.8, exit_time=0.05, minimum_dwell=0.02, blend_samples=4
    )

    def guarded(self, viscous: Make, *, detector: BandDetector | None = None) -> GuardedBackend:
        """Both parts pull towards the belts, the fallback harder."""
        primary, fallback = (Spy(viscous(rate=rate, follow_belts=True)) for rate in (1.0, 40.0))
        return GuardedBackend(primary, fallback, detector or BandDetector(), self.POLICY)

    def simulator(self, backend: ForceBackend, *bands: float) -> Simulator:
        # The middle of a tick, so that no band starts on the edge of one.
        start = replace(VehicleState.rolling(10.0), x=0.05)
        return Simulator(M113, backend, Bands(bands), state=start)

    def drive(self, simulator: Simulator, ticks: int) -> list[TickRecord]:
        return [simulator.step(BeltCommand(10.0, 10.0)) for _ in range(ticks)]

    def test_two_votes_of_three_change_over_and_the_weight_follows_in_quarters(self, viscous: Make) -> None:
        records = self.drive(self.simulator(self.guarded(viscous), 0.8, 0.2, 0.8, 0.8, 0.8), 40)
        scores = [record.detection.score for record in records if record.detection]
        # Ticks 0-9 start in band 0, 10-19 in band 1, later ones beyond.
        assert scores == [0.5] * 10 + [2.0] * 10 + [0.5] * 20
        weights = [record.state.guard.fallback_weight for record in records]
        # The second flag is in tick 11. The score calms in tick 20; five calm ticks later, in tick 24, it changes back.
        expected = [0.0] * 11 + [0.25, 0.5, 0.75] + [1.0] * 10 + [0.75, 0.5, 0.25] + [0.0] * 13
        assert weights == pytest.approx(expected)
        modes = [record.state.guard.mode for record in records]
        assert modes == [GuardMode.PRIMARY] * 11 + [GuardMode.FALLBACK] * 13 + [GuardMode.PRIMARY] * 16

    def test_a_row_outside_the_box_goes_over_whole_and_at_once(self, viscous: Make) -> None:
        backend = self.guarded(viscous, detector=BandDetector(reason="box"))
        records = self.drive(self.simulator(backend, 0.8, 0.2), 12)
        weights = [record.state.guard.fallback_weight for record in records]
        assert weights == [0.0] * 10 + [1.0] * 2

    def test_a_score_between_exit_and_entry_holds_the_mode(self, viscous: Make) -> None:
        records = self.drive(self.simulator(self.guarded(viscous), 0.4, 0.2, 0.4, 0.4), 40)
        modes = [record.state.guard.mode for record in records]
        assert modes == [GuardMode.PRIMARY] * 11 + [GuardMode.FALLBACK] * 29

    def test_mode_and_weight_are_frozen_within_a_tick(self, viscous: Make) -> None:
        detector = BandDetector()
        backend = self.guarded(viscous, detector=detector)
        simulator = self.simulator(backend, 0.8, 0.2, 0.8, 0.8)
        assert isinstance(backend.primary, Spy)
        assert isinstance(backend.fallback, Spy)
        # Changing belts, so that every tick takes Newton steps.
        for index in range(40):
            detector.calls = backend.primary.calls = backend.fallback.calls = 0
            record = simulator.step(BeltCommand(9.0, 10.0))
            assert detector.calls == 1
            assert record.iterations >= 1 or index == 0
            evaluations = record.iterations + 1
            weight = record.state.guard.fallback_weight
            assert backend.primary.calls == (evaluations if weight < 1 else 0)
            assert backend.fallback.calls == (evaluations if weight > 0 else 0)
            blend = (1 - weight) * backend.primary.forces(record.row) + weight * backend.fallback.forces(record.row)
            np.testing.assert_allclose(record.forces, blend, rtol=1e-13, atol=1e-9)

    def test_the_score_is_that_of_the_row_at_the_start_of_the_tick(
        self, make_surrogate: Callable[[Mode], Surrogate], weave: Weave
    ) -> None:
        backend = make_backend("guarded", mode="rigid", artifact=make_surrogate("rigid"))
        assert isinstance(backend, GuardedBackend)
        simulator = Simulator(M113, backend, ASPHALT)
        before = simulator.get_state()
        for record in weave(simulator, 150)[1]:
            row = record.row.copy()
            row[:3] = before.vx, before.vy, before.yaw_rate
            assert record.detection == backend.detector.detect(row)
            before = record.state

    def test_its_memory_is_part_of_the_state(self, viscous: Make) -> None:
        backend = self.guarded(viscous)
        simulator = self.simulator(backend, 0.8, 0.2, 0.8, 0.8)
        self.drive(simulator, 13)
        middle = simulator.get_state()
        assert middle.guard.mode is GuardMode.FALLBACK
        assert middle.guard.fallback_weight == 0.5
        future = [record.state for record in self.drive(simulator, 30)]
        simulator.set_state(middle)
        assert [record.state for record in self.drive(simulator, 30)] == future
        # Forgetting the guard changes the drive.
        simulator.set_state(replace(middle, guard=GuardState(), v_left=9.0, vx=9.0))
        assert simulator.step(BeltCommand(10.0, 10.0)).state.guard != future[0].guard

    def test_the_log_counts_fallback_and_switches(self, viscous: Make, scripted: Any) -> None:
        simulator = self.simulator(self.guarded(viscous), 0.8, 0.2, 0.8, 0.8, 0.8)
        log = rollout(simulator, scripted(lambda _: (10.0, 10.0)), 0.4, control_period=0.02)
        assert log.ood_score.tolist() == [0.5] * 10 + [2.0] * 10 + [0.5] * 20
        assert (
            log.fallback_weight.tolist() == [0.0] * 11 + [0.25, 0.5, 0.75] + [1.0] * 10 + [0.75, 0.5, 0.25] + [0.0] * 13
        )
        assert log.switches == 2
        assert log.fallback_rate == 16 / 40

    def test_the_log_owns_up_to_a_fallback_for_a_primary_that_is_not_finite(
        self, viscous: Make, poisoned: Make, scripted: Any
    ) -> None:
        """``fallback_weight`` is documented as the fallback's share in the forces, which is all of them here."""
        primary, fallback = poisoned(jacobian_scale=math.nan), viscous(rate=2.0, follow_belts=True)
        backend = GuardedBackend(primary, fallback, BandDetector())
        log = rollout(self.simulator(backend, 0.8), scripted(lambda _: (9.0, 9.0)), 0.1, control_period=0.01)
        for row, forces in zip(log.inputs, log.forces, strict=True):
            np.testing.assert_array_equal(forces, fallback.forces(row))
        assert log.fallback_weight.tolist() == [1.0] * 10
        assert log.fallback_rate == 1.0

    def test_without_a_guard_there_is_no_detection_and_the_memory_rests(self, weave: Weave) -> None:
        simulator = Simulator(M113, "physics", ASPHALT)
        for record in weave(simulator, 10)[1]:
            assert record.detection is None
            assert record.state.guard == GuardState()


class TestGround:
    @pytest.mark.parametrize(
        ("first", "second"), [("asphalt", "lete-sand"), ("lete-sand", "asphalt")], ids=["to soil", "to rigid"]
    )
    def test_of_the_other_mode_is_refused(self, first: str, second: str) -> None:
        simulator = Simulator(M113, "physics", named(first))
        with pytest.raises(ConfigurationError, match=named(second).mode):
            simulator.set_ground(named(second))
        assert simulator.ground == named(first)

    def test_of_the_same_mode_takes_over_at_once(self) -> None:
        simulator = Simulator(M113, "physics", ASPHALT)
        simulator.set_ground(named("ice"))
        assert simulator.ground == named("ice")
        assert simulator.step(IDLE).row[7:].tolist() == named("ice").parameters.tolist()

    @pytest.mark.parametrize(
        ("before", "beyond"),
        [(ASPHALT, named("ice")), (named("lete-sand"), named("snow-us"))],
        ids=["rigid", "soil"],
    )
    def test_is_sampled_under_the_cg_at_the_start_of_the_tick(self, before: Terrain, beyond: Terrain) -> None:
        ground = stepped(before, beyond, 0.5)
        simulator = Simulator(M113, "physics", ground, state=VehicleState.rolling(3.0))
        x, sides = 0.0, []
        for _ in range(40):
            record = simulator.step(BeltCommand(3.0, 3.0))
            expected = before if x < 0.5 else beyond
            assert record.row[7:].tolist() == expected.parameters.tolist()
            sides.append(expected is beyond)
            x = record.state.x
        assert 0 < sum(sides) < 40
        assert sides == sorted(sides)


class TestRefusals:
    @pytest.mark.parametrize("tick", [0.0, -0.01, 1.001, math.nan, math.inf])
    def test_tick(self, tick: float) -> None:
        with pytest.raises(InvalidInputError, match=r"tick must lie in \(0, 1\]"):
            Simulator(M113, "physics", ASPHALT, tick=tick)

    @pytest.mark.parametrize(
        ("name", "nearest"), [("implict", "implicit"), ("sdirk", "sdirk2"), ("eulre", "euler"), ("Euler", "euler")]
    )
    def test_integrator(self, name: Any, nearest: str) -> None:
        with pytest.raises(ConfigurationError, match=f"unknown integrator '{name}'; did you mean '{nearest}'"):
            Simulator(M113, "physics", ASPHALT, integrator=name)

    def test_names(self) -> None:
        with pytest.raises(ConfigurationError, match="did you mean 'm113'"):
            Simulator("m131", "physics", ASPHALT)
        with pytest.raises(ConfigurationError, match="did you mean 'physics'"):
            Simulator("m113", "phsyics", ASPHALT)

    def test_a_backend_for_something_else(self) -> None:
        with pytest.raises(ConfigurationError, match="soil"):
            Simulator(M113, PhysicsBackend(M113, "rigid"), SoilTerrain(1e3, 0.5))
        with pytest.raises(ConfigurationError, match="marder"):
            Simulator("marder", PhysicsBackend(M113, "rigid"), ASPHALT)

    @pytest.mark.parametrize("name", ["x", "heading", "vx", "yaw_rate", "v_left", "ax", "time"])
    @pytest.mark.parametrize("value", [math.nan, math.inf])
    def test_a_state_that_is_not_finite(self, name: str, value: Any) -> None:
        with pytest.raises(InvalidInputError, match=rf"{name} must be finite|must be finite: {name} = "):
            VehicleState(**{name: value})


def test_rolling_state() -> None:
    state = VehicleState.rolling(2.5, x=1.0, y=2.0, heading=0.5)
    assert state == VehicleState(x=1.0, y=2.0, heading=0.5, vx=2.5, v_left=2.5, v_right=2.5)
