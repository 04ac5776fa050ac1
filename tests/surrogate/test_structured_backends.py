"""The structured surrogate as a force backend, in torch and in C: held to its own float64 equations."""

import pickle
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from grouser.envs import BeltCommand, Simulator, VehicleState
from grouser.surrogate import (
    ACTIVATIONS,
    NUMPY_NETWORK,
    Activation,
    DenseNetwork,
    NativeSurrogate,
    Normalizer,
    Surrogate,
    TorchSurrogate,
    random_network,
    torch_network,
)
from grouser.surrogate.track_model import FEATURES
from grouser.terrain import (
    GRAVITY,
    MODES,
    ArtifactError,
    ConfigurationError,
    FloatArray,
    ForceBackend,
    InvalidInputError,
    Mode,
    Patch,
    PhysicsBackend,
    Rectangle,
    SlopedGround,
    TrackedVehicle,
    assemble,
    interface,
    level_equivalent,
    make_backend,
    mirror_forces,
    named,
    paint_field,
)

Make = Callable[..., Surrogate]
Rows = Callable[..., tuple[FloatArray, Any]]
BACKENDS = (NativeSurrogate, TorchSurrogate)
M113 = TrackedVehicle.preset("m113")
every_mode = pytest.mark.parametrize("mode", MODES)
every_kind = pytest.mark.parametrize("kind", BACKENDS)
#: Two wheels with a gap between them, five, six with the CG off the middle, a single one, and two that share a track.
VEHICLES = {
    "warthog": TrackedVehicle.preset("warthog"),
    "m113": M113,
    "marder": replace(TrackedVehicle.preset("marder"), cg_offset=0.2),
    "one": replace(M113, road_wheels=1),
    "two": replace(M113, road_wheels=2, contact="per_wheel", cg_offset=-0.1),
}
every_vehicle = pytest.mark.parametrize("vehicle", VEHICLES.values(), ids=VEHICLES.keys())


@pytest.fixture(autouse=True)
def _one_thread() -> Iterator[None]:
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(threads)


@pytest.fixture
def all_rows(driving_rows: Rows) -> Callable[[TrackedVehicle, Mode], FloatArray]:
    """Driven rows, on the last hundred of which wheels and tracks lift off."""

    def make(vehicle: TrackedVehicle, mode: Mode) -> FloatArray:
        x, _ = driving_rows(vehicle, mode, runs=5, samples=60, seed=3)
        x[200:, 3:5] *= 8.0
        return x

    return make


@pytest.fixture(params=BACKENDS)
def backend(request: pytest.FixtureRequest, make_structured: Make) -> ForceBackend:
    built: ForceBackend = request.param(M113, "rigid", make_structured())
    return built


@pytest.fixture
def rows(driving_rows: Rows) -> FloatArray:
    x: FloatArray = driving_rows(M113, "rigid", runs=3, samples=40, seed=7)[0]
    return x


def oracle_jacobian(surrogate: Surrogate, x: FloatArray) -> FloatArray:
    """The float64 oracle's Jacobian, by torch."""
    rows = torch.tensor(x, requires_grad=True)
    forces = surrogate.evaluate(torch_network(), rows)
    parts = [torch.autograd.grad(forces[:, i].sum(), rows, retain_graph=True)[0] for i in range(3)]
    jacobian: FloatArray = torch.stack(parts, dim=1).numpy()
    return jacobian


def central_differences(surrogate: Surrogate, x: FloatArray) -> FloatArray:
    """The same in NumPy, from forces alone."""
    jacobian = np.empty((len(x), 3, x.shape[1]))
    for column in range(x.shape[1]):
        step = 1e-6 * max(float(np.abs(x[:, column]).max()), 1e-2)
        step = min(step, 1e-3 * float(x[:, column].min())) if column >= 7 else step
        ahead, behind = x.copy(), x.copy()
        ahead[:, column] += step
        behind[:, column] -= step
        jacobian[:, :, column] = (surrogate.reference_forces(ahead) - surrogate.reference_forces(behind)) / (2 * step)
    return jacobian


# --- parity


@every_mode
@every_vehicle
def test_forces_agree_with_the_oracle(
    make_structured: Make, all_rows: Callable[..., FloatArray], vehicle: TrackedVehicle, mode: Mode
) -> None:
    surrogate, x = make_structured(mode, hidden=(44, 44), vehicle=vehicle), all_rows(vehicle, mode)
    expected = surrogate.reference_forces(x)
    for kind in BACKENDS:
        backend = kind(vehicle, mode, surrogate)
        for forces in (backend.forces(x), backend.forces_and_jacobian(x)[0]):
            assert np.abs((forces - expected) / expected.std(axis=0)).max() < 1e-5  # measured 4e-7


@pytest.mark.parametrize("activation", ACTIVATIONS)
@every_mode
@every_vehicle
def test_jacobians_agree_with_the_oracle(
    make_structured: Make,
    all_rows: Callable[..., FloatArray],
    vehicle: TrackedVehicle,
    mode: Mode,
    activation: Activation,
) -> None:
    surrogate, x = make_structured(mode, activation, vehicle=vehicle), all_rows(vehicle, mode)
    expected = oracle_jacobian(surrogate, x)
    unit = x.std(axis=0) / surrogate.reference_forces(x).std(axis=0)[:, None]
    for kind in BACKENDS:
        _, jacobian = kind(vehicle, mode, surrogate).forces_and_jacobian(x)
        assert jacobian.shape == (len(x), 3, x.shape[1])
        # A kink of relu within float32 of a row gives one of two slopes.
        error = np.sort(np.abs((jacobian - expected) * unit).max(axis=(1, 2)))
        assert error[-3 if activation == "relu" else -1] < 1e-3  # measured 6e-6 but for relu


@every_mode
@every_vehicle
def test_jacobians_are_the_slopes_of_the_forces(
    make_structured: Make, driving_rows: Rows, vehicle: TrackedVehicle, mode: Mode
) -> None:
    surrogate = make_structured(mode, vehicle=vehicle)
    x, _ = driving_rows(vehicle, mode, runs=3, samples=40, seed=4)
    expected = central_differences(surrogate, x)
    unit = x.std(axis=0) / surrogate.reference_forces(x).std(axis=0)[:, None]
    _, jacobian = NativeSurrogate(vehicle, mode, surrogate).forces_and_jacobian(x)
    assert np.abs((jacobian - expected) * unit).max() < 1e-3  # measured 5e-6
    acting = np.abs(expected * unit).max(axis=(0, 1)) > 1e-2
    assert acting.sum() == x.shape[1] - (vehicle.road_wheels == 1)  # ax shifts the load from wheel to wheel


@every_mode
def test_next_to_rest_slopes_stay_those_of_the_oracle(make_structured: Make, driving_rows: Rows, mode: Mode) -> None:
    surrogate = make_structured(mode)
    x, _ = driving_rows(M113, mode, runs=6, samples=20, seed=5)
    x[:, :3] *= 10.0 ** np.repeat([0, -2, -4, -8, -12, -300], 20)[:, None]
    x[:, 5:7] *= 10.0 ** np.repeat([0, -2, -4, -8, -12, -300], 20)[:, None]
    x[-1, [0, 1, 2, 5, 6]] = 0.0
    expected = oracle_jacobian(surrogate, x)
    scale = np.abs(expected).max(axis=0)
    for kind in BACKENDS:
        forces, jacobian = kind(M113, mode, surrogate).forces_and_jacobian(x)
        assert np.isfinite(jacobian).all()
        assert np.all(np.abs(jacobian - expected) <= 1e-5 * scale)  # measured 4e-7, of float32
        spread = surrogate.reference_forces(x).std(axis=0)
        assert np.all(np.abs(forces - surrogate.reference_forces(x)) <= 1e-5 * spread)


# --- what holds to the bit


@every_mode
@every_vehicle
def test_the_compiled_mirror_image_is_exact_with_its_jacobian(
    make_structured: Make, all_rows: Callable[..., FloatArray], vehicle: TrackedVehicle, mode: Mode
) -> None:
    x, table = all_rows(vehicle, mode), interface(mode)
    backend = NativeSurrogate(vehicle, mode, make_structured(mode, vehicle=vehicle))
    forces, jacobian = backend.forces_and_jacobian(x)
    mirrored, slopes = backend.forces_and_jacobian(table.mirror(x))
    np.testing.assert_array_equal(mirrored, mirror_forces(forces))
    np.testing.assert_array_equal(backend.forces(table.mirror(x)), mirror_forces(backend.forces(x)))
    signs = np.array([1.0, -1.0, -1.0])[:, None] * table.mirror_signs
    np.testing.assert_array_equal(slopes, jacobian[..., table.mirror_permutation] * signs)
    tracks, images = backend.track_forces(x, x), backend.track_forces(table.mirror(x), table.mirror(x))
    np.testing.assert_array_equal(images, mirror_forces(tracks[:, ::-1]))


@every_kind
@every_mode
@every_vehicle
def test_a_vehicle_at_rest_feels_no_force_at_all(
    make_structured: Make, driving_rows: Rows, vehicle: TrackedVehicle, mode: Mode, kind: Any
) -> None:
    x, _ = driving_rows(vehicle, mode, runs=2, samples=20)
    x[:, [0, 1, 2, 5, 6]] = 0.0
    backend = kind(vehicle, mode, make_structured(mode, vehicle=vehicle))
    assert np.all(backend.forces(x) == 0)
    assert np.all(backend.forces_and_jacobian(x)[0] == 0)
    assert np.all(backend.track_forces(x, x) == 0)


@every_mode
def test_a_compiled_batch_gives_what_its_rows_give(
    make_structured: Make, all_rows: Callable[..., FloatArray], mode: Mode
) -> None:
    x = all_rows(M113, mode)
    backend = NativeSurrogate(M113, mode, make_structured(mode))
    forces, jacobian = backend.forces_and_jacobian(x)
    np.testing.assert_array_equal(backend.forces(x), forces)
    for i in range(0, len(x), 7):
        one, slopes = backend.forces_and_jacobian(x[i])
        assert (one.shape, slopes.shape) == ((3,), (3, x.shape[1]))
        np.testing.assert_array_equal(one, forces[i])
        np.testing.assert_array_equal(slopes, jacobian[i])
        np.testing.assert_array_equal(backend.forces(x[i]), forces[i])


def test_a_batch_in_torch_gives_what_its_rows_give(make_structured: Make, rows: FloatArray) -> None:
    backend = TorchSurrogate(M113, "rigid", make_structured())
    forces, jacobian = backend.forces_and_jacobian(rows)
    one, slopes = backend.forces_and_jacobian(rows[5])
    # Products of other shapes are summed in another order, in float32.
    np.testing.assert_allclose(one, forces[5], atol=1e-5 * forces.std())
    np.testing.assert_allclose(slopes, jacobian[5], atol=1e-5 * np.abs(jacobian[5]).max())
    assert backend.forces(rows[5]).shape == (3,)


def test_no_rows_give_no_forces(backend: ForceBackend) -> None:
    forces, jacobian = backend.forces_and_jacobian(np.empty((0, 10)))
    assert (forces.shape, jacobian.shape) == ((0, 3), (0, 3, 10))
    assert backend.track_forces(np.empty((0, 10)), np.empty((0, 10))).shape == (0, 2, 3)


def test_the_input_is_left_as_it_was(backend: ForceBackend, rows: FloatArray) -> None:
    before = rows.copy()
    backend.forces_and_jacobian(rows)
    backend.forces(rows)
    backend.track_forces(rows, rows)
    np.testing.assert_array_equal(rows, before)


def test_four_threads_give_the_results_of_one(backend: ForceBackend, rows: FloatArray) -> None:
    expected, tracks = backend.forces_and_jacobian(rows), backend.track_forces(rows, rows)
    with ThreadPoolExecutor(4) as pool:
        for forces, jacobian in pool.map(lambda _: backend.forces_and_jacobian(rows), range(8)):
            np.testing.assert_array_equal(forces, expected[0])
            np.testing.assert_array_equal(jacobian, expected[1])
        for found in pool.map(lambda _: backend.track_forces(rows, rows), range(8)):
            np.testing.assert_array_equal(found, tracks)


def test_pickling_keeps_the_forces_and_the_tracks(backend: ForceBackend, rows: FloatArray) -> None:
    again = pickle.loads(pickle.dumps(backend))
    assert type(again) is type(backend)
    assert again.describe() == backend.describe()
    assert again.has_track_forces
    np.testing.assert_array_equal(again.forces(rows), backend.forces(rows))
    np.testing.assert_array_equal(again.track_forces(rows, rows), backend.track_forces(rows, rows))


# --- tracks


def test_whether_tracks_are_known_is_a_matter_of_the_artifact(
    make_surrogate: Make, make_structured: Make, rows: FloatArray
) -> None:
    for kind in BACKENDS:
        structured, plain = (kind(M113, "rigid", make()) for make in (make_structured, make_surrogate))
        assert structured.has_track_forces
        assert not plain.has_track_forces
        assert not kind.has_track_forces
        for method in ("track_forces", "track_forces_and_jacobian"):
            with pytest.raises(ConfigurationError, match="has_track_forces"):
                getattr(plain, method)(rows, rows)


@every_mode
@every_vehicle
def test_tracks_sum_to_the_vehicle(
    make_structured: Make, all_rows: Callable[..., FloatArray], vehicle: TrackedVehicle, mode: Mode
) -> None:
    surrogate, x = make_structured(mode, vehicle=vehicle), all_rows(vehicle, mode)
    compiled = NativeSurrogate(vehicle, mode, surrogate)
    tracks, slopes = compiled.track_forces_and_jacobian(x, x)
    forces, jacobian = compiled.forces_and_jacobian(x)
    assert (tracks.shape, slopes.shape) == ((len(x), 2, 3), (len(x), 2, 3, x.shape[1]))
    np.testing.assert_array_equal(compiled.track_forces(x, x), tracks)
    np.testing.assert_array_equal(assemble(tracks), forces)
    np.testing.assert_array_equal(slopes.sum(axis=1), jacobian)
    in_torch = TorchSurrogate(vehicle, mode, surrogate)
    summed, whole = assemble(in_torch.track_forces(x, x)), in_torch.forces(x)
    np.testing.assert_allclose(summed, whole, rtol=0, atol=1e-12 * np.abs(tracks).max())
    assert np.all(np.abs(in_torch.track_forces(x, x) - tracks) <= 1e-5 * tracks.std(axis=(0, 1)))
    left, right = (
        np.concatenate(surrogate.evaluate_track(NUMPY_NETWORK, x, side), axis=-1) for side in ("left", "right")
    )
    assert np.all(np.abs(np.stack([left, right], axis=1) - tracks) <= 1e-5 * tracks.std(axis=(0, 1)))


@every_kind
@every_mode
def test_each_track_feels_its_own_ground(make_structured: Make, driving_rows: Rows, mode: Mode, kind: Any) -> None:
    backend = kind(M113, mode, make_structured(mode))
    left, _ = driving_rows(M113, mode, runs=3, samples=20, seed=8)
    right = left.copy()
    right[:, 7:] = driving_rows(M113, mode, runs=3, samples=20, seed=9)[0][:, 7:]
    both = backend.track_forces(left, right)
    np.testing.assert_array_equal(both[:, 0], backend.track_forces(left, left)[:, 0])
    np.testing.assert_array_equal(both[:, 1], backend.track_forces(right, right)[:, 1])
    assert np.all(np.abs(both - backend.track_forces(left, left)).max(axis=0)[1] > 0)
    # Torch sums a single row in another order, in float32: newtons in tens of kilonewtons.
    np.testing.assert_allclose(backend.track_forces(left[0], right[0]), both[:1], rtol=1e-4, atol=1.0)


@every_mode
def test_the_jacobian_of_each_track_is_by_its_own_ground(make_structured: Make, driving_rows: Rows, mode: Mode) -> None:
    backend = NativeSurrogate(M113, mode, make_structured(mode))
    left, _ = driving_rows(M113, mode, runs=3, samples=20, seed=8)
    right = left.copy()
    right[:, 7:] = driving_rows(M113, mode, runs=3, samples=20, seed=9)[0][:, 7:]
    forces, jacobian = backend.track_forces_and_jacobian(left, right)
    np.testing.assert_array_equal(forces, backend.track_forces(left, right))
    for side, x, column in ((0, left, 6), (1, right, 5)):
        np.testing.assert_array_equal(jacobian[:, side], backend.track_forces_and_jacobian(x, x)[1][:, side])
        assert np.all(jacobian[:, side, :, column] == 0)  # the other track's belt


def test_the_slopes_of_the_tracks_in_torch_are_those_of_the_compiled_ones(
    make_structured: Make, rows: FloatArray
) -> None:
    surrogate = make_structured()
    expected, by_column = NativeSurrogate(M113, "rigid", surrogate).track_forces_and_jacobian(rows, rows)
    forces, jacobian = TorchSurrogate(M113, "rigid", surrogate).track_forces_and_jacobian(rows, rows)
    assert np.all(np.abs(forces - expected) <= 1e-5 * expected.std(axis=(0, 1)))
    unit = rows.std(axis=0) / expected.std(axis=(0, 1))[:, None]
    assert np.abs((jacobian - by_column) * unit).max() < 1e-3


def test_tracks_of_different_length_are_refused(backend: ForceBackend, rows: FloatArray) -> None:
    with pytest.raises(InvalidInputError, match="equally many rows"):
        backend.track_forces(rows, rows[:5])


# --- what is refused


@pytest.mark.parametrize("k", [0.0, -0.01])
@pytest.mark.parametrize("method", ["forces", "forces_and_jacobian", "track_forces", "track_forces_and_jacobian"])
def test_ground_that_shears_at_no_distance_is_refused(
    backend: ForceBackend, rows: FloatArray, method: str, k: float
) -> None:
    bad = rows.copy()
    bad[3, 9] = k
    arguments = [(bad, rows), (rows, bad)] if method.startswith("track") else [(bad,), (bad[3],)]
    for each in arguments:
        with pytest.raises(InvalidInputError, match="k must be positive"):
            getattr(backend, method)(*each)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("column", ["vy", "ax", "v_right", "fr", "k"])
def test_values_that_are_not_finite_are_refused_by_name(
    backend: ForceBackend, rows: FloatArray, column: str, bad: float
) -> None:
    spoilt = rows.copy()
    spoilt[1, backend.interface.index(column)] = bad
    for arguments in ((spoilt,), (spoilt[1],)):
        for method in (backend.forces, backend.forces_and_jacobian):
            with pytest.raises(InvalidInputError, match=rf"\b{column}\b"):
                method(*arguments)
    for left, right in ((spoilt, rows), (rows, spoilt)):
        for by_track in (backend.track_forces, backend.track_forces_and_jacobian):
            with pytest.raises(InvalidInputError, match=rf"\b{column}\b"):
                by_track(left, right)


@pytest.mark.parametrize("x", [np.zeros(9), np.zeros((2, 11)), 3.0, ["a"] * 10, None])
def test_wrong_shapes_are_refused(backend: ForceBackend, x: Any) -> None:
    for method in (backend.forces, backend.forces_and_jacobian):
        with pytest.raises(InvalidInputError):
            method(x)
    with pytest.raises(InvalidInputError):
        backend.track_forces(x, x)


def test_a_vehicle_without_soft_speed_is_refused(make_structured: Make) -> None:
    with pytest.raises(ArtifactError, match="soft_speed above 0"):
        replace(make_structured(), vehicle=replace(M113, soft_speed=0.0))


@pytest.mark.parametrize("k", [0.0, -0.01])
def test_the_oracle_refuses_ground_that_shears_at_no_distance(
    make_structured: Make, rows: FloatArray, k: float
) -> None:
    rows[3, 9] = k
    with pytest.raises(InvalidInputError, match="k must be positive"):
        make_structured().reference_forces(rows)


def test_a_network_too_wide_for_the_compiled_one_is_left_to_torch(make_structured: Make, rows: FloatArray) -> None:
    surrogate = make_structured(hidden=(513,))
    with pytest.raises(ConfigurationError, match="use 'torch'"):
        NativeSurrogate(M113, "rigid", surrogate)
    assert np.isfinite(TorchSurrogate(M113, "rigid", surrogate).forces(rows)).all()


def test_parts_of_another_size_are_refused(make_structured: Make, make_surrogate: Make) -> None:
    # On soil, where a plain network has one input more than a structured one.
    surrogate, plain = make_structured("soil"), make_surrogate("soil")

    def network(inputs: int, outputs: int) -> DenseNetwork:
        return random_network((inputs, 8, outputs), "silu", np.random.default_rng(0))

    with pytest.raises(ArtifactError, match="10 network inputs, got 11"):
        replace(surrogate, network=network(11, 15))
    with pytest.raises(ArtifactError, match="15 network outputs, got 3"):
        replace(surrogate, network=network(FEATURES, 3))
    with pytest.raises(ArtifactError, match="10 input normalizer columns, got 11"):
        replace(surrogate, input_normalizer=plain.input_normalizer)
    with pytest.raises(ArtifactError, match="15 output normalizer columns, got 3"):
        replace(surrogate, output_normalizer=plain.output_normalizer)
    with pytest.raises(ArtifactError, match="18 network outputs, got 15"):
        replace(surrogate, vehicle=replace(M113, road_wheels=6))
    with pytest.raises(ArtifactError, match="11 network inputs, got 10"):
        replace(surrogate, feature_map="interface")
    with pytest.raises(ArtifactError, match="10 network inputs, got 11"):
        replace(plain, feature_map="track")


# --- the artifact


@every_mode
@pytest.mark.parametrize("name", ["m113", "warthog"])
def test_a_file_gives_the_surrogate_back_to_the_bit(
    make_structured: Make, driving_rows: Rows, tmp_path: Path, name: str, mode: Mode
) -> None:
    vehicle = TrackedVehicle.preset(name)
    surrogate = make_structured(mode, vehicle=vehicle)
    path = surrogate.save(tmp_path / "structured.safetensors")
    again = Surrogate.load(path)
    assert again.structured
    assert again.feature_map == "track"
    assert again.content_hash == surrogate.content_hash
    assert again.save(tmp_path / "again.safetensors").read_bytes() == path.read_bytes()
    x, _ = driving_rows(vehicle, mode, runs=2, samples=20)
    np.testing.assert_array_equal(again.reference_forces(x), surrogate.reference_forces(x))
    for kind in BACKENDS:
        found, expected = (kind(vehicle, mode, each).forces(x) for each in (path, surrogate))
        np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("name", ["native", "torch"])
def test_backends_are_made_by_name_from_a_path(
    make_structured: Make, tmp_path: Path, rows: FloatArray, name: str
) -> None:
    surrogate = make_structured()
    path = surrogate.save(tmp_path / "a.safetensors")
    backend = make_backend(name, mode="rigid", vehicle="m113", artifact=str(path))
    assert backend.has_track_forces
    assert backend.describe()["artifact"] == surrogate.content_hash
    np.testing.assert_allclose(backend.forces(rows), surrogate.reference_forces(rows), rtol=1e-4, atol=1.0)


def test_the_guard_takes_it(make_structured: Make, rows: FloatArray) -> None:
    surrogate = make_structured()
    guarded = make_backend("guarded", mode="rigid", vehicle="m113", artifact=surrogate)
    inside = ~guarded.out_of_distribution(rows)  # type: ignore[attr-defined]
    assert inside.any()
    native = NativeSurrogate(M113, "rigid", surrogate)
    np.testing.assert_array_equal(guarded.forces(rows)[inside], native.forces(rows)[inside])


# --- driven by the simulator


def silent(surrogate: Surrogate) -> Surrogate:
    """The surrogate without what its network adds."""
    size = surrogate.output_normalizer.size
    network = surrogate.network
    still = DenseNetwork(
        network.activation,
        (*network.weights[:-1], np.zeros_like(network.weights[-1])),
        (*network.biases[:-1], np.zeros_like(network.biases[-1])),
    )
    return replace(surrogate, network=still, output_normalizer=Normalizer(np.zeros(size), np.ones(size)))


def driven(backend: ForceBackend, ground: Any, sampling: Any, ticks: int = 60) -> tuple[Simulator, list[Any]]:
    simulator = Simulator(M113, backend, ground, ground_sampling=sampling, state=VehicleState.rolling(3.0))
    return simulator, [simulator.step(BeltCommand(3.0, 3.0 + 0.03 * i)) for i in range(ticks)]


SPLIT = {
    "rigid": paint_field(
        named("asphalt"),
        (-5, 20, -10, 10),
        spacing=0.5,
        patches=[Patch(named("ice"), Rectangle(y_max=0.0))],
        outside="extend",
    ),
    "soil": paint_field(
        named("lete-sand"),
        (-5, 20, -10, 10),
        spacing=0.5,
        patches=[Patch(named("north-gower-clayey-loam"), Rectangle(y_max=0.0))],
        outside="extend",
    ),
}


@every_kind
@every_mode
def test_it_drives_with_different_ground_under_each_track(make_structured: Make, mode: Mode, kind: Any) -> None:
    backend = kind(M113, mode, make_structured(mode))
    simulator, records = driven(backend, SPLIT[mode], "tracks", ticks=4)
    assert simulator.ground_sampling == "tracks"
    assert any(record.footing.split for record in records)
    for record in records:
        row, right = record.row, record.row.copy()
        right[7:] = record.footing.right_theta
        np.testing.assert_allclose(record.forces, assemble(backend.track_forces(row, right))[0], rtol=1e-6, atol=0.5)
    assert not np.array_equal(records[0].row[7:], records[0].footing.right_theta)


def test_a_plain_surrogate_cannot(make_surrogate: Make) -> None:
    with pytest.raises(ConfigurationError, match="ground_sampling"):
        Simulator(M113, NativeSurrogate(M113, "rigid", make_surrogate()), SPLIT["rigid"], ground_sampling="tracks")


@every_mode
def test_on_a_slope_it_is_the_model_under_the_gravity_there(
    make_structured: Make, driving_rows: Rows, monkeypatch: pytest.MonkeyPatch, mode: Mode
) -> None:
    surrogate = make_structured(mode)
    backend = NativeSurrogate(M113, mode, surrogate)
    ratio = 0.8
    monkeypatch.setattr("grouser.terrain.compiled.GRAVITY", ratio * GRAVITY)
    light = NativeSurrogate(M113, mode, surrogate)
    x, _ = driving_rows(M113, mode, runs=3, samples=40, seed=11)
    x[60:, 3:5] *= 5.0
    found = ratio * backend.forces(level_equivalent(backend.interface, x, ratio))
    expected = light.forces(x)
    assert np.all(np.abs(found - expected) <= 1e-5 * expected.std(axis=0))


@every_mode
def test_it_drives_on_a_slope(make_structured: Make, mode: Mode) -> None:
    ground = SlopedGround(named("asphalt" if mode == "rigid" else "lete-sand"), grade=0.15, bank=0.05)
    backend = NativeSurrogate(M113, mode, make_structured(mode))
    _, records = driven(backend, ground, "tracks", ticks=40)
    before = VehicleState.rolling(3.0)
    for record in records:
        after, gravity = record.state, record.footing.gravity
        ratio = gravity.load_ratio
        assert 0.95 < ratio < 0.999
        expected = ratio * backend.forces(level_equivalent(backend.interface, record.row, ratio))
        np.testing.assert_allclose(record.forces, expected, rtol=1e-6, atol=0.5)
        if record.divisions == 1:
            pull = M113.mass * ((after.vx - before.vx) / 0.01 - after.yaw_rate * after.vy) - record.forces[0]
            # The solver stops at some ten thousandths of m/s², for the sake of float32.
            assert pull == pytest.approx(M113.mass * gravity.x, abs=1e-3 * M113.weight)
        before = after


@every_mode
def test_without_its_network_it_brakes_like_the_physics(make_structured: Make, mode: Mode) -> None:
    ground = named("asphalt" if mode == "rigid" else "lete-sand")
    ends = []
    for backend in (PhysicsBackend(M113, mode), NativeSurrogate(M113, mode, silent(make_structured(mode)))):
        simulator = Simulator(M113, backend, ground, state=VehicleState.rolling(3.0))
        for _ in range(400):
            record = simulator.step(BeltCommand(0.0, 0.0))
        ends.append(record.state)
    physics, found = ends
    assert abs(found.vx) < 1e-5
    assert found.x == pytest.approx(physics.x, rel=0.01)
    assert max(abs(found.y), abs(found.heading)) == 0.0  # to the bit, by the mirror
