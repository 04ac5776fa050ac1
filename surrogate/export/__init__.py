"""Exports of an artifact to other worlds."""

from .c_export import ABI_VERSION, export_c

__all__ = ["ABI_VERSION", "export_c"]
