"""What the README and the examples show runs as shown."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
# What an example needs beside the extras of ``all``, by the names of the modules.
NEEDS = {"rllib": ("ray", "lz4", "tree", "ormsgpack", "scipy"), "behaviour_cloning": ("minari", "torch")}
SLOW = ("rllib",)
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
PAGES = tuple(
    ROOT / page
    for page in ("README.md", *(f"docs/{name}.md" for name in ("physics", "environments", "export", "highway", "rl")))
)
BLOCKS = {
    f"{page.stem}-{index}": block
    for page in PAGES
    for index, block in enumerate(re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), flags=re.DOTALL))
}


def run(*arguments: str) -> str:
    # Ray's own processes warn of what is none of ours, and its sockets want a short path.
    warnings = "default" if "rllib.py" in arguments[0] else "error"
    environment = os.environ | {"PYTHONSAFEPATH": "1", "PYTHONWARNINGS": warnings, "RAY_TMPDIR": "/tmp"}
    done = subprocess.run(
        [sys.executable, *arguments], capture_output=True, text=True, env=environment, cwd=ROOT, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.parametrize(
    "example", [pytest.param(e, id=e.stem, marks=[pytest.mark.slow] * (e.stem in SLOW)) for e in EXAMPLES]
)
def test_an_example_runs(example: Path) -> None:
    for module in NEEDS.get(example.stem, ()):
        pytest.importorskip(module)
    assert run(str(example)).strip()


@pytest.mark.parametrize("block", BLOCKS.values(), ids=BLOCKS.keys())
def test_a_code_block_of_the_documentation_runs(block: str) -> None:
    run("-c", block)


def test_every_verb_that_the_readme_names_exists() -> None:
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    for verb in set(re.findall(r"^grouser (\w+)", readme, flags=re.MULTILINE)):
        run("-c", f"import sys; sys.argv = ['grouser', '{verb}', '--help']; from grouser.cli import main; main()")
