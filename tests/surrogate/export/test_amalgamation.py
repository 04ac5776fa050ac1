"""Several C files as one text."""

import numpy as np
import pytest

from grouser.surrogate.export.amalgamation import Amalgamation
from grouser.surrogate.export.declarations import struct_fields, take_type, with_limits, without_unused
from grouser.surrogate.export.literals import braced, double, single, struct
from grouser.terrain import ArtifactError, ConfigurationError

FILES = {
    "include/grouser/a.h": (
        "/* A. */\n#ifndef GROUSER_A_H\n#define GROUSER_A_H\n\n#include <math.h>\n\n"
        "/* Linkage. */\n#ifndef CORE\n#define CORE\n#endif\n#if defined(WIDE)\n#include <wide.h>\n#endif\n"
        "/* Twice. */\nCORE double grouser_twice(double x);\n\n#endif\n"
    ),
    "src/b.h": '#ifndef GROUSER_B_H\n#define GROUSER_B_H\n#include "grouser/a.h"\n#endif\n',
    "src/one.c": (
        '#include "grouser/a.h"\n#include "b.h"\n#include <string.h>\n\nLEVELS\n'
        "double grouser_twice(double x) { return 2 * x; }\n"
    ),
}


def read(place: str) -> str:
    try:
        return FILES[place]
    except KeyError:
        raise FileNotFoundError(place) from None


def test_headers_come_once_and_symbols_are_static() -> None:
    merged = Amalgamation(read, "CORE ", r"/\* Linkage. \*/\n#ifndef CORE\n#define CORE\n#endif\n")
    merged.add(["src/one.c"])
    assert merged.system_headers == ("math.h", "string.h")
    assert merged.text.count("/* Twice. */\nstatic double grouser_twice(double x);") == 1
    assert "\nstatic double grouser_twice(double x) { return 2 * x; }" in merged.text
    assert "CORE" not in merged.text


def test_what_is_included_on_a_condition_stays_there() -> None:
    merged = Amalgamation(read)
    merged.add(["src/one.c"])
    assert "#if defined(WIDE)\n#include <wide.h>\n#endif\n" in merged.text
    assert "wide.h" not in merged.system_headers


def test_a_missing_header_is_named() -> None:
    files = FILES | {"src/one.c": '#include "none.h"\n'}

    def read_other(place: str) -> str:
        if place not in files:
            raise FileNotFoundError(place)
        return files[place]

    with pytest.raises(ConfigurationError, match=r"native/src/one\.c includes .none\.h."):
        Amalgamation(read_other).add(["src/one.c"])


def test_types_are_taken_out_with_their_comments() -> None:
    text = "/* One. */\ntypedef struct {\n  int a, *b;\n  double c[2 * 3][4]; /* c; d */\n} one;\n\nenum { TWO = 2 };\n"
    taken, rest = take_type(text, "one")
    assert taken.startswith("/* One. */\ntypedef struct {")
    assert rest == "\nenum { TWO = 2 };\n"
    assert take_type(rest, "TWO") == ("enum { TWO = 2 };\n", "\n")
    assert struct_fields(text, "one") == ("a", "b", "c")
    with pytest.raises(ConfigurationError, match="declares no three"):
        take_type(text, "three")


def test_function_pointers_are_fields() -> None:
    text = "typedef struct {\n  const void *self;\n  void (*evaluate)(const void *self, double *y);\n} kernel;\n"
    assert struct_fields(text, "kernel") == ("self", "evaluate")


def test_unused_functions_and_constants_go_and_with_them_what_only_they_used() -> None:
    text = (
        "static const double KEPT = 1, ALSO = 2;\n"
        "/* Gone. */\nstatic const double GONE = 3;\n"
        "/* Declared. */\nstatic double gone(double x);\n"
        "static double helper(double x) { return x + GONE; }\n\n"
        "static double gone(double x) {\n  if (x > 0) {\n    x = 1;\n  }\n  return helper(x);\n}\n\n"
        "static double kept(void) {\n  return KEPT + ALSO; /* not gone */\n}\n\n"
        "/* Elsewhere. */\nstatic double nowhere(double x);\n"
        "double shown(void) { return kept(); }\n"
    )
    assert without_unused(text) == (
        "static const double KEPT = 1, ALSO = 2;\n\n\n"
        "static double kept(void) {\n  return KEPT + ALSO; /* not gone */\n}\n\n"
        "double shown(void) { return kept(); }\n"
    )


def test_limits_are_set_where_they_stand_once() -> None:
    assert with_limits("enum { A = 8, B = 512 };", {"B": 32}) == "enum { A = 8, B = 32 };"
    with pytest.raises(ConfigurationError, match="sets C 0 times"):
        with_limits("enum { A = 8 };", {"C": 1})


def test_numbers_are_read_back_to_the_bit() -> None:
    generator = np.random.default_rng(0)
    values = np.concatenate([generator.normal(0, 10.0 ** generator.integers(-30, 30, 200)), [0.0, -0.0, 1.0, 1e16]])
    for value in values:
        assert float(double(float(value))) == value
        rounded = np.float32(value)
        assert np.float32(single(rounded).removesuffix("f")) == rounded
        assert set("." + "e") & set(single(rounded))
    for bad in (np.inf, np.nan):
        with pytest.raises(ArtifactError, match="finite"):
            double(bad)
        with pytest.raises(ArtifactError, match="finite"):
            single(np.float32(bad))


def test_lists_are_wrapped_and_structs_take_the_headers_order() -> None:
    assert braced(["1", "2"]) == "{1, 2}"
    long = braced(["1.25"] * 100)
    assert max(map(len, long.splitlines())) <= 120
    assert long.replace("\n ", "").count("1.25") == 100
    header = "typedef struct {\n  int first, second;\n} pair;\n"
    assert struct(header, "pair", {"second": "2", "first": "1"}) == "{1,\n  2}"
    with pytest.raises(ConfigurationError, match=r"first, second.*first, third"):
        struct(header, "pair", {"first": "1", "third": "3"})
