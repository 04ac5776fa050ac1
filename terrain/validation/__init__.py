"""The block against what is known: checks with tolerances, studies with plots, and the report of both."""

from .blocks import BLOCKS, COMPILED, ORACLE, Block, ReferenceBackend
from .cells import Cells, shear_cells
from .check import Check, Kind
from .checks import run_checks
from .report import Validation, format_difference, format_value, page, validate, write_validation
from .states import driven_states, random_states
from .studies import STUDIES, Study

__all__ = [
    "BLOCKS",
    "COMPILED",
    "ORACLE",
    "STUDIES",
    "Block",
    "Cells",
    "Check",
    "Kind",
    "ReferenceBackend",
    "Study",
    "Validation",
    "driven_states",
    "format_difference",
    "format_value",
    "page",
    "random_states",
    "run_checks",
    "shear_cells",
    "validate",
    "write_validation",
]
