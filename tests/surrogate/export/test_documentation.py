"""The C program of the documentation compiles and runs as shown."""

import re
import subprocess
from collections.abc import Callable
from pathlib import Path

from exported import GCC, WARNINGS, Exported, compiled

PAGE = Path(__file__).parents[3] / "docs" / "export.md"


def test_the_program_of_the_page_runs(exported: Callable[[str], Exported], tmp_path: Path) -> None:
    code = exported("m113-rigid")
    (program,) = re.findall(r"```c\n(.*?)```", PAGE.read_text(encoding="utf-8"), flags=re.DOTALL)
    (tmp_path / "main.c").write_text(program)
    compiled([str(GCC), "-std=c99", *WARNINGS, f"-I{code.folder}", "main.c", code.source, "-lm", "-o", "main"],
             tmp_path)  # fmt: skip
    done = subprocess.run([tmp_path / "main"], capture_output=True, text=True, check=True)
    assert re.fullmatch(r"Qx -?\d+ N, .*score 0\.\d+\nafter 5\.0 s at .* m/s\n", done.stdout), done.stdout


def test_every_function_that_the_page_names_exists(exported: Callable[[str], Exported]) -> None:
    code = exported("m113-rigid")
    for name in set(re.findall(r"`\.\.\._(\w+)`", PAGE.read_text(encoding="utf-8"))):
        assert code.function(name)
