"""``grouser verify``: a dataset or an artifact before it is used."""

from __future__ import annotations

from collections.abc import Sequence
from math import isnan
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..terrain import ArtifactError, ConfigurationError
from ._console import out, print_facts
from ._tables import number, table

if TYPE_CHECKING:
    from ..surrogate.offline import Dataset, Finding


def verify(
    target: Annotated[
        str,
        typer.Argument(metavar="DATASET|ARTIFACT", help="Folder of a dataset, or a surrogate: file or shipped name."),
    ],
    dataset: Annotated[
        list[Path] | None,
        typer.Option(metavar="FOLDER", help="Of an artifact: what it was trained on; once for each that was joined."),
    ] = None,
    baseline: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Of an artifact: metrics that must not have got worse.")
    ] = None,
    write_baseline: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Gets the artifact's metrics as a baseline, if all is well.")
    ] = None,
    json: Annotated[Path | None, typer.Option(metavar="FILE", help="Gets the findings, too.")] = None,
) -> None:
    """Verify a dataset or an artifact before it is used; leaves with 1 if a check fails.

    A dataset: files and hash, physical bounds, its recipe drawn again, its forces computed again, leaks between the
    sides of a split. An artifact: seal and sizes, agreement of torch and C with float64, the block's symmetries, the
    detector; with --dataset its test metrics, computed again; with --baseline that they are no worse than they were.
    The baseline file states how much worse they may be.
    """
    from ..terrain import write_json

    if _is_dataset(target):
        if dataset or baseline or write_baseline:
            raise ConfigurationError("--dataset, --baseline and --write-baseline go with an artifact, not a dataset")
        from ..surrogate.offline import verify_dataset

        findings = verify_dataset(Path(target))
    else:
        findings = _artifact_findings(target, _joined(dataset), baseline, write_baseline)
    _print_findings(target, findings)
    failed = sum(not finding.passed for finding in findings)
    if json is not None:
        json.parent.mkdir(parents=True, exist_ok=True)
        write_json(json, {"target": target, "passed": not failed, "findings": [each.to_dict() for each in findings]})
    print_facts({"checks": f"{len(findings) - failed} of {len(findings)} passed"})
    if failed:
        raise typer.Exit(1)


def _is_dataset(target: str) -> bool:
    """Return whether the target is a dataset's folder or an artifact.

    Raises
    ------
    ArtifactError
        If it is neither.
    """
    from ..surrogate import shipped_names
    from ..surrogate.artifact import SUFFIX
    from ..surrogate.offline.dataset import MANIFEST_NAME
    from ..surrogate.offline.generate import PARTS_NAME

    path = Path(target)
    if path.is_dir():
        if (path / MANIFEST_NAME).is_file():
            return True
        if (path / PARTS_NAME).is_dir():
            raise ArtifactError(
                f"{target} holds an unfinished dataset; call the same 'grouser data' again to finish it"
            )
    elif target in shipped_names() or (path.is_file() and path.suffix == SUFFIX):
        return False
    found = "there is no such file or folder" if not path.exists() else f"a folder without {MANIFEST_NAME}"
    if path.is_file():
        found = f"a file whose name does not end in {SUFFIX}"
    raise ArtifactError(
        f"{target} is neither a dataset nor an artifact: {found}; make one with 'grouser data' or 'grouser train', or "
        f"name a shipped artifact ({', '.join(shipped_names()) or 'none'})"
    )


def _joined(folders: list[Path] | None) -> Dataset | None:
    from ..surrogate.offline import join_datasets, load_dataset

    return join_datasets([load_dataset(folder) for folder in folders]) if folders else None


def _artifact_findings(
    target: str, dataset: Dataset | None, baseline: Path | None, write_baseline: Path | None
) -> list[Finding]:
    from ..surrogate import Surrogate
    from ..surrogate.offline import verification

    kept = None if baseline is None else verification.read_baseline(baseline)
    findings = verification.verify_artifact(target, dataset=dataset, baseline=kept)
    if write_baseline is not None and all(finding.passed for finding in findings):
        judgement = verification.judgement_of(Surrogate.load(target), dataset)
        verification.write_baseline(write_baseline, verification.Baseline(judgement))
    return findings


def _print_findings(target: str, findings: Sequence[Finding]) -> None:
    from rich.markup import escape

    headings = ["check", "on", "detail", "measured", "limit", "unit", "passed"]
    listed = table(f"Verification of {escape(target)}", headings, text_columns=3)
    for finding in findings:
        listed.add_row(
            finding.check,
            finding.subject,
            escape(finding.detail),
            "–" if isnan(finding.measured) else f"{finding.measured:.3g}",
            number(finding.limit, ".6g"),
            finding.unit,
            _verdict(finding),
        )
    out.print(listed)


def _verdict(finding: Finding) -> str:
    if finding.limit is None:
        return "told"
    return "yes" if finding.passed else "[red]no[/red]"
