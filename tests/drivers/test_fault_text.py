"""The grammar of faults: what is written is what is at work and when, and a wrong word is named."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import pytest

from rw_ekf.drivers.sim.fault_text import describe_faults, parse_fault, parse_faults, written
from rw_ekf.drivers.sim.faults import BOTH, FROM, KINDS, TO, FaultInjector, Share
from rw_ekf.errors import BadInputError


def test_a_list_of_faults_with_amounts_directions_and_schedules() -> None:
    """Shares, times, counts, fields and registers are read, what is left out has its default."""
    faults = parse_faults(["drop:0.1,freeze@30s:5s", "delay/from:60ms:1/3@10s:20s:1min", "flip/to:10%:3", "nack/mode"])
    drop, freeze, delay, flip, nack = faults
    assert (drop.kind, drop.way, drop.share, drop.lasts_s) == ("drop", BOTH, Share(0.1), math.inf)
    assert (freeze.name, freeze.start_s, freeze.lasts_s) == ("all", 30.0, 5.0)
    assert (delay.way, delay.time_s, delay.share.one_of, delay.period_s) == (FROM, 0.06, 3, 60.0)
    assert (flip.way, flip.share.probability, flip.count) == (TO, 0.1, 3)
    assert (nack.register, nack.count) == ("mode", 4)
    value = parse_fault("value/cycle:speed=nan:0.5")
    assert (value.register, value.name, value.share) == ("cycle", "speed", Share(0.5))
    assert math.isnan(value.number)


@pytest.mark.parametrize("word", KINDS)
def test_every_kind_is_listed_as_it_can_be_written(word: str) -> None:
    """The list of faults is made of texts that parse to the defaults."""
    assert any(line.startswith(written(word) + "  ") for line in describe_faults())
    plain = word if word != "value" else "value:speed=nan"
    reported, left_out = (dataclasses.asdict(parse_fault(text)) | {"text": ""} for text in (written(word), plain))
    assert repr(reported) == repr(left_out)


@pytest.mark.parametrize(
    ("text", "stated"),
    [
        ("frezze@30s", "there is no fault 'frezze'; there are: drop, cut,"),
        ("drop:2", "'2' is not SHARE"),
        ("drop:0.1:0.2", "'0.2' is one too many: drop takes SHARE"),
        ("silence:3", "'3' is one too many: silence takes no amount"),
        ("delay:-5ms", "'-5ms' is not TIME"),
        ("drop@soon", "'soon' is not a time of a schedule, e.g. @30s:5s:1min"),
        ("drop@1s:2s:1s", "drop lasts 2 s, longer than its period of 1 s"),
        ("drop@1s:2s:3s:4s", "'4s' is one too many"),
        ("value", "value needs FIELD=NUMBER"),
        ("value:speed", "'speed' is not FIELD=NUMBER"),
        ("reset/to", "reset takes no direction"),
        ("hangup/cycle", "hangup takes no register"),
        ("drop/to/cycle", "only replies are known by register, here 'cycle'"),
        ("flip:0.1:x", "'x' is not a whole number"),
        ("heat:inf", "'inf' is not a number"),
        ("", "there is no fault ''"),
    ],
)
def test_a_wrong_word_is_named_in_one_sentence(text: str, stated: str) -> None:
    """Each mistake says which word is wrong and what is known."""
    with pytest.raises(BadInputError) as error:
        parse_fault(text)
    assert stated in str(error.value)
    assert "\n" not in str(error.value)


def test_a_schedule_begins_ends_and_comes_again() -> None:
    """At work in its stretches alone, and it knows when it next changes."""
    fault = parse_fault("silence@10s:2s:5s")
    on = [t for t in range(30) if fault.stretch_s(float(t)) is not None]
    assert on == [10, 11, 15, 16, 20, 21, 25, 26]
    assert [fault.next_change_s(t) for t in (0.0, 10.5, 13.0, 15.0)] == [10.0, 12.0, 15.0, 17.0]
    assert parse_fault("silence").next_change_s(5.0) == math.inf


def test_shares_are_drawn_or_counted_the_same_for_a_seed() -> None:
    """0.25 of many by chance, 1/4 exactly; another fault in the list changes nothing; another seed does."""

    def strikes(seed: int, *texts: str) -> list[bool]:
        injector = FaultInjector(parse_faults(texts), seed)
        (one,) = injector.on("drop", 0.0)
        return [one.strikes(0.0) for _ in range(400)]

    assert strikes(3, "drop:0.25") == strikes(3, "drop:0.25", "flip") != strikes(4, "drop:0.25")
    assert 60 < sum(strikes(3, "drop:0.25")) < 140
    assert strikes(3, "drop:1/4") == [False, False, False, True] * 100


def test_the_table_of_the_documentation_is_the_program_s() -> None:
    """Every kind stands in it as it is written, with what it does."""
    text = (Path(__file__).parents[2] / "docs" / "simulated-wheel.md").read_text(encoding="utf-8")
    for word, kind in KINDS.items():
        assert f"| `{written(word)}` | {kind.place} | {kind.what} |" in text


def test_the_command_ends_with_status_2(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """`rw-ekf simulate` with a wrong word says so in a sentence and serves nothing."""
    from rw_ekf.cli import main

    for text, word in (("drop:0.1,frezze@3s", "'frezze'"), ("drop/cylce", "'cylce'")):
        assert main(["simulate", "--link", str(tmp_path / "wheel"), "--fault", text]) == 2
        assert word in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
