"""Reading C declarations as the core writes them: structs, enumerations, functions at file scope."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping
from typing import Final

from ...terrain import ConfigurationError

_COMMENT: Final = r"(?:/\*(?:(?!\*/).)*\*/\n)?"
_DEFINITION: Final = re.compile(
    rf"^{_COMMENT}(?:static|GROUSER_INLINE) [^;{{}}=#]*?\b(?P<name>\w+)\([^;{{}}#]*\) \{{(?:[^\n]*\}}\n|\n.*?^\}}\n)",
    re.MULTILINE | re.DOTALL,
)
_COMMENTS: Final = re.compile(r"/\*.*?\*/", re.DOTALL)
_PROTOTYPE: Final = re.compile(
    rf"^{_COMMENT}(?:static|GROUSER_INLINE) [^;{{}}=#]*?\b(?P<name>\w+)\([^;{{}}]*\);\n", re.MULTILINE | re.DOTALL
)
_WORD: Final = re.compile(r"\b[A-Za-z_]\w*")
_CONSTANT: Final = re.compile(rf"^{_COMMENT}static const \w+ (?P<name>\w+) = [^;,{{}}]*;\n", re.MULTILINE | re.DOTALL)


def take_type(text: str, key: str) -> tuple[str, str]:
    """Return the declaration of a type with its comment, and the text without it.

    Parameters
    ----------
    text : str
        A header.
    key : str
        ``"enum NAME"``, the name of a typedef of a struct, or an enumerator of an enumeration without a name.

    Raises
    ------
    ConfigurationError
        If the header does not declare it.
    """
    body = r"\{[^{}]*\}"
    for declaration in (
        rf"{re.escape(key)} {body};" if key.startswith("enum ") else rf"typedef struct {body} {key};",
        rf"enum \{{[^{{}}]*\b{key} = [^{{}}]*\}};",
    ):
        found = re.search(rf"^{_COMMENT}{declaration}\n", text, re.MULTILINE | re.DOTALL)
        if found:
            return found[0], text[: found.start()] + text[found.end() :]
    raise ConfigurationError(f"the C core declares no {key}; install grouser again")


def struct_fields(text: str, name: str) -> tuple[str, ...]:
    """Return the names of the fields of ``typedef struct {...} name;``, in order.

    Raises
    ------
    ConfigurationError
        If the text declares no such struct.
    """
    declaration = _COMMENTS.sub("", take_type(text, name)[0])
    body = re.sub(r"\[[^\]]*\]", "", declaration[declaration.index("{") + 1 : declaration.rindex("}")])
    declarators = (declarator for statement in body.split(";") for declarator in _declarators(statement))
    return tuple(declarators)


def _declarators(statement: str) -> list[str]:
    pointer = re.search(r"\(\*(\w+)\)\(", statement)
    if pointer:
        return [pointer[1]]
    found = (re.search(r"(\w+)\s*$", declarator) for declarator in statement.split(","))
    return [match[1] for match in found if match]


def enumerator(text: str, name: str) -> int:
    """Return the value that a header gives an enumerator.

    Raises
    ------
    ConfigurationError
        If it gives none.
    """
    found = re.search(rf"\b{name} = (\d+)", text)
    if found is None:
        raise ConfigurationError(f"the C core declares no {name}; install grouser again")
    return int(found[1])


def with_limits(text: str, limits: Mapping[str, int]) -> str:
    """Return C text with other values for enumerators.

    Raises
    ------
    ConfigurationError
        If the text does not set one of them exactly once.
    """
    for name, value in limits.items():
        text, count = re.subn(rf"\b{name} = \d+", f"{name} = {value}", text)
        if count != 1:
            raise ConfigurationError(f"the C core sets {name} {count} times, the export expects once")
    return text


def without_unused(text: str) -> str:
    """Return C text without static functions and constants that nothing in it uses, nor what only those used."""
    while True:
        named = Counter(_WORD.findall(_COMMENTS.sub("", text)))
        # A declaration, and a definition that does not call itself, name it once each.
        named.subtract(match["name"] for match in _PROTOTYPE.finditer(text))
        defined = [match for kind in (_DEFINITION, _CONSTANT) for match in kind.finditer(text)]
        unused = {match["name"] for match in defined if named[match["name"]] == 1}
        # Declared, and defined in a file that is left out.
        unused |= {match["name"] for match in _PROTOTYPE.finditer(text) if named[match["name"]] == 0}
        if not unused:
            return text
        for kind in (_DEFINITION, _CONSTANT, _PROTOTYPE):
            text = _without(text, kind, unused)


def _without(text: str, kind: re.Pattern[str], names: set[str]) -> str:
    return kind.sub(lambda match: "" if match["name"] in names else match[0], text)
