"""Medians of rounds, and sections as JSON holds them."""

import json
from time import sleep

from grouser.controllers.bench import Contender, Effort, Section
from grouser.controllers.bench.timing import measure, statement


def test_the_median_of_the_rounds_is_entered_by_case_and_name() -> None:
    values = iter([5.0, 1.0, 3.0, 100.0, 2.0])
    counts = iter(range(100))
    section, told = Section("ns", "Nothing."), []

    def burst(calls: int) -> float:
        return 0.0 if next(counts) < 13 else next(values)

    measure(section, [Contender("case", "name", burst)], Effort(5, 1e9), lambda *done: told.append(done))
    assert section.get("case", "name") == 3.0
    assert section.get("case", "nobody") is None
    assert section.get("nowhere", "name") is None
    assert told == [(turn, 5) for turn in range(6)]


def test_every_contender_has_its_turn_in_each_round_and_none_always_follows_the_same_one() -> None:
    turns: list[str] = []

    def named(name: str) -> Contender:
        def burst(calls: int) -> float:
            turns.append(name)
            return 1.0

        return Contender("case", name, burst)

    measure(Section("ns", ""), [named(name) for name in "abcd"], Effort(8, 0.0), lambda *_: None)
    rounds = ["".join(turns[-4 * 8 :][4 * turn : 4 * turn + 4]) for turn in range(8)]
    assert all(sorted(each) == list("abcd") for each in rounds)
    assert len(set(rounds)) > 2


def test_a_slow_first_call_does_not_decide_how_many_are_timed() -> None:
    told: list[int] = []

    def burst(calls: int) -> float:
        if not told:
            sleep(0.02)
        told.append(calls)
        return 1.0

    measure(Section("ns", ""), [Contender("case", "name", burst)], Effort(1, 0.01), lambda *_: None)
    assert told[-1] > 1


def test_a_statement_runs_as_often_as_it_is_told() -> None:
    calls: list[int] = []
    time = statement("call(1)", call=calls.append)(7)
    assert calls == [1] * 7
    assert time > 0


def test_a_section_survives_json() -> None:
    section = Section("ns", "About.", spread=0.125)
    section.add("64x64", "grouser", 80.25)
    read = Section.from_dict(json.loads(json.dumps(section.to_dict())))
    assert read == section
