"""Fail unless a wheel holds what grouser needs to run, and nothing else."""

import re
import sys
import zipfile

REQUIRED = (
    r"grouser/__init__\.py",
    r"grouser/py\.typed",
    r"grouser/native/_core\.abi3\.so",
    r"grouser/native/_core\.pyi",
    r"grouser/native/include/grouser/physics\.h",
    r"grouser/terrain/data/vehicles\.toml",
    r"grouser/terrain/data/terrains\.toml",
    r"grouser/surrogate/artifacts/m113-rigid\.safetensors",
    r"grouser/surrogate/artifacts/m113-soil\.safetensors",
    r"grouser/cli/__init__\.py",
)
ALLOWED = r"grouser/(.*\.(py|pyi|typed|toml|safetensors|h|so|pyd))|grouser-[^/]+\.dist-info/.*"
MAXIMUM_BYTES = 2_000_000


def main(path: str) -> None:
    with zipfile.ZipFile(path) as wheel:
        names = wheel.namelist()
        size = sum(entry.compress_size for entry in wheel.infolist())
    missing = [pattern for pattern in REQUIRED if not any(re.fullmatch(pattern, name) for name in names)]
    strange = [name for name in names if not re.fullmatch(ALLOWED, name)]
    if missing or strange or size > MAXIMUM_BYTES:
        sys.exit(f"{path}: missing {missing}, unexpected {strange}, {size} bytes (at most {MAXIMUM_BYTES})")
    print(f"{path}: {len(names)} files, {size} bytes")


if __name__ == "__main__":
    main(sys.argv[1])
