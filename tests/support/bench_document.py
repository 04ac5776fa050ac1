"""Figures of a bench that nobody measured."""

from typing import Any

from grouser.controllers.bench import Section
from grouser.controllers.bench.targets import judged

NETWORKS = ("64x64", "96x96", "128x128", "128x4", "256-128-64", "256x4")


def bench_document() -> dict[str, Any]:
    """Return what a measurement without torch would return: 64x64 at its targets, the others missing theirs."""
    sections = {name: Section("ns", f"About {name}.", spread=0.02) for name in ("networks_c", "physics_c", "python")}
    for index, name in enumerate(NETWORKS):
        sections["networks_c"].add(name, "grouser", 80.0 * (index + 1))
        sections["networks_c"].add(name, "plain C, -O2", 1600.0)
        sections["networks_c"].add(name, "plain C, -O3 -march=native -ffast-math", 400.0)
    sections["networks_c"].add("structured + detector", "grouser", 200.0)
    sections["networks_c"].add("64x64", "ONNX Runtime, C API", 1760.0)
    for grid, time in (("2x1", 300.0), ("16x4", 2000.0)):
        sections["physics_c"].add(grid, "float64", time)
    sections["physics_c"].add("16x4", "float32", 1000.0)
    sections["physics_c"].add("4x2", "float32", 300.0)
    for name, time in (("grouser, bound step()", 100.0), ("ONNX Runtime, bound", 3000.0), ("NumPy", 4000.0)):
        sections["python"].add("64x64", name, time)
    sections["bounds"] = Section("ns", "Bounds.")
    sections["bounds"].add("64x64", "bound", 40.0)
    sections["accuracy"] = Section("%", "Errors.")
    for case, error in (("2x1", 3.0), ("16x4", 0.2), ("structured", 1.0)):
        sections["accuracy"].add(case, "worst", error)
    sections["networks_c"].add("structured", "grouser", 160.0)
    sections["batch"] = Section("ns a row", "Batches.")
    for case, time in (("physics 16x4, float64", 1800.0), ("physics 16x4, float32", 900.0), ("structured", 120.0)):
        sections["batch"].add(case, "grouser", time)
    sections["environments"] = Section("steps/s", "Steps.")
    sections["environments"].add("native, structured", "N = 1024, 1 thread", 160_000.0)
    sections["environments"].add("physics 16x4, float64", "N = 1024, 1 thread", 80_000.0)
    return {
        "meta": {
            "command": "grouser bench",
            "grouser": "0.0",
            "machine": "a machine",
            "kernels": "portable",
            "compiler of the rivals": "a compiler 1.0",
            "threads": "one",
            "packages": {"numpy": "2.0", "torch": "missing"},
            "networks": {"64x64": [10, 64, 64, 3]},
        },
        "absent": {"torch": "torch is not installed"},
        "times": {name: section.to_dict() for name, section in sections.items()},
        "targets": judged(sections),
    }
