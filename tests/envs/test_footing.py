"""Slopes, split ground and maps: what each tick stands on, and what that does to the vehicle."""

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path as FilePath
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from grouser.envs import (
    GROUND_SAMPLINGS,
    STATE_NAMES,
    BeltCommand,
    GroundSampling,
    InterfaceLog,
    PathTrackingEnv,
    Simulator,
    TickRecord,
    VehicleState,
    make_path,
    rollout,
)
from grouser.envs.footing import sample_ground
from grouser.native import Physics
from grouser.surrogate import Surrogate
from grouser.terrain import (
    CONTACTS,
    LEVEL,
    MODES,
    ConfigurationError,
    Contact,
    Detection,
    FloatArray,
    ForceBackend,
    Ground,
    GuardedBackend,
    InvalidInputError,
    Mode,
    Patch,
    PhysicsBackend,
    Rectangle,
    SlopedGround,
    SoilTerrain,
    Terrain,
    TerrainField,
    TrackedVehicle,
    make_backend,
    named,
    paint_field,
    save_field,
)

M113 = TrackedVehicle.preset("m113")
G = 9.81
GROUNDS: dict[Mode, Terrain] = {"rigid": named("asphalt"), "soil": named("lete-sand")}
WORSE: dict[Mode, Terrain] = {"rigid": named("ice"), "soil": named("snow-us")}
TICK = 0.01
IDLE = BeltCommand(0.0, 0.0)
every_mode = pytest.mark.parametrize("mode", MODES)

Weave = Callable[[Simulator, int], tuple[list[BeltCommand], list[TickRecord]]]
MakeSurrogate = Callable[[Mode], Surrogate]


def split_ground(mode: Mode = "rigid", extent: tuple[float, float, float, float] = (-20, 40, -20, 20)) -> TerrainField:
    """Good ground at y > 0, worse at y < 0, a border of decimetres between them."""
    return paint_field(
        GROUNDS[mode], extent, spacing=0.2, patches=[Patch(WORSE[mode], Rectangle(y_max=0.0))], outside="extend"
    )


def belts(time: float) -> tuple[float, float]:
    """A start, a slalom, a pivot turn and a stop."""
    if time < 2.0:
        return 4.0, 4.0 + 2.0 * math.sin(4.0 * time)
    return (3.0, -3.0) if time < 2.7 else (0.0, 0.0)


def light_block(mode: Mode, gravity: float) -> Physics:
    """The compiled block of the M113 under another gravity: no rule for slopes is in it."""
    v = M113
    return Physics(
        mode=MODES.index(mode),
        contact=0,
        path=0,
        precision=0,
        wheels=v.road_wheels,
        along=16,
        across=4,
        mass=v.mass,
        gravity=gravity,
        contact_length=v.contact_length,
        element_length=v.contact_length / v.road_wheels,
        element_spacing=v.contact_length / v.road_wheels,
        tread=v.tread,
        track_width=v.track_width,
        cg_height=v.cg_height,
        contact_center=0.0,
        soft_speed=v.soft_speed,
    )


def right_inputs(log: InterfaceLog) -> FloatArray:
    return np.column_stack([log.inputs[:, :7], log.right_theta])


def assert_balanced(log: InterfaceLog, tolerance: float) -> None:
    """m(ΔVx/h − ω⁺Vy⁺) = Qx + m g_x, m(ΔVy/h + ω⁺Vx⁺) = Qy + m g_y, Iz Δω/h = Mz, to the solver's tolerance."""
    whole = log.divisions == 1
    assert whole.mean() > 0.99
    vx, vy, yaw_rate = (log.state(name) for name in ("vx", "vy", "yaw_rate"))
    residual = np.column_stack(
        [
            np.diff(vx) / TICK - yaw_rate[1:] * vy[1:] - log.forces[:, 0] / M113.mass - log.gravity[:, 0],
            np.diff(vy) / TICK + yaw_rate[1:] * vx[1:] - log.forces[:, 1] / M113.mass - log.gravity[:, 1],
            np.diff(yaw_rate) / TICK - log.forces[:, 2] / M113.yaw_inertia,
        ]
    )
    assert np.abs(residual[whole]).sum(axis=1).max() <= 1.01 * tolerance / TICK


class TestSamplingTheGround:
    FIELD = paint_field(named("asphalt"), (-9.0, 9.0, -9.0, 9.0), elevation=lambda x, y: 0.1 * x * x - 0.2 * y)

    class Coordinates:
        """A ground that answers with where it was asked."""

        mode: Mode = "rigid"

        def parameters_at(self, x: float, y: float) -> FloatArray:
            return np.array([x, y, 0.0])

        def gradient_at(self, x: float, y: float) -> tuple[float, float]:
            return x / 100, y / 100

    @pytest.mark.parametrize("cg_offset", [0.0, 0.3, -0.2])
    @pytest.mark.parametrize("heading", [0.0, 0.7, math.pi / 2, 4.0])
    def test_of_each_track_is_under_its_middle(self, cg_offset: float, heading: float) -> None:
        v = replace(M113, cg_offset=cg_offset)
        footing = sample_ground(self.Coordinates(), v, "tracks", x=3.0, y=-2.0, heading=heading)
        for theta, side in ((footing.theta, 1.0), (footing.right_theta, -1.0)):
            place = complex(3.0, -2.0) + complex(-cg_offset, side * 2.159 / 2) * np.exp(1j * heading)
            assert complex(theta[0], theta[1]) == pytest.approx(place, abs=1e-14)
        assert footing.split

    def test_of_the_vehicle_is_under_its_cg(self) -> None:
        footing = sample_ground(self.Coordinates(), replace(M113, cg_offset=0.3), "vehicle", x=3.0, y=-2.0, heading=1.0)
        np.testing.assert_array_equal(footing.theta, [3.0, -2.0, 0.0])
        assert footing.right_theta is footing.theta
        assert not footing.split

    @pytest.mark.parametrize("sampling", GROUND_SAMPLINGS)
    def test_of_the_slope_is_at_the_cg(self, sampling: GroundSampling) -> None:
        footing = sample_ground(self.FIELD, M113, sampling, x=2.0, y=1.0, heading=0.0)
        # dz/dx = 0.4, dz/dy = -0.2 of the parabola itself.
        normal = G / math.sqrt(1 + 0.4**2 + 0.2**2)
        assert footing.gravity == pytest.approx((-0.4 * normal, 0.2 * normal, normal), rel=1e-12)


class TestOnASlope:
    GRADE, BANK = math.radians(12.0), math.radians(-7.0)

    def drive(self, scripted: Any, mode: Mode, backend: str | ForceBackend = "physics", **options: Any) -> InterfaceLog:
        ground = options.pop("ground", SlopedGround(GROUNDS[mode], self.GRADE, self.BANK))
        simulator = Simulator(M113, backend, ground, state=VehicleState(heading=0.5), **options)
        return rollout(simulator, scripted(belts), 3.5)

    @every_mode
    @pytest.mark.parametrize("backend", ["physics", "exact"])
    def test_forces_and_gravity_moved_the_vehicle(self, scripted: Any, mode: Mode, backend: str) -> None:
        assert_balanced(self.drive(scripted, mode, backend), 1e-11)

    @every_mode
    def test_with_a_network_too(self, scripted: Any, make_surrogate: MakeSurrogate, mode: Mode) -> None:
        native = make_backend("native", mode=mode, artifact=make_surrogate(mode))
        assert_balanced(self.drive(scripted, mode, native), 1e-6)  # float32 resolves no more

    @every_mode
    def test_with_explicit_euler_at_the_start_of_the_tick(self, scripted: Any, mode: Mode) -> None:
        log = self.drive(scripted, mode, integrator="euler")
        vx, vy, yaw_rate = (log.state(name)[:-1] for name in ("vx", "vy", "yaw_rate"))
        residual = np.column_stack(
            [
                np.diff(log.state("vx")) / TICK - yaw_rate * vy - log.forces[:, 0] / M113.mass - log.gravity[:, 0],
                np.diff(log.state("vy")) / TICK + yaw_rate * vx - log.forces[:, 1] / M113.mass - log.gravity[:, 1],
            ]
        )
        assert np.abs(residual).max() <= 1e-11

    @every_mode
    def test_the_log_holds_gravity_in_the_axes_of_the_ticks_start(self, scripted: Any, mode: Mode) -> None:
        log = self.drive(scripted, mode)
        p, q = math.tan(self.GRADE), math.tan(self.BANK)
        normal = G / math.sqrt(1 + p * p + q * q)
        pull = -normal * complex(p, q) * np.exp(-1j * log.state("heading")[:-1])
        assert np.ptp(pull.real) > 0.1  # the vehicle turns
        expected = np.column_stack([pull.real, pull.imag, np.full(len(log), normal)])
        np.testing.assert_allclose(log.gravity, expected, rtol=1e-13, atol=1e-14)

    @every_mode
    def test_the_logged_forces_are_those_under_the_load_of_the_slope(self, scripted: Any, mode: Mode) -> None:
        log = self.drive(scripted, mode)
        forces = np.empty_like(log.forces)
        light_block(mode, log.gravity[0, 2]).forces(log.inputs, forces)
        np.testing.assert_allclose(log.forces, forces, rtol=0, atol=1e-12 * M113.weight)

    @every_mode
    def test_the_memory_is_the_force_of_the_ground_alone(self, scripted: Any, mode: Mode) -> None:
        """What tips a vehicle that is held on a slope is what the ground does to it, not that it accelerates."""
        log = self.drive(scripted, mode)
        np.testing.assert_array_equal(log.inputs[1:, 3:5], log.forces[:-1, :2] / M113.mass)

    @every_mode
    def test_hills_of_a_field_pull_as_planes_do(self, mode: Mode) -> None:
        plane = paint_field(GROUNDS[mode], (-30, 30, -30, 30), spacing=1.0, elevation=lambda x, y: 0.2 * x - 0.1 * y)
        on_field, on_plane = (
            Simulator(M113, "physics", ground, state=VehicleState.rolling(3.0))
            for ground in (plane, SlopedGround(GROUNDS[mode], math.atan(0.2), math.atan(-0.1)))
        )
        for _ in range(100):
            command = BeltCommand(3.0, 4.0)
            a, b = on_field.step(command).state, on_plane.step(command).state
        # The spline's gradient is the plane's to round-off.
        assert (a.x, a.y, a.vx, a.vy, a.yaw_rate) == pytest.approx((b.x, b.y, b.vx, b.vy, b.yaw_rate), abs=1e-9)

    @every_mode
    def test_a_guard_judges_the_row_that_its_surrogate_is_given(self, mode: Mode) -> None:
        """On level ground that the equivalent row stands for: accelerations and cohesion over the load's ratio."""
        seen: list[FloatArray] = []

        class Watching:
            def score(self, x: FloatArray) -> FloatArray:
                return np.zeros(len(np.atleast_2d(x)))

            def detect(self, row: FloatArray) -> Detection:
                seen.append(row.copy())
                return Detection(0.0, "none", "")

        ratio = math.cos(self.GRADE)
        physics = PhysicsBackend(M113, mode)
        simulator = Simulator(
            M113,
            GuardedBackend(physics, physics, Watching()),
            SlopedGround(GROUNDS[mode], self.GRADE),
            state=replace(VehicleState.rolling(3.0), ax=1.0, ay=-2.0),
        )
        simulator.step(BeltCommand(3.0, 3.0))
        theta = GROUNDS[mode].parameters
        if mode == "soil":
            theta[0] /= ratio
        np.testing.assert_allclose(seen[0], [3.0, 0, 0, 1.0 / ratio, -2.0 / ratio, 3.0, 3.0, *theta], rtol=1e-14)

    @pytest.mark.parametrize(("integrator", "order"), [("implicit", 1), ("euler", 1), ("sdirk2", 2)])
    def test_every_integrator_pulls_as_the_closed_form_does(
        self, viscous: Callable[..., ForceBackend], integrator: Any, order: int
    ) -> None:
        """dV/dt = −r V + g_x with drag r: the viscous force is proportional to the mass, so that it takes the ratio."""
        ground = SlopedGround(named("asphalt"), self.GRADE)
        drag = 1.5 * math.cos(self.GRADE)
        expected = -G * math.sin(self.GRADE) / drag * (1 - math.exp(-drag * 0.8))
        errors = []
        for tick in (0.02, 0.01):
            simulator = Simulator(M113, viscous(rate=1.5), ground, tick=tick, integrator=integrator)
            for _ in range(round(0.8 / tick)):
                record = simulator.step(IDLE)
            errors.append(abs(record.state.vx - expected))
        assert errors[1] < 2e-2 * abs(expected)
        assert errors[0] / errors[1] == pytest.approx(2**order, rel=0.05)

    def test_a_steeper_hill_is_a_slower_climb(self) -> None:
        speeds = []
        for grade in (-0.3, 0.0, 0.3):
            simulator = Simulator(
                M113, "physics", SlopedGround(named("lete-sand"), grade), state=VehicleState.rolling(3.0)
            )
            for _ in range(200):
                record = simulator.step(BeltCommand(3.0, 3.0))
            speeds.append(record.state.vx)
        assert speeds[0] > speeds[1] > speeds[2]
        assert speeds[0] > 3.0  # downhill it overruns its belts


def creep(ground: Terrain, degrees: float, contact: Contact) -> float:
    """Speed in m/s at which locked tracks creep down: they hold W_z's friction by 1 − e^(−z), z = v L/(2 V_ε K).

    Every cell has the same velocity, and with a stopped belt the same contact time; cohesion is not faded.
    """
    angle = math.radians(degrees)
    length = M113.contact_length if contact == "continuous" else M113.contact_length / 5
    strength = M113.weight * math.cos(angle)
    if isinstance(ground, SoilTerrain):
        strength *= math.tan(ground.phi)
        strength += ground.c * 2 * M113.contact_length * M113.track_width
    else:
        strength *= ground.mu
    z = -math.log1p(-M113.weight * math.sin(angle) / strength)
    return z * 2 * 0.1 * ground.k / length


class TestHeldOnAGrade:
    @staticmethod
    def settle(ground: Ground, contact: Contact = "continuous", heading: float = 0.0) -> VehicleState:
        backend = PhysicsBackend(M113, ground.mode, contact=contact)
        simulator = Simulator(M113, backend, ground, state=VehicleState(heading=heading))
        for _ in range(200):
            record = simulator.step(IDLE)
        return record.state

    @every_mode
    @pytest.mark.parametrize("contact", CONTACTS)
    @pytest.mark.parametrize("degrees", [-10.0, 5.0, 10.0])
    def test_it_creeps_downhill_as_fast_as_its_shear_needs(self, mode: Mode, contact: Contact, degrees: float) -> None:
        state = self.settle(SlopedGround(GROUNDS[mode], grade=math.radians(degrees)), contact)
        expected = math.copysign(creep(GROUNDS[mode], abs(degrees), contact), -degrees)
        assert state.vx == pytest.approx(expected, rel=1e-6)  # 1e-11 m/s of a tenth of a millimetre a second
        assert abs(state.vy) < 1e-9
        assert abs(state.yaw_rate) < 1e-9

    @pytest.mark.parametrize("degrees", [1.0, 5.0, 10.0])
    def test_for_small_loads_that_is_linear_in_the_load(self, degrees: float) -> None:
        asphalt = named("asphalt")
        assert not isinstance(asphalt, SoilTerrain)
        angle = math.radians(degrees)
        state = self.settle(SlopedGround(asphalt, grade=angle))
        linear = 2 * asphalt.k * 0.1 * math.sin(angle) / (asphalt.mu * M113.contact_length)
        # −ln(1 − q) = q (1 + q/2 + q²/3 + ...), q = tan γ/μ: 6 % at 5 degrees; and cos γ of the load is left out.
        share = math.tan(angle) / asphalt.mu
        assert -state.vx / linear == pytest.approx(1 + share / 2 + share**2 / 3, abs=share**3 / 2 + angle**2)

    @every_mode
    def test_on_a_bank_it_creeps_sideways_at_the_same_speed(self, mode: Mode) -> None:
        state = self.settle(SlopedGround(GROUNDS[mode], bank=math.radians(10.0)))
        assert state.vy == pytest.approx(-creep(GROUNDS[mode], 10.0, "continuous"), rel=1e-6)
        assert abs(state.vx) < 1e-9
        assert abs(state.yaw_rate) < 1e-9

    def test_whatever_its_heading_it_moves_downhill(self) -> None:
        state = self.settle(SlopedGround(named("asphalt"), grade=math.radians(10.0)), heading=0.6)
        velocity = complex(state.vx, state.vy) * np.exp(1j * state.heading)
        assert velocity == pytest.approx(-creep(named("asphalt"), 10.0, "continuous"), rel=1e-3)

    def test_on_ice_it_slides(self) -> None:
        """Steeper than the friction holds: g (sin γ − μ cos γ), once sheared through."""
        simulator = Simulator(M113, "physics", SlopedGround(named("ice"), grade=-math.radians(20.0)))
        for _ in range(200):
            record = simulator.step(IDLE)
        ice = named("ice")
        assert not isinstance(ice, SoilTerrain)
        before = record.state.vx
        after = simulator.step(IDLE).state.vx
        rate = G * (math.sin(math.radians(20.0)) - ice.mu * math.cos(math.radians(20.0)))
        assert (after - before) / TICK == pytest.approx(rate, rel=1e-9)


class TestLevel:
    @every_mode
    @pytest.mark.parametrize("integrator", ["implicit", "sdirk2", "euler"])
    def test_a_slope_of_nothing_changes_no_bit(self, weave: Weave, mode: Mode, integrator: Any) -> None:
        plain, sloped = (
            weave(Simulator(M113, "physics", ground, integrator=integrator), 150)[1]
            for ground in (GROUNDS[mode], SlopedGround(GROUNDS[mode], 0.0, 0.0))
        )
        for a, b in zip(plain, sloped, strict=True):
            assert a.state == b.state
            assert a.row.tobytes() == b.row.tobytes()
            assert a.forces.tobytes() == b.forces.tobytes()
            assert a.footing.gravity == b.footing.gravity == LEVEL

    def test_the_log_of_level_ground_says_so(self, scripted: Any) -> None:
        log = rollout(Simulator(M113, "physics", named("asphalt")), scripted(belts), 0.5)
        np.testing.assert_array_equal(log.gravity, np.tile([0.0, 0.0, 9.81], (50, 1)))
        np.testing.assert_array_equal(log.right_theta, log.inputs[:, 7:])
        assert log.meta["ground_sampling"] == "vehicle"


class TestSplitGround:
    @staticmethod
    def first_turn(command: float, *, speed: float, heading: float = 0.0, sampling: GroundSampling = "tracks") -> float:
        """Yaw moment after a tenth of a second of equal belts, along the line where the grounds meet."""
        state = VehicleState.rolling(speed, heading=heading)
        simulator = Simulator(M113, "physics", split_ground(), ground_sampling=sampling, state=state)
        for _ in range(10):
            record = simulator.step(BeltCommand(command, command))
        return float(record.forces[2])

    def test_under_power_the_track_that_holds_pushes_the_vehicle_toward_the_ice(self) -> None:
        assert self.first_turn(8.0, speed=3.0) < -5e3

    def test_under_brakes_it_pulls_the_vehicle_toward_the_asphalt(self) -> None:
        assert self.first_turn(0.0, speed=3.0) > 5e3

    def test_the_other_way_round_it_pulls_the_other_way(self) -> None:
        there, back = (self.first_turn(0.0, speed=3.0, heading=heading) for heading in (0.0, math.pi))
        assert back == pytest.approx(-there, rel=1e-6)

    def test_sampled_at_the_vehicle_it_does_not_pull(self) -> None:
        assert self.first_turn(0.0, speed=3.0, sampling="vehicle") == 0.0

    @every_mode
    @pytest.mark.parametrize("grade", [0.0, 0.15])
    def test_the_log_tells_what_each_track_received_and_what_came_of_it(
        self, scripted: Any, mode: Mode, grade: float
    ) -> None:
        ground = SlopedGround(split_ground(mode), grade)
        start = VehicleState(y=1.5, heading=-0.4)  # on its way across the border
        simulator = Simulator(M113, "physics", ground, ground_sampling="tracks", state=start)
        log = rollout(simulator, scripted(belts), 3.5)
        assert log.meta["ground_sampling"] == "tracks"
        assert_balanced(log, 1e-11)
        np.testing.assert_array_equal(log.inputs[0, 7:], GROUNDS[mode].parameters)
        np.testing.assert_array_equal(log.right_theta[0], GROUNDS[mode].parameters)
        np.testing.assert_allclose(log.right_theta[-1], WORSE[mode].parameters, rtol=1e-14)
        assert len(np.unique(log.right_theta[:, 0])) > 5
        assert np.mean(log.right_theta[:, 0] != log.inputs[:, 7]) > 0.2
        tracks = np.empty((len(log), 2, 3))
        light_block(mode, log.gravity[0, 2]).track_forces(log.inputs, right_inputs(log), tracks)
        np.testing.assert_allclose(log.forces, tracks.sum(axis=1), rtol=0, atol=1e-12 * M113.weight)

    @every_mode
    @pytest.mark.parametrize("grade", [0.0, 0.15])
    def test_on_uniform_ground_both_ways_of_sampling_are_one(self, weave: Weave, mode: Mode, grade: float) -> None:
        ground = SlopedGround(GROUNDS[mode], grade)
        at_vehicle, at_tracks = (
            weave(Simulator(M113, "physics", ground, ground_sampling=sampling), 200)[1] for sampling in GROUND_SAMPLINGS
        )
        # Round-off, and what Newton's tolerance makes of it.
        for a, b in zip(at_vehicle, at_tracks, strict=True):
            for name in STATE_NAMES:
                assert getattr(a.state, name) == pytest.approx(getattr(b.state, name), abs=1e-9)
            np.testing.assert_array_equal(a.row[7:], b.footing.right_theta)

    def test_a_network_does_not_know_the_tracks_apart(self, make_surrogate: MakeSurrogate) -> None:
        native = make_backend("native", mode="rigid", artifact=make_surrogate("rigid"))
        message = (
            "the 'native' backend gives the force of the whole vehicle: use ground_sampling='vehicle', or a backend"
        )
        with pytest.raises(ConfigurationError, match=message):
            Simulator(M113, native, named("asphalt"), ground_sampling="tracks")
        with pytest.raises(ConfigurationError, match=message):
            PathTrackingEnv(native, M113, "asphalt", ground_sampling="tracks")

    def test_a_backend_of_ones_own_does_not_either(self, viscous: Callable[..., ForceBackend]) -> None:
        with pytest.raises(ConfigurationError, match="'viscous'"):
            Simulator(M113, viscous(), named("asphalt"), ground_sampling="tracks")

    def test_another_name_is_answered_with_the_nearest(self) -> None:
        with pytest.raises(ConfigurationError, match="unknown ground sampling 'track'; did you mean 'tracks'"):
            Simulator(M113, "physics", named("asphalt"), ground_sampling="track")  # type: ignore[arg-type]


# The environment

#: What a vehicle that keeps to the task can reach: 5 m, a control period at 18 m/s, and the tread.
REACH = 5.0 + 1.8 + 2.159
STRAIGHT = (-REACH - 0.1, 120 + REACH + 0.1, -REACH - 0.1, REACH + 0.1)


def act(left: float, right: float) -> NDArray[np.float32]:
    return np.array([left, right], dtype=np.float32)


def run(env: PathTrackingEnv, steps: int = 15, **options: Any) -> list[Any]:
    generator = np.random.default_rng(3)
    trace: list[Any] = [env.reset(seed=1, options=options or None)[0].tobytes()]
    for _ in range(steps):
        observation, reward, _, _, info = env.step(generator.uniform(0.0, 1.0, 2).astype(np.float32))
        trace.append((observation.tobytes(), reward, info["force"].tobytes()))
    return trace


class TestEnvironmentOnAMap:
    @pytest.mark.parametrize("kind", [str, FilePath])
    def test_from_a_file(self, tmp_path: FilePath, kind: Any) -> None:
        field = split_ground(extent=STRAIGHT)
        file = save_field(field, tmp_path / "split.npz")
        from_file, from_field = (
            PathTrackingEnv("physics", M113, terrain, "straight") for terrain in (kind(file), field)
        )
        assert run(from_file) == run(from_field)
        assert run(from_file) != run(PathTrackingEnv("physics", M113, "asphalt", "straight"))

    def test_for_one_episode(self, tmp_path: FilePath) -> None:
        file = save_field(split_ground(extent=STRAIGHT), tmp_path / "split.npz")
        env = PathTrackingEnv("physics", M113, "asphalt", "straight")
        assert run(env, terrain=str(file)) == run(PathTrackingEnv("physics", M113, file, "straight"))
        assert run(env) == run(PathTrackingEnv("physics", M113, "asphalt", "straight"))

    def test_observes_the_ground_under_the_vehicle(self) -> None:
        field = paint_field(named("asphalt"), STRAIGHT, patches=[Patch(named("ice"), Rectangle(x_min=60.0))])
        env = PathTrackingEnv("physics", M113, field, "straight", observe_terrain=True)
        for place, ground in ((30.0, "asphalt"), (90.0, "ice")):
            observation, _ = env.reset(seed=0, options={"arc_length": place})
            alone = PathTrackingEnv("physics", M113, ground, "straight", observe_terrain=True)
            np.testing.assert_allclose(observation[19:], alone.reset(seed=0)[0][19:], rtol=1e-6)

    @pytest.mark.parametrize("extent", [(-8.9, 129, -9, 9), (-9, 128.9, -9, 9), (-9, 129, -8.9, 9), (-9, 129, -9, 8.9)])
    def test_that_is_too_small_is_refused_up_front_with_the_extents(
        self, extent: tuple[float, float, float, float]
    ) -> None:
        field = TerrainField.uniform(named("asphalt"), extent, spacing=0.1)
        message = r"must reach x -9\.0 to 129\.0 and y -9\.0 to 9\.0 m on this path.*outside='extend'"
        with pytest.raises(InvalidInputError, match=message) as caught:
            PathTrackingEnv("physics", M113, field, "straight")
        assert "map, x {:g} to {:g} and y {:g} to {:g} m,".format(*extent) in str(caught.value)

    def test_that_is_too_small_under_a_slope_or_for_one_episode(self) -> None:
        small = TerrainField.uniform(named("asphalt"), (0.0, 100.0, -10.0, 10.0))
        with pytest.raises(InvalidInputError, match="x 0 to 100 and y -10 to 10 m, must reach"):
            PathTrackingEnv("physics", M113, SlopedGround(SlopedGround(small, 0.1), 0.1), "straight", grade=0.05)
        env = PathTrackingEnv("physics", M113, "asphalt", "straight")
        with pytest.raises(InvalidInputError, match="must reach"):
            env.reset(seed=0, options={"terrain": small})

    def test_a_refused_map_leaves_the_episode_alone(self) -> None:
        env, other = (PathTrackingEnv("physics", M113, "asphalt", "straight") for _ in range(2))
        for each in (env, other):
            each.reset(seed=0)
        with pytest.raises(InvalidInputError):
            env.reset(options={"terrain": TerrainField.uniform(named("ice"), (0.0, 100.0, -10.0, 10.0))})
        assert env.step(act(0.5, 0.6))[0].tobytes() == other.step(act(0.5, 0.6))[0].tobytes()

    def test_a_shorter_task_takes_a_smaller_map(self) -> None:
        field = TerrainField.uniform(named("asphalt"), (-6.0, 126.0, -6.0, 6.0))
        PathTrackingEnv("physics", M113, field, "straight", maximum_cross_track=2.0)
        with pytest.raises(InvalidInputError, match="must reach"):
            PathTrackingEnv("physics", M113, field, "straight", maximum_cross_track=2.0, control_period=0.2)

    def test_that_goes_on_beyond_its_borders_may_be_small(self) -> None:
        field = TerrainField.uniform(named("asphalt"), (0.0, 1.0, 0.0, 1.0), outside="extend")
        env = PathTrackingEnv("physics", M113, SlopedGround(field), "straight")
        assert run(env) == run(PathTrackingEnv("physics", M113, "asphalt", "straight"))

    def test_around_a_curved_path(self) -> None:
        path = make_path("circle", M113)
        places = np.array([path.point_at(s) for s in np.linspace(0.0, path.length, 500)])
        (x_min, y_min), (x_max, y_max) = places.min(axis=0) - REACH - 0.1, places.max(axis=0) + REACH + 0.1
        PathTrackingEnv("physics", M113, TerrainField.uniform(named("ice"), (x_min, x_max, y_min, y_max)), path)
        with pytest.raises(InvalidInputError, match="must reach"):
            PathTrackingEnv("physics", M113, TerrainField.uniform(named("ice"), (x_min + 1, x_max, y_min, y_max)), path)

    @pytest.mark.parametrize("action", [act(-1.0, -1.0), act(1.0, 1.0), act(1.0, -0.2)], ids=["back", "on", "aside"])
    def test_of_the_least_size_is_large_enough_for_any_episode(self, action: NDArray[np.float32]) -> None:
        """A map that was accepted up front is not left before the episode ends."""
        field = TerrainField.uniform(named("asphalt"), STRAIGHT, spacing=0.5)
        env = PathTrackingEnv("physics", M113, field, "straight", time_limit=20.0)
        env.reset(seed=0)
        for _ in range(200):
            _, _, terminated, truncated, _ = env.step(action)
            if terminated or truncated:
                break
        assert terminated or truncated

    @pytest.mark.parametrize(
        "options", [{"arc_length": -60.0}, {"state": VehicleState(x=500.0)}], ids=["behind", "ahead"]
    )
    @pytest.mark.parametrize("observe_terrain", [False, True])
    def test_a_start_that_is_not_on_it_is_refused_by_the_reset(
        self, options: dict[str, Any], observe_terrain: bool
    ) -> None:
        field = TerrainField.uniform(named("asphalt"), STRAIGHT, spacing=0.5)
        env, other = (
            PathTrackingEnv("physics", M113, field, "straight", observe_terrain=observe_terrain) for _ in range(2)
        )
        for each in (env, other):
            each.reset(seed=0)
        with pytest.raises(InvalidInputError, match="off the terrain field's map"):
            env.reset(options=options)
        assert env.step(act(0.5, 0.6))[0].tobytes() == other.step(act(0.5, 0.6))[0].tobytes()


class TestEnvironmentOnASlope:
    def test_the_settings_tilt_the_plane(self) -> None:
        env = PathTrackingEnv("physics", M113, "asphalt", "straight", grade=0.1, bank=-0.05)
        assert env.simulator.ground.gradient_at(7.0, 3.0) == (math.tan(0.1), math.tan(-0.05))
        sloped = SlopedGround(named("asphalt"), 0.1, -0.05)
        assert run(env) == run(PathTrackingEnv("physics", M113, sloped, "straight"))
        assert run(env) != run(PathTrackingEnv("physics", M113, "asphalt", "straight"))

    def test_they_hold_for_the_ground_of_one_episode_too(self) -> None:
        env = PathTrackingEnv("physics", M113, "asphalt", "straight", grade=0.1)
        expected = run(PathTrackingEnv("physics", M113, "ice", "straight", grade=0.1))
        assert run(env, terrain="ice") == expected

    def test_no_slope_changes_no_bit(self) -> None:
        flat = PathTrackingEnv("physics", M113, "asphalt", "straight", grade=0.0, bank=0.0, ground_sampling="vehicle")
        assert run(flat) == run(PathTrackingEnv("physics", M113, "asphalt", "straight"))

    @pytest.mark.parametrize("name", ["grade", "bank"])
    @pytest.mark.parametrize("value", [0.8, -0.8, math.nan, "steep"])
    def test_an_impossible_slope_is_refused(self, name: str, value: Any) -> None:
        with pytest.raises(InvalidInputError, match=f"{name} must lie in"):
            PathTrackingEnv("physics", M113, "asphalt", "straight", **{name: value})

    def test_another_sampling_is_answered_with_the_nearest(self) -> None:
        with pytest.raises(ConfigurationError, match="unknown ground sampling 'vehicles'; did you mean 'vehicle'"):
            PathTrackingEnv("physics", M113, "asphalt", "straight", ground_sampling="vehicles")

    @pytest.mark.parametrize("grade", [0.1, -0.1])
    def test_climbing_takes_the_power_of_its_height(self, grade: float) -> None:
        env = PathTrackingEnv("physics", M113, "asphalt", "straight", grade=grade)
        env.reset(seed=0, options={"lateral_offset": 0.0, "heading_offset": 0.0, "speed": 5.0})
        for _ in range(30):
            info = env.step(act(0.5, 0.5))[4]
        power = M113.weight * 5.0 * (math.sin(grade) + named("asphalt").fr * math.cos(grade))
        # The belts are at 5 m/s and the shear force carries slope and rolling resistance; the transient has died out.
        assert info["sprocket_power"] == pytest.approx(power, rel=1e-3)

    @every_mode
    @pytest.mark.parametrize("sampling", GROUND_SAMPLINGS)
    @pytest.mark.parametrize("grade", [0.0, 0.15])
    def test_the_tracks_sum_to_the_force_and_slip_costs(
        self, mode: Mode, sampling: GroundSampling, grade: float
    ) -> None:
        ground = split_ground(mode)
        env = PathTrackingEnv("physics", M113, ground, "straight", grade=grade, bank=0.05, ground_sampling=sampling)
        env.reset(seed=0)
        generator = np.random.default_rng(0)
        for _ in range(12):
            start = env.simulator.get_state()
            action = generator.uniform(-0.2, 1.0, 2).astype(np.float32)
            info = env.step(action)[4]
            np.testing.assert_allclose(info["track_forces"].sum(axis=0), info["force"], rtol=0, atol=1e-6)
            assert info["reward_terms"]["slip_power"] <= 1e-15
        assert np.any(info["track_forces"][0] != info["track_forces"][1])
        # The last tick once more, each track asked by itself under the gravity of the slope.
        twin = Simulator(M113, "physics", env.simulator.ground, ground_sampling=sampling, state=start)
        for _ in range(10):
            record = twin.step(BeltCommand(*(10.0 * float(value) for value in action)))
        right = np.concatenate([record.row[:7], record.footing.right_theta])
        tracks = np.empty((1, 2, 3))
        light_block(mode, record.footing.gravity.z).track_forces(record.row[None], right[None], tracks)
        np.testing.assert_allclose(info["track_forces"], tracks[0], rtol=0, atol=1e-12 * M113.weight)
