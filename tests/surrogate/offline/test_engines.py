"""Who runs the jobs decides nothing but the time."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from grouser.surrogate.offline.dataset import Dataset
from grouser.surrogate.offline.engines import in_parallel
from grouser.surrogate.offline.generate import DataConfig, generate_dataset
from grouser.terrain import ConfigurationError

Config = Callable[..., DataConfig]


@pytest.mark.parametrize("workers", [1, 2])
def test_every_job_is_done_once(workers: int) -> None:
    assert sorted(in_parallel(pow, [(i, 2) for i in range(7)], workers)) == [i**2 for i in range(7)]


def test_no_jobs_need_no_workers() -> None:
    assert list(in_parallel(pow, [], 2)) == []


def test_an_unknown_engine_is_refused_with_the_nearest(data_config: Config, tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="'ray'"):
        generate_dataset(data_config(), tmp_path / "data", engine="rai")  # type: ignore[arg-type]
    assert not (tmp_path / "data").exists()


def test_without_ray_the_error_names_the_extra(
    data_config: Config, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(ConfigurationError, match=r"'ray': pip install 'grouser\[ray\]'"):
        generate_dataset(data_config(), tmp_path / "data", engine="ray")
    assert not (tmp_path / "data").exists()


# In a process of its own: Ray warns in threads and leaves sockets to the interpreter's end.
SCRIPT = """
import sys
from pathlib import Path

import ray

from grouser.surrogate.offline.generate import DataConfig, generate_dataset

seen = []
config = DataConfig(runs=18, samples_per_run=40, transient=0.5, seed=3)
for workers in (1, 2):
    folder = Path(sys.argv[1]) / str(workers)
    generate_dataset(config, folder, workers=workers, engine="ray", progress=lambda done, runs: seen.append(done))
    assert not ray.is_initialized()
assert seen == [*range(19), *range(19)], seen
"""


@pytest.mark.slow
def test_a_local_ray_writes_the_same_bits(rigid: Dataset, folders: dict[str, Path], tmp_path: Path) -> None:
    pytest.importorskip("ray")
    environment = {key: value for key, value in os.environ.items() if key != "RAY_ADDRESS"}
    subprocess.run([sys.executable, "-P", "-c", SCRIPT, str(tmp_path)], check=True, env=environment, timeout=300)
    for workers in ("1", "2"):
        for name in ("dataset.json", "runs.parquet", "samples.parquet"):
            assert (tmp_path / workers / name).read_bytes() == (folders["rigid"] / name).read_bytes(), name
