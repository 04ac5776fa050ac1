"""Fresh datasets and artifacts pass every check, and each check fails on what was tampered with in its way."""

import json
import math
import shutil
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow
import pytest
from pyarrow import parquet

from grouser.surrogate import (
    BoxMahalanobisDetector,
    NativeSurrogate,
    Normalizer,
    Surrogate,
    random_network,
    shipped_names,
)
from grouser.surrogate.container import pack, unpack
from grouser.surrogate.offline import artifact_verification, split_runs
from grouser.surrogate.offline.dataset import Dataset, read_dataset
from grouser.surrogate.offline.metrics_verification import compare_with_baseline
from grouser.surrogate.offline.split import RunSplit
from grouser.surrogate.offline.split_verification import verify_balance, verify_split
from grouser.surrogate.offline.training import TrainingResult
from grouser.surrogate.offline.verification import (
    Baseline,
    Finding,
    judgement_of,
    read_baseline,
    verify_artifact,
    verify_dataset,
    write_baseline,
)
from grouser.surrogate.track_model import FEATURES
from grouser.terrain import ArtifactError, FloatArray

SAMPLES = 40
Trained = tuple[TrainingResult, Path]
Edit = Callable[[Path], None]


def failed(findings: Sequence[Finding]) -> set[str]:
    return {finding.check for finding in findings if not finding.passed}


def detail(findings: Sequence[Finding], check: str) -> str:
    return next(finding.detail for finding in findings if finding.check == check and not finding.passed)


# --- findings


def test_a_finding_passes_up_to_its_limit_and_nan_does_not() -> None:
    def finding(measured: float, limit: float | None) -> Finding:
        return Finding("check", "subject", measured, limit, "1")

    assert finding(1.0, 1.0).passed
    assert not finding(1.1, 1.0).passed
    assert not finding(math.nan, 1.0).passed
    assert finding(math.nan, None).passed
    assert json.loads(json.dumps(finding(math.inf, 1.0).to_dict(), allow_nan=False))["measured"] is None


# --- datasets


def edit_manifest(**changes: Any) -> Edit:
    def edit(folder: Path) -> None:
        content = json.loads((folder / "dataset.json").read_text(encoding="utf-8"))
        (folder / "dataset.json").write_text(json.dumps(content | changes), encoding="utf-8")

    return edit


def edit_record(index: int, **changes: Any) -> Edit:
    def edit(folder: Path) -> None:
        rows = parquet.read_table(folder / "runs.parquet").to_pylist()
        for key, value in changes.items():
            nested = isinstance(value, dict)
            rows[index][key] = json.dumps(json.loads(rows[index][key]) | value, sort_keys=True) if nested else value
        parquet.write_table(pyarrow.Table.from_pylist(rows), folder / "runs.parquet")

    return edit


def edit_groups(change: Callable[[list[Any]], list[Any]]) -> Edit:
    def edit(folder: Path) -> None:
        with parquet.ParquetFile(folder / "samples.parquet") as source:
            groups = change([source.read_row_group(i) for i in range(source.num_row_groups)])
        with parquet.ParquetWriter(folder / "samples.parquet", groups[0].schema) as writer:
            for group in groups:
                writer.write_table(group, row_group_size=group.num_rows)

    return edit


def edit_column(column: str, change: Callable[[Any], Any], *, run: int | None = None, row: int | None = None) -> Edit:
    """Change a column: in one run or all, in one row or all."""

    def edited(group: Any) -> Any:
        values = np.array(group.column(column)).copy()
        chosen = slice(None) if row is None else row
        values[chosen] = change(values[chosen])
        return group.set_column(group.column_names.index(column), column, pyarrow.array(values))

    return edit_groups(
        lambda groups: [edited(group) if run in (None, index) else group for index, group in enumerate(groups)]
    )


def copied(source: int, target: int, rows: slice) -> Edit:
    """Copy rows of a run to another, all but the column that says which run they are of."""

    def change(groups: list[Any]) -> list[Any]:
        for name in groups[0].column_names[1:]:
            values = np.array(groups[target].column(name)).copy()
            values[rows] = np.array(groups[source].column(name))[rows]
            groups[target] = groups[target].set_column(
                groups[target].column_names.index(name), name, pyarrow.array(values)
            )
        return groups

    return edit_groups(change)


def reseal(folder: Path) -> None:
    """Write the hash of what is there now: whoever alters a dataset with care does."""
    edit_manifest(content_hash=read_dataset(folder)[1])(folder)


def two_sides(dataset: Dataset) -> tuple[int, int]:
    """Return a training run and a test run of one maneuver."""
    split, maneuver = split_runs(dataset.records), {record.run: record.maneuver for record in dataset.records}
    test = split.test[0]
    return next(run for run in split.train if maneuver[run] == maneuver[test]), test


@pytest.fixture
def copy(folders: dict[str, Path], tmp_path: Path) -> Path:
    return Path(shutil.copytree(folders["rigid"], tmp_path / "copy"))


@pytest.mark.parametrize("mode", ["rigid", "soil"])
def test_a_fresh_dataset_passes_every_check(folders: dict[str, Path], mode: str) -> None:
    findings = verify_dataset(folders[mode])
    assert not failed(findings)
    assert len(findings) == 25
    assert all(finding.limit is not None for finding in findings)


COLUMNS = "columns and types"
TEACHER = "forces are the teacher's"
MEMORY = "acceleration is the force before over the mass"
DRAWN = "terrain and excitation drawn from the seed"
CONSTANT = "terrain constant and as recorded"
RANGES = "terrain within the declared ranges"


@pytest.mark.parametrize(
    ("edit", "expected"),
    [
        pytest.param(
            edit_groups(lambda groups: [g.append_column("colour", g.column("vx")) for g in groups]), {COLUMNS}, id="+"
        ),
        pytest.param(edit_column("run", lambda run: run + 1, run=4), {COLUMNS}, id="run column"),
        pytest.param(edit_column("mz", lambda _: np.nan, run=2, row=7), {"finite values"}, id="NaN"),
        pytest.param(edit_column("vx", lambda _: np.inf, run=2, row=7), {"finite values"}, id="infinity"),
        pytest.param(edit_manifest(runs=17), {"runs of the manifest"}, id="runs"),
        pytest.param(edit_record(17, run=23), {COLUMNS, "runs numbered in order", DRAWN}, id="run number"),
        pytest.param(edit_groups(lambda groups: [*groups[:3], groups[3].slice(0, 39), *groups[4:]]), {"samples a run"}, id="samples"),
        pytest.param(edit_manifest(samples_per_run=41), {"samples a run"}, id="samples in the manifest"),
        pytest.param(
            edit_record(3, maneuver="turn"),
            {"maneuver of the run", "at least 3 runs a maneuver", "split by run"},
            id="maneuver",
        ),
        pytest.param(edit_record(3, excitation={"creep": 0.0}), {DRAWN}, id="excitation"),
        pytest.param(edit_manifest(seed=4), {DRAWN}, id="seed"),
        pytest.param(edit_manifest(ranges="paper"), {RANGES, DRAWN}, id="ranges"),
        pytest.param(edit_column("v_left", lambda v: v + 20, run=2, row=7), {"belt speed", TEACHER}, id="belt"),
        pytest.param(edit_column("mu", lambda _: 1.5, run=2), {RANGES, CONSTANT, TEACHER}, id="terrain of a run"),
        pytest.param(edit_column("fr", lambda _: 0.1, run=2, row=7), {CONSTANT, TEACHER}, id="terrain of a row"),
        pytest.param(
            edit_column("qy", lambda _: 3e5, run=2, row=7), {"force over what the ground can give", TEACHER, MEMORY}, id="force"
        ),
        pytest.param(
            edit_column("mz", lambda _: 3e6, run=2, row=7), {"moment over what the ground can give", TEACHER}, id="moment"
        ),
        pytest.param(edit_column("mz", lambda mz: mz + 1e-6, run=2, row=7), {TEACHER}, id="another teacher"),
        pytest.param(edit_manifest(backend={"backend": "phisics"}), {TEACHER}, id="unknown teacher"),
        pytest.param(edit_manifest(backend={}), {TEACHER}, id="no teacher"),
        pytest.param(edit_column("ay", lambda ay: ay + 1e-3, run=2, row=7), {TEACHER, MEMORY}, id="memory"),
        pytest.param(
            edit_column("mz", lambda _: 1e200, run=2, row=7),
            {"normalization round trip", "moment over what the ground can give", TEACHER},
            id="normalization",
        ),
    ],
)  # fmt: skip
def test_each_tampering_fails_its_own_checks(copy: Path, edit: Edit, expected: set[str]) -> None:
    edit(copy)
    reseal(copy)
    assert failed(verify_dataset(copy)) == expected


def test_what_was_altered_without_its_hash_is_seen(copy: Path) -> None:
    edit_column("mz", lambda mz: np.nextafter(mz, np.inf), run=2, row=7)(copy)
    findings = verify_dataset(copy)
    assert failed(findings) == {"content hash"}
    assert "the manifest says" in detail(findings, "content hash")


def test_a_run_that_comes_twice_and_leaks(copy: Path, rigid: Dataset) -> None:
    source, target = two_sides(rigid)
    copied(source, target, slice(None))(copy)
    record = rigid.records[source]
    edit_record(target, terrain=dict(record.terrain), excitation=dict(record.excitation))(copy)
    reseal(copy)
    findings = verify_dataset(copy)
    assert failed(findings) == {DRAWN, "identical runs", "row on two sides"}
    assert detail(findings, "identical runs") in (f"{source} is {target}", f"{target} is {source}")
    assert sum(f.measured for f in findings if f.check == "row on two sides") == SAMPLES


def test_a_row_that_leaks(copy: Path, rigid: Dataset) -> None:
    copied(*two_sides(rigid), slice(0, 1))(copy)
    reseal(copy)
    assert failed(verify_dataset(copy)) == {"row on two sides", CONSTANT, MEMORY}


@pytest.mark.parametrize("name", ["samples.parquet", "runs.parquet", "dataset.json"])
def test_what_cannot_be_read_is_one_finding(copy: Path, name: str) -> None:
    (copy / name).write_bytes((copy / name).read_bytes()[:-100])
    (finding,) = verify_dataset(copy)
    assert not finding.passed
    assert name in finding.detail


@pytest.mark.parametrize("vehicle", [{}, {"name": "m113", "mass": "heavy"}])
def test_a_manifest_without_a_vehicle_is_one_finding(copy: Path, vehicle: dict[str, Any]) -> None:
    edit_manifest(vehicle=vehicle)(copy)
    (finding,) = verify_dataset(copy)
    assert not finding.passed


def test_visited_runs_are_neither_drawn_nor_driven_by_the_teacher(copy: Path) -> None:
    for run in range(18):
        edit_record(run, maneuver="visited")(copy)
    edit_manifest(seed=4, samples_per_run=50)(copy)
    reseal(copy)
    findings = verify_dataset(copy)
    assert not failed(findings)


def test_a_maneuver_that_prevails_is_seen(rigid: Dataset) -> None:
    counts = {"straight": 11, "turn": 4, "pivot": 3}
    names = [name for name, count in counts.items() for _ in range(count)]
    records = tuple(replace(record, maneuver=name) for record, name in zip(rigid.records, names, strict=True))
    findings = verify_balance(Dataset(rigid.manifest, records, rigid.inputs, rigid.forces, rigid.run_index))
    assert failed(findings) == {"balance of maneuvers"}
    assert Counter(counts) == Counter(
        {part.split()[0]: int(part.split()[1]) for part in findings[1].detail.split(", ")}
    )


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (lambda s: s, set()),
        (lambda s: replace(s, test=(*s.test, s.train[0])), {"run on two sides", "row on two sides"}),
        (lambda s: replace(s, train=s.train[1:]), {"run on no side, or unknown", "maneuver missing from a side"}),
        (lambda s: replace(s, train=(*s.train, 99)), {"run on no side, or unknown"}),
        (lambda s: RunSplit(s.train, (), (*s.test, *s.validation)), {"maneuver missing from a side"}),
    ],
    ids=["as it is", "two sides", "no side", "unknown", "missing"],
)
def test_each_fault_of_a_split_is_seen(
    rigid: Dataset, change: Callable[[RunSplit], RunSplit], expected: set[str]
) -> None:
    assert failed(verify_split(rigid, change(split_runs(rigid.records)), "split")) == expected


# --- artifacts


@pytest.fixture(scope="module")
def structured(trained: Trained, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An untrained structured surrogate in the plain one's place."""
    surrogate = trained[0].surrogate
    outputs = 3 * surrogate.vehicle.road_wheels
    made = replace(
        surrogate,
        feature_map="track",
        network=random_network((FEATURES, 8, outputs), "silu", np.random.default_rng(0)),
        input_normalizer=Normalizer(np.zeros(FEATURES), np.ones(FEATURES)),
        output_normalizer=Normalizer(np.zeros(outputs), np.full(outputs, 0.1)),
    )
    return made.save(tmp_path_factory.mktemp("structured") / "track.safetensors")


def saved(surrogate: Surrogate, folder: Path) -> Path:
    return surrogate.save(folder / "made.safetensors")


def test_a_fresh_artifact_passes_every_check(trained: Trained, rigid: Dataset) -> None:
    findings = verify_artifact(trained[1], dataset=rigid)
    assert not failed(findings)
    assert {finding.check for finding in findings if finding.limit is None} == {"mirror symmetry", "force at rest"}


def test_a_structured_artifact_is_held_to_the_blocks_laws(structured: Path) -> None:
    findings = {finding.check: finding for finding in verify_artifact(structured)}
    assert not failed(list(findings.values()))
    for check in ("mirror symmetry", "force at rest"):
        assert findings[check].measured == findings[check].limit == 0.0


@pytest.mark.parametrize("name", shipped_names())
def test_shipped_artifacts_pass(name: str) -> None:
    assert not failed(verify_artifact(name))


def test_a_truncated_or_altered_artifact_is_one_finding(trained: Trained, tmp_path: Path) -> None:
    content = bytearray(trained[1].read_bytes())
    content[-20] ^= 1
    for name, data in (("cut", bytes(content[:-100])), ("altered", bytes(content))):
        path = tmp_path / f"{name}.safetensors"
        path.write_bytes(data)
        assert failed(verify_artifact(path)) == {"whole and sealed"}
    assert failed(verify_artifact(tmp_path / "none.safetensors")) == {"whole and sealed"}


@pytest.mark.parametrize(
    ("tensor", "value", "expected"),
    [
        ("network.1.weights", np.nan, {"finite weights and scales"}),
        ("detector.center", np.inf, {"finite weights and scales"}),
        ("output.scale", 0.0, {"positive scales"}),
        ("input.scale", -1.0, {"positive scales"}),
        ("network.0.weights", None, set()),
    ],
)
def test_a_sealed_artifact_with_impossible_numbers(
    trained: Trained, tmp_path: Path, tensor: str, value: float | None, expected: set[str]
) -> None:
    tensors, metadata = unpack(trained[1].read_bytes(), "made", 1)
    changed = tensors[tensor].copy()
    if value is None:
        changed = changed[1:]
    else:
        changed.flat[0] = value
    path = tmp_path / "sealed.safetensors"
    path.write_bytes(pack(tensors | {tensor: changed}, metadata))
    assert failed(verify_artifact(path)) == expected | {"sizes and parts fit together"}


class Shifted(NativeSurrogate):
    """The compiled network with a little yaw moment that it does not have."""

    def forces(self, x: FloatArray) -> FloatArray:
        forces: FloatArray = super().forces(x) + np.array([0.0, 0.0, 100.0])
        return forces


class Steeper(NativeSurrogate):
    """The compiled network with a Jacobian that is not its forces'."""

    def forces_and_jacobian(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        forces, jacobian = super().forces_and_jacobian(x)
        return forces, 1.05 * jacobian


@pytest.mark.parametrize(
    ("kind", "expected"),
    [
        (Shifted, {"forces against NumPy float64", "mirror symmetry", "force at rest"}),
        (Steeper, {"Jacobian against float64"}),
    ],
)
def test_a_backend_that_computes_something_else(
    structured: Path, monkeypatch: pytest.MonkeyPatch, kind: type[NativeSurrogate], expected: set[str]
) -> None:
    monkeypatch.setattr(artifact_verification, "NativeSurrogate", kind)
    findings = verify_artifact(structured)
    assert failed(findings) == expected
    assert {finding.subject for finding in findings if not finding.passed} == {"native"}


def test_a_network_that_c_cannot_hold_is_told_and_not_judged(trained: Trained, tmp_path: Path) -> None:
    surrogate = trained[0].surrogate
    wide = random_network((surrogate.interface.size, 513, 3), "silu", np.random.default_rng(0))
    findings = verify_artifact(saved(replace(surrogate, network=wide), tmp_path))
    assert not failed(findings)
    assert any("use 'torch'" in finding.detail for finding in findings)


class Blind(BoxMahalanobisDetector):
    """A detector that accepts everything."""

    def score(self, x: FloatArray) -> FloatArray:
        return np.zeros(len(np.atleast_2d(x)))


def test_a_detector_that_sees_nothing_or_trusts_nothing(trained: Trained) -> None:
    surrogate = trained[0].surrogate
    detector = surrogate.detector
    arrays = {name: getattr(detector, name) for name in ("mode", "low", "high", "center", "whitening", "threshold")}
    blind = artifact_verification.verify_behaviour(replace(surrogate, detector=Blind(**arrays)))
    assert failed(blind) == {"accepted outside the box, or not finite"}
    shy = replace(detector, threshold=detector.threshold / 1e6)
    assert "score in the middle of the box" in failed(
        artifact_verification.verify_behaviour(replace(surrogate, detector=shy))
    )


def test_a_box_that_the_block_cannot_be_asked_in(structured: Path, tmp_path: Path) -> None:
    surrogate = Surrogate.load(structured)
    low = surrogate.detector.low.copy()
    low[surrogate.interface.index("k")] = -1.0
    path = saved(replace(surrogate, detector=replace(surrogate.detector, low=low)), tmp_path)
    assert failed(verify_artifact(path)) == {"evaluated inside its box"}


# --- metrics and baselines


def test_metrics_that_are_not_its_own(trained: Trained, rigid: Dataset, tmp_path: Path) -> None:
    surrogate = trained[0].surrogate
    test = surrogate.metrics["test"]
    for name, key, factor in (("qx", "r2", 0.99), ("mz", "rmse", 1.001), ("qy", "bias", 2.0)):
        better = {**test, name: {**test[name], key: test[name][key] * factor}}
        path = saved(surrogate.with_metrics({**surrogate.metrics, "test": better}), tmp_path)
        findings = verify_artifact(path, dataset=rigid)
        assert {(f.check, f.subject) for f in findings if not f.passed} == {("stored test metrics", name)}


@pytest.mark.parametrize("metrics", [{}, {"test": {}}, {"test": None}])
def test_metrics_that_are_not_held(trained: Trained, rigid: Dataset, tmp_path: Path, metrics: dict[str, Any]) -> None:
    path = saved(trained[0].surrogate.with_metrics(metrics), tmp_path)
    assert failed(verify_artifact(path, dataset=rigid)) == {"stored test metrics"}
    with pytest.raises(ArtifactError, match="no test metrics"):
        judgement_of(Surrogate.load(path))


def test_a_split_that_leaks(trained: Trained, rigid: Dataset, tmp_path: Path) -> None:
    surrogate = trained[0].surrogate
    sides = surrogate.recipe["split"]
    leaking = {**surrogate.recipe, "split": {**sides, "train": [*sides["train"], sides["test"][0]]}}
    findings = verify_artifact(saved(replace(surrogate, recipe=leaking), tmp_path), dataset=rigid)
    assert failed(findings) == {"run on two sides", "row on two sides"}
    assert detail(findings, "run on two sides") == str(sides["test"][0])


def test_another_dataset_of_the_block_or_of_none(
    trained: Trained, rigid: Dataset, datasets: dict[str, Dataset]
) -> None:
    other = replace(rigid.manifest, content_hash="0" * 64)
    findings = verify_artifact(
        trained[1], dataset=Dataset(other, rigid.records, rigid.inputs, rigid.forces, rigid.run_index)
    )
    assert failed(findings) == {"dataset of the artifact"}
    with pytest.raises(ArtifactError, match="asked for m113 on soil"):
        verify_artifact(trained[1], dataset=datasets["soil"])


def test_a_baseline_comes_back_and_is_met(trained: Trained, rigid: Dataset, tmp_path: Path) -> None:
    judgement = judgement_of(trained[0].surrogate)
    again = read_baseline(write_baseline(tmp_path / "new" / "baseline.json", Baseline(judgement)))
    assert again == Baseline(judgement)
    recomputed = judgement_of(trained[0].surrogate, rigid)
    assert recomputed.runs == judgement.runs == trained[0].split.test
    assert not failed(compare_with_baseline(recomputed, again))
    assert not failed(verify_artifact(trained[1], baseline=again))


def test_what_got_worse_is_named_and_how_much_worse_is_stated(trained: Trained) -> None:
    now = judgement_of(trained[0].surrogate)

    def before(**changes: float) -> Baseline:
        metrics = {**now.metrics, "mz": {**now.metrics["mz"], **changes}}
        return Baseline(replace(now, metrics=metrics))

    r2, rmse = now.metrics["mz"]["r2"], now.metrics["mz"]["rmse"]
    assert r2 is not None
    assert rmse is not None
    fallen = compare_with_baseline(now, before(r2=r2 + 0.002))
    assert {(f.check, f.subject) for f in fallen if not f.passed} == {("fall of R² since the baseline", "mz")}
    risen = compare_with_baseline(now, before(rmse=rmse / 1.06))
    assert {(f.check, f.subject) for f in risen if not f.passed} == {("rise of the RMSE since the baseline", "mz")}
    assert not failed(compare_with_baseline(now, before(r2=r2 + 0.0009, rmse=rmse / 1.04)))
    assert not failed(compare_with_baseline(now, before(r2=r2 - 0.5, rmse=rmse * 2)))
    assert not failed(compare_with_baseline(now, replace(before(rmse=rmse / 1.06), rmse_rise=0.1)))
    lost = replace(now, metrics={**now.metrics, "mz": {"r2": None, "rmse": rmse}})
    assert failed(compare_with_baseline(lost, before())) == {"fall of R² since the baseline"}


def test_a_baseline_of_other_runs_is_not_compared(trained: Trained) -> None:
    now = judgement_of(trained[0].surrogate)
    for other in (replace(now, dataset="0" * 64), replace(now, runs=now.runs[1:])):
        (finding,) = compare_with_baseline(now, Baseline(other))
        assert not finding.passed


@pytest.mark.parametrize("content", ["", "[]", "{}", '{"format_version": 2}', '{"format_version": 1, "judgement": 3}'])
def test_a_file_that_is_no_baseline(tmp_path: Path, content: str) -> None:
    path = tmp_path / "baseline.json"
    path.write_text(content, encoding="utf-8")
    with pytest.raises(ArtifactError, match="is not a baseline"):
        read_baseline(path)
    with pytest.raises(ArtifactError, match="cannot read baseline"):
        read_baseline(tmp_path / "none.json")
