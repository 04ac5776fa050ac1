"""Page, pictures and verdicts, from figures that nobody measured."""

import json
from pathlib import Path

import pytest
from bench_document import bench_document

from grouser.controllers.bench import TARGETS, page, sections_of, write_bench, write_bench_docs
from grouser.controllers.bench.targets import judged


def test_targets_are_met_missed_or_not_measured() -> None:
    found = {target["name"]: target for target in bench_document()["targets"]}
    assert len(found) == len(TARGETS)
    fast = found["64x64: plain C, -O3 -march=native -ffast-math / grouser"]
    assert (fast["reached"], fast["met"], fast["ceiling"]) == (5.0, True, 10.0)
    assert found["128x128: plain C, -O3 -march=native -ffast-math / grouser"]["met"] is False
    gate = found["structured + detector / plain 64x64"]
    assert (gate["reached"], gate["sense"], gate["met"]) == (2.5, "at most", True)
    ratio = found["environment steps/s, N = 1024, one thread: structured / physics 16x4 float64"]
    assert (ratio["reached"], ratio["met"]) == (2.0, False)
    eager = found["64x64: torch, eager / grouser, bound step()"]
    assert (eager["reached"], eager["met"]) == (None, None)


def test_no_figures_at_all_miss_nothing() -> None:
    assert {target["met"] for target in judged({})} == {None}


def test_the_page_leads_with_targets_our_own_physics_and_the_best_library() -> None:
    text = page(bench_document())
    headings = [line[3:] for line in text.splitlines() if line.startswith("## ")]
    assert headings[:3] == ["What it was to reach", "Against our own SIMD physics", "Against the best library"]
    assert headings[-2:] == ["The paper's figures beside ours", "Not measured here"]
    assert "| 64x64 | 100 | ONNX Runtime, bound | 3,000 | 30 | NumPy | 40 |" in text
    assert "| 64x64 | 80 | 1,760 | 22 |" in text
    assert "| structured + detector | 200 | 10 | 5.00 | 1.50 |" in text
    assert "| 64x64 | 3.64 | 6.46 | 3.51 | 7.10 | 0.08 | 25 |" in text
    assert "**missed**" in text
    assert "- torch: torch is not installed" in text


def test_times_stand_beside_the_error_that_they_buy() -> None:
    text = page(bench_document())
    assert "| physics 2x1 | 3 | 300 | – | – | – |" in text
    assert "| physics 16x4 | 0.2 | 2,000 | 1,800 | 1,000 | 900 |" in text
    assert "| structured | 1 |  |  | 160 | 120 |" in text
    said = next(line for line in text.splitlines() if line.startswith("The coarsest grid that is as accurate"))
    assert (
        "surrogate, 16x4, takes 12 times as long as the surrogate for a single sample and 15 times in a batch" in said
    )


def test_every_row_of_a_table_has_the_cells_of_its_heading() -> None:
    block: set[int] = set()
    for line in [*page(bench_document()).splitlines(), ""]:
        if line.startswith("|"):
            block.add(line.count("|"))
        else:
            assert len(block) <= 1, line
            block = set()


def test_the_folder_gets_data_page_and_pictures(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    document = bench_document()
    files = write_bench(tmp_path, document)
    names = {"bench.json", "bench.md", "bench-latency.png", "bench-environments.png"}
    assert {file.name for file in files} == names == {file.name for file in tmp_path.iterdir()}
    read = json.loads((tmp_path / "bench.json").read_text(encoding="utf-8"))
    assert page(read) == page(document)
    assert read == document
    assert sections_of(document)["python"].get("64x64", "NumPy") == 4000.0


def test_the_documentation_gets_them_where_it_keeps_them(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    write_bench_docs(tmp_path, bench_document())
    text = (tmp_path / "bench.md").read_text(encoding="utf-8")
    for name in ("results/bench.json", "figures/bench-latency.png", "figures/bench-environments.png"):
        assert (tmp_path / name).exists()
        assert f"({name})" in text


def test_without_matplotlib_there_are_no_pictures_and_the_page_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(__import__("sys").modules, "matplotlib.figure", None)
    files = write_bench(tmp_path, bench_document())
    assert {file.name for file in files} == {"bench.json", "bench.md"}
    text = (tmp_path / "bench.md").read_text(encoding="utf-8")
    assert "![" not in text
    assert "- pictures: " in text
