"""Fail unless a wheel and a source distribution hold what they need, and nothing else."""

import re
import sys
import tarfile
import zipfile
from collections.abc import Sequence
from pathlib import Path

WHEEL_REQUIRED = (
    r"grouser/__init__\.py",
    r"grouser/py\.typed",
    r"grouser/native/_core\.abi3\.so",
    r"grouser/native/_core\.pyi",
    r"grouser/native/include/grouser/physics\.h",
    r"grouser/native/src/physics\.c",
    r"grouser/surrogate/export/templates/api\.c",
    r"grouser/terrain/data/vehicles\.toml",
    r"grouser/terrain/data/terrains\.toml",
    r"grouser/surrogate/artifacts/m113-rigid\.safetensors",
    r"grouser/surrogate/artifacts/m113-soil\.safetensors",
    r"grouser/controllers/rl/policies/m113-parking\.safetensors",
    r"grouser/controllers/rl/policies/m113-path-tracking\.safetensors",
    r"grouser/cli/__init__\.py",
)
WHEEL_ALLOWED = (
    r"grouser/(.*\.(py|pyi|typed|toml|yml|safetensors|h|so|pyd))|grouser/native/src/(?!module)\w+\.[ch]"
    r"|grouser/surrogate/export/templates/\w+\.(c|h|cpp|txt|md)|grouser-[^/]+\.dist-info/.*"
)
SOURCE_REQUIRED = (
    r"pyproject\.toml",
    r"README\.md",
    r"LICENSE",
    r"native/CMakeLists\.txt",
    r"native/src/physics\.c",
    r"native/include/grouser/physics\.h",
    r"terrain/block\.py",
    r"surrogate/artifacts/m113-rigid\.safetensors",
    r"controllers/rl/policies/m113-path-tracking\.safetensors",
)
SOURCE_ALLOWED = (
    r"(envs|terrain|surrogate|controllers|native|cli|tests|docs|examples)/.*\.(py|pyi|toml|yml|safetensors|c|cpp|h|txt|md|json)"
    r"|(pyproject\.toml|constraints\.txt|Makefile|LICENSE|PKG-INFO|(README|CHANGELOG|CONTRIBUTING)\.md)"
)
MAXIMUM_BYTES = 2_000_000


def check(path: str, names: Sequence[str], required: Sequence[str], allowed: str) -> None:
    size = Path(path).stat().st_size
    missing = [pattern for pattern in required if not any(re.fullmatch(pattern, name) for name in names)]
    strange = [name for name in names if not re.fullmatch(allowed, name)]
    if missing or strange or size > MAXIMUM_BYTES:
        sys.exit(f"{path}: missing {missing}, unexpected {strange}, {size} bytes (at most {MAXIMUM_BYTES})")
    print(f"{path}: {len(names)} files, {size} bytes")


def main(paths: Sequence[str]) -> None:
    for path in paths:
        if path.endswith(".whl"):
            with zipfile.ZipFile(path) as wheel:
                check(path, wheel.namelist(), WHEEL_REQUIRED, WHEEL_ALLOWED)
        else:
            with tarfile.open(path) as source:
                names = [entry.name.split("/", 1)[1] for entry in source.getmembers() if entry.isfile()]
                check(path, names, SOURCE_REQUIRED, SOURCE_ALLOWED)


if __name__ == "__main__":
    main(sys.argv[1:])
