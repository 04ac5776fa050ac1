"""Every check, in order."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from ..vehicle import TrackedVehicle, check_contact
from .agreement_checks import grid_convergence, jacobian, parity, track_split
from .blocks import BLOCKS, ORACLE, Block
from .check import Check
from .closed_form_checks import full_slip_moments, golden_state, lateral_saturation, thrust
from .identity_checks import load_sums, power_identity, symmetries
from .turn_checks import RADII, printed_figures, skid_turns, turning_resistances


def run_checks(
    vehicle: TrackedVehicle,
    *,
    blocks: Sequence[Block] = BLOCKS,
    quick: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> list[Check]:
    """Run every check against each block, sorted by group.

    Golden state, printed figures, steady skid turn and turning resistance are those of the M113, whatever the vehicle.

    Parameters
    ----------
    vehicle : TrackedVehicle
        Whose block is checked; its contact elements meet.
    blocks : sequence of Block
        The implementations.
    quick : bool
        Fewer random states.
    progress : callable, optional
        Called with the number of finished and of all groups of checks.

    Raises
    ------
    InvalidInputError
        If the vehicle's contact elements leave gaps: the closed forms are those of continuous contact.
    """
    check_contact("continuous", vehicle)
    count = 40 if quick else 300
    groups: list[Callable[[], Iterator[Check]]] = [printed_figures]
    for block in blocks:
        groups += _groups(block, vehicle, count, quick)
    checks: list[Check] = []
    for done, group in enumerate(groups, start=1):
        checks += group()
        if progress is not None:
            progress(done, len(groups))
    return sorted(checks, key=lambda check: check.number)


def _groups(block: Block, vehicle: TrackedVehicle, count: int, quick: bool) -> list[Callable[[], Iterator[Check]]]:
    oracle = block is ORACLE
    groups: list[Callable[[], Iterator[Check]]] = [
        lambda: golden_state(block),
        lambda: thrust(block, vehicle),
        lambda: full_slip_moments(block, vehicle),
        lambda: turning_resistances(block, RADII[::10] if oracle else RADII),
        lambda: lateral_saturation(block, vehicle),
        lambda: power_identity(block, vehicle, count),
        lambda: load_sums(block, vehicle, count),
        lambda: symmetries(block, vehicle, count),
        lambda: track_split(block, vehicle, count),
    ]
    if not (oracle and quick):
        groups.append(lambda: skid_turns(block))
    if oracle:
        return [*groups, lambda: parity(block, vehicle, count)]
    return [
        *groups,
        lambda: grid_convergence(block, vehicle, count),
        lambda: jacobian(block, ORACLE, vehicle, max(count // 3, 50)),
    ]
