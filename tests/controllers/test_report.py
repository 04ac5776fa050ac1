"""The plots and the page of a comparison: whole, self-contained, repeatable, and safe to open."""

from __future__ import annotations

import base64
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from html.parser import HTMLParser
from io import BytesIO
from pathlib import Path as FilePath
from typing import Any

import numpy as np
import pytest
from grounds import stepped
from PIL import Image

from grouser.controllers import Drive, PurePursuit, Scenario, compare, document
from grouser.controllers.report import overlay_plot, report_page, write_report
from grouser.envs import Corridor, Driver, Lane, Path
from grouser.terrain import (
    ConfigurationError,
    Detection,
    FloatArray,
    GrouserError,
    GuardedBackend,
    Mode,
    PhysicsBackend,
    RigidTerrain,
    TrackedVehicle,
    named,
    register_backend,
)

M113 = TrackedVehicle.preset("m113")
LANE = Path.from_points("lane", [[0.0, 0.0], [2.0, 0.0], [4.0, 0.0]], corridor=Corridor((Lane(1.0, 3.0, -2.0, 2.0),)))
OPEN = Path.from_points("open", [[0.0, 0.0], [2.0, 0.0], [4.0, 0.0]])
METRICS: Mapping[str, Any] = {"m113 rigid": {"qx": {"r2": 0.91234}, "qy": {"r2": None}, "mz": {"r2": 0.5}}}


class SlipperyIsStrange:
    """A detector that knows no slippery ground."""

    def score(self, x: FloatArray) -> FloatArray:
        return np.where(np.asarray(x)[:, 7] < 0.5, 3.0, 0.1)

    def detect(self, row: FloatArray) -> Detection:
        score = float(self.score(row[None])[0])
        return Detection(score, "distance" if score > 1 else "none", "mu")


def _guard(vehicle: TrackedVehicle, mode: Mode) -> GuardedBackend:
    return GuardedBackend(
        PhysicsBackend(vehicle, mode, cells=(2, 1)), PhysicsBackend(vehicle, mode), SlipperyIsStrange()
    )


register_backend("test-report-guard", _guard)


def scenario(name: str = "yard", path: Path = LANE, controllers: Sequence[str] = ("pursuit",)) -> Scenario:
    ground = stepped(named("asphalt"), RigidTerrain(0.3), 2.0)
    drivers: dict[str, Callable[[], Driver]] = {key: lambda: PurePursuit(path, M113, 5.0) for key in controllers}
    return Scenario(name, "asphalt, then worse", ground, path, M113, 5.0, drivers, time_limit=3.0)


def drives_of(*scenarios: Scenario, seeds: Sequence[int] = (0,)) -> list[Drive]:
    return compare(scenarios, ["physics", "test-report-guard"], seeds=seeds)


class Page(HTMLParser):
    """Every tag with its attributes, and the rows of the tables."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.rows: list[list[str]] = []
        self.text = ""
        self._in_cell = False
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag == "tr":
            self.rows.append([])
        if tag in ("td", "th"):
            self._in_cell = True
            self.rows[-1].append("")

    def handle_endtag(self, tag: str) -> None:
        self._in_cell = self._in_cell and tag not in ("td", "th")

    def handle_data(self, data: str) -> None:
        self.text += data
        if self._in_cell:
            self.rows[-1][-1] += data

    @property
    def images(self) -> list[bytes]:
        prefix = "data:image/png;base64,"
        sources = [str(attributes["src"]) for tag, attributes in self.tags if tag == "img"]
        assert all(source.startswith(prefix) for source in sources)
        return [base64.b64decode(source[len(prefix) :], validate=True) for source in sources]


def image(png: bytes) -> Image.Image:
    opened = Image.open(BytesIO(png))
    opened.load()
    assert opened.format == "PNG"
    return opened


@pytest.fixture(scope="module")
def drives() -> list[Drive]:
    return drives_of(scenario())


@pytest.fixture(scope="module")
def plot(drives: list[Drive]) -> bytes:
    return overlay_plot(scenario(), "pursuit", drives)


def test_a_plot_is_an_image_with_something_on_it(plot: bytes) -> None:
    pixels = np.asarray(image(plot).convert("L"))
    assert min(pixels.shape) > 400
    assert 0.005 < np.mean(pixels < 200) < 0.5


def test_equal_drives_give_equal_plots(plot: bytes) -> None:
    assert overlay_plot(scenario(), "pursuit", drives_of(scenario())) == plot


def test_other_drives_give_another_plot(plot: bytes) -> None:
    assert overlay_plot(scenario(), "pursuit", drives_of(scenario(), seeds=(1,))) != plot


def test_a_missing_matplotlib_is_named_with_its_extra(drives: list[Drive], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    with pytest.raises(ConfigurationError, match=r"grouser\[plot\]"):
        overlay_plot(scenario(), "pursuit", drives)


def page_of(drives: Sequence[Drive], plots: Mapping[str, bytes] | None = None, **meta: Any) -> Page:
    return Page(report_page(document(drives, meta), plots or {}, METRICS))


def test_a_page_loads_nothing_from_elsewhere(drives: list[Drive], plot: bytes) -> None:
    text = report_page(document(drives, {"summary": "A short drive."}), {"yard, pursuit": plot}, METRICS)
    page = Page(text)
    assert text.lower().startswith("<!doctype html>")
    assert not {"script", "link", "iframe", "object", "embed", "base"} & {tag for tag, _ in page.tags}
    for _, attributes in page.tags:
        for name in ("src", "href", "srcset", "data", "action", "background"):
            assert str(attributes.get(name) or "data:").startswith("data:")
    assert "http:" not in text
    assert "https:" not in text
    assert "@import" not in text
    assert "url(" not in text
    assert page.images == [plot]


def test_every_row_is_on_the_page(drives: list[Drive]) -> None:
    many = [*drives, *(replace(drive, row=replace(drive.row, scenario="other")) for drive in drives)]
    page = page_of(many, summary="A short drive.")
    head = page.rows[0]
    rows = [dict(zip(head, cells, strict=True)) for cells in page.rows[1 : 1 + len(many)]]
    for drive, cells in zip(many, rows, strict=True):
        row = drive.row
        assert (cells["scenario"], cells["controller"], cells["backend"]) == (row.scenario, row.controller, row.backend)
        assert cells["finished"] == ("yes" if row.finished else "no")
        shown = [float(cells[key]) for key in head if key.startswith(("cross-track", "end from", "fallback"))]
        expected = [row.cross_track_rmse_m, row.final_position_difference_m, row.fallback_rate]
        assert shown == pytest.approx(expected, rel=1e-3)
    assert "A short drive." in page.text


def test_the_metrics_of_the_surrogates_are_on_the_page(drives: list[Drive]) -> None:
    row = next(cells for cells in page_of(drives).rows if cells[0] == "m113 rigid")
    assert float(row[1]) == pytest.approx(0.91234, abs=1e-4)
    assert row[2] == "–"
    assert float(row[3]) == 0.5


def test_what_is_unknown_is_a_dash() -> None:
    drives = drives_of(scenario(path=OPEN))
    unknown = [replace(drive, row=replace(drive.row, force_r2=[None, 0.25, None])) for drive in drives]
    page = page_of(unknown)
    for cells in page.rows[1:3]:
        shown = dict(zip(page.rows[0], cells, strict=True))
        assert next(value for key, value in shown.items() if "lane" in key) == "–"
        assert next(value for key, value in shown.items() if "R²" in key) == "–, 0.2500, –"
    assert "None" not in page.text
    assert "nan" not in page.text.lower()


@pytest.mark.parametrize("hostile", ["<script>alert(1)</script>", '"><img src=x onerror=alert(1)>', "a & b", "{0} {x}"])
def test_text_is_shown_and_not_obeyed(drives: list[Drive], plot: bytes, hostile: str) -> None:
    odd = [
        replace(drive, row=replace(drive.row, scenario=hostile, terrain=hostile, controller=hostile, backend=hostile))
        for drive in drives
    ]
    metrics = {hostile: METRICS["m113 rigid"]}
    text = report_page(document(odd, {"summary": hostile, "grouser": hostile}), {hostile: plot}, metrics)
    page, usual = Page(text), page_of(drives, {"yard, pursuit": plot})
    assert [tag for tag, _ in page.tags] == [tag for tag, _ in usual.tags]
    assert page.rows[1][:3] == [hostile] * 3
    assert page.text.count(hostile) >= 6
    (picture,) = (attributes for tag, attributes in page.tags if tag == "img")
    assert picture["alt"] == hostile
    assert set(picture) == {"alt", "src"}


def test_a_report_is_a_plot_for_each_scenario_and_controller_and_a_page(tmp_path: FilePath) -> None:
    scenarios = [scenario("yard", controllers=("a", "b")), scenario("field", OPEN)]
    drives = drives_of(*scenarios, seeds=(4, 2))
    compared = document(drives, {"summary": "Two places."})
    folder = tmp_path / "new" / "report"
    files = write_report(folder, compared, drives, scenarios, METRICS)
    assert sorted(folder.iterdir()) == sorted(files)
    assert [file.suffix for file in files] == [".png", ".png", ".png", ".html"]
    page = Page((folder / "report.html").read_text(encoding="utf-8"))
    assert page.images == [file.read_bytes() for file in files[:-1]]
    assert len(set(page.images)) == 3
    for png in page.images:
        image(png)
    captions = [str(attributes["alt"]) for tag, attributes in page.tags if tag == "img"]
    for caption, words in zip(captions, [("yard", "a"), ("yard", "b"), ("field", "pursuit")], strict=True):
        assert all(word in caption for word in words)
    # Head and rows of the drives, head and row of the surrogates.
    assert len(page.rows) == 1 + len(drives) + 2
    # Again, over the old one: equal bytes, but for the times that the page was told of.
    before = [file.read_bytes() for file in files]
    assert write_report(folder, compared, drives, scenarios, METRICS) == files
    assert [file.read_bytes() for file in files] == before


def test_a_name_with_a_slash_stays_inside_the_folder_or_is_refused(tmp_path: FilePath, drives: list[Drive]) -> None:
    name = "asphalt/ice"
    odd = [replace(drive, row=replace(drive.row, scenario=name)) for drive in drives]
    try:
        files = write_report(tmp_path / "report", document(odd, {}), odd, [scenario(name)], METRICS)
    except GrouserError:
        return
    assert all(file.resolve().is_relative_to(tmp_path / "report") for file in files)


def test_a_failing_disk_leaves_no_half_a_file_under_its_name(
    tmp_path: FilePath, drives: list[Drive], monkeypatch: pytest.MonkeyPatch
) -> None:
    compared = document(drives, {})
    files = write_report(tmp_path, compared, drives, [scenario()], METRICS)
    before = [file.read_bytes() for file in files]

    def full_bytes(self: FilePath, data: bytes) -> int:
        with self.open("wb") as stream:
            stream.write(data[: len(data) // 2])
        raise OSError(28, "No space left on device")

    def full_text(self: FilePath, data: str, *args: Any, **kwargs: Any) -> int:
        return full_bytes(self, data.encode())

    monkeypatch.setattr(FilePath, "write_bytes", full_bytes)
    monkeypatch.setattr(FilePath, "write_text", full_text)
    with pytest.raises(OSError, match="space"):
        write_report(tmp_path, compared, drives, [scenario()], METRICS)
    assert [file.read_bytes() for file in files] == before
