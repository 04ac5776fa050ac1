"""Which room may import which, and what a bare import must not load; read from the sources and in fresh processes."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
# From the top down.
ROOMS = ("cli", "controllers", "surrogate", "envs", "terrain", "native")
SOURCES = sorted(file for room in ROOMS for file in (ROOT / room).rglob("*.py"))
# Optional packages, each loaded where it is first needed.
EXTRAS = (
    "torch", "pyarrow", "joblib", "casadi", "stable_baselines3", "sb3_contrib", "pygame", "matplotlib", "jinja2",
    "pandas", "scipy", "highway_env", "minari", "optuna", "yaml", "imageio",
)  # fmt: skip


def module_of(file: Path) -> tuple[str, ...]:
    """``envs/path.py`` → ("grouser", "envs", "path"), ``envs/__init__.py`` → ("grouser", "envs", "__init__")."""
    return ("grouser", *file.relative_to(ROOT).with_suffix("").parts)


def imports(file: Path) -> Iterator[tuple[int, str, bool]]:
    """Line, absolute module and whether it is written relatively, of every import, wherever it stands in the file."""
    package = module_of(file)[:-1]
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield node.lineno, alias.name, False
        elif isinstance(node, ast.ImportFrom):
            if node.level == 0:
                yield node.lineno, str(node.module), False
                continue
            assert node.level <= len(package), f"{file}:{node.lineno} leaves the package"
            base = package[: len(package) - node.level + 1]
            if node.module:
                yield node.lineno, ".".join([*base, node.module]), True
            else:
                for alias in node.names:
                    yield node.lineno, ".".join([*base, alias.name]), True


def room_of(module: str) -> str | None:
    """The room of grouser that an absolute module lies in."""
    first, *rest = module.split(".")
    return rest[0] if first == "grouser" and rest and rest[0] in ROOMS else None


def named(file: Path) -> str:
    return str(file.relative_to(ROOT))


def test_every_room_is_read() -> None:
    assert {file.relative_to(ROOT).parts[0] for file in SOURCES} == set(ROOMS)
    assert len(SOURCES) > 50
    # The reading itself: what is known to stand in two files.
    seen = {module for _, module, _ in imports(ROOT / "controllers" / "rl" / "driver.py")}
    assert {"grouser.envs.observation", "grouser.controllers.rl.policy", "grouser.terrain", "numpy"} <= seen
    assert "grouser.envs.log" in {module for _, module, _ in imports(ROOT / "envs" / "__init__.py")}


@pytest.mark.parametrize("file", SOURCES, ids=named)
def test_imports_run_one_way_down(file: Path) -> None:
    own = ROOMS.index(file.relative_to(ROOT).parts[0])
    for line, module, _ in imports(file):
        room = room_of(module)
        if room is not None:
            assert ROOMS.index(room) >= own, f"{named(file)}:{line} imports {module}, which lies above it"


@pytest.mark.parametrize("file", [f for f in SOURCES if f.is_relative_to(ROOT / "surrogate")], ids=named)
def test_of_the_surrogate_only_offline_imports_envs(file: Path) -> None:
    if file.is_relative_to(ROOT / "surrogate" / "offline"):
        return
    for line, module, _ in imports(file):
        assert room_of(module) != "envs", f"{named(file)}:{line} imports {module}"
        # And so not through offline either.
        assert not module.startswith("grouser.surrogate.offline"), f"{named(file)}:{line} imports {module}"


@pytest.mark.parametrize("file", SOURCES, ids=named)
def test_the_project_is_imported_relatively_and_never_by_its_folders(file: Path) -> None:
    for line, module, relative in imports(file):
        first = module.split(".")[0]
        assert first not in ROOMS, f"{named(file)}:{line} imports the folder {module}"
        if file.relative_to(ROOT).parts[0] != "cli":
            assert relative or first != "grouser", f"{named(file)}:{line} imports {module} absolutely"


@pytest.mark.parametrize("room", ["native", "terrain", "envs", "surrogate"])
def test_extras_are_imported_inside_functions(room: str) -> None:
    for file in (ROOT / room).rglob("*.py"):
        if file.is_relative_to(ROOT / "surrogate" / "offline"):
            continue
        tree = ast.parse(file.read_text(encoding="utf-8"))
        for node in tree.body:
            found = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            if isinstance(node, ast.ImportFrom) and not node.level:
                found = [str(node.module)]
            assert not {name.split(".")[0] for name in found} & set(EXTRAS), f"{named(file)}:{node.lineno}"


MODULES = ("grouser", *(f"grouser.{room}" for room in ("terrain", "envs", "surrogate", "controllers", "cli")))


@pytest.mark.parametrize("module", MODULES)
def test_importing_a_room_loads_no_extra_and_no_folder(module: str, tmp_path: Path) -> None:
    script = f"import sys, {module}; print(*sorted(sys.modules), sep='\\n')"
    done = subprocess.run(
        [sys.executable, "-P", "-c", script], capture_output=True, text=True, check=False, cwd=tmp_path
    )
    assert done.returncode == 0, done.stderr
    loaded = {name.split(".")[0] for name in done.stdout.split()}
    assert "grouser" in loaded
    assert not loaded & set(EXTRAS)
    assert not loaded & set(ROOMS)


@pytest.mark.parametrize(
    ("module", "above"),
    [("grouser.envs", {"surrogate", "controllers", "cli"}), ("grouser.surrogate", {"controllers", "cli"})],
)
def test_a_room_loads_none_above_it(module: str, above: set[str]) -> None:
    script = f"import sys, {module}; print(*sys.modules, sep='\\n')"
    done = subprocess.run([sys.executable, "-P", "-c", script], capture_output=True, text=True, check=True)
    assert not {room_of(name) for name in done.stdout.split()} & above


def test_the_backends_are_known_by_name_without_loading_them() -> None:
    script = (
        "import sys, grouser, gymnasium\n"
        "from grouser.terrain import backend_names\n"
        "assert {'physics', 'torch', 'native', 'guarded'} <= set(backend_names())\n"
        "assert 'grouser/PathTracking-v0' in gymnasium.registry\n"
        "assert 'grouser.surrogate' not in sys.modules and 'torch' not in sys.modules\n"
    )
    done = subprocess.run([sys.executable, "-P", "-c", script], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
