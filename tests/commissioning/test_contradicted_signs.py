"""Which sign is turned, by every way in which the signs of a wheel's map can be wrong; sizes are refused."""

from __future__ import annotations

import itertools
from pathlib import Path

import cantools.database
import numpy as np
import pytest
import yaml

from rw_ekf.commissioning.contradicted_signs import READ, WRITE, Ratios, agreed, named_ratio, turned_signs
from rw_ekf.commissioning.dialogue import RefusedError
from rw_ekf.commissioning.first_move import _ramp
from rw_ekf.commissioning.guarded_wheel import Bench, Row
from rw_ekf.commissioning.map_copy import write_corrected_map
from rw_ekf.commissioning.still import lattice_of
from tests.live.bench import ROOT, protocol_named


@pytest.mark.parametrize("wrong", list(itertools.product((1.0, -1.0), repeat=5)))
def test_what_is_turned_makes_every_reading_agree(wrong: tuple[float, ...]) -> None:
    """All 32 ways: with the fields turned that are named, gain, measured current, echo and angle are all positive."""
    speed, written, measured, echo, angle = wrong
    turned = turned_signs(speed * written, Ratios(measured * written, echo * written, angle * speed))
    now = {
        "speed": speed * turned.get(("speed", READ), 1.0),
        "written": written * turned.get(("current_command", WRITE), 1.0),
        "measured": measured * turned.get(("current", READ), 1.0),
        "echo": echo * turned.get(("current_command", READ), 1.0),
        "angle": angle * turned.get(("angle", READ), 1.0),
    }
    assert now["speed"] * now["written"] > 0.0
    assert now["measured"] * now["written"] > 0.0
    assert now["echo"] * now["written"] > 0.0
    assert now["angle"] * now["speed"] > 0.0
    assert (turned == {}) == (len({speed, written, measured, echo, angle}) == 1)


def test_one_sign_against_all_others_is_the_one_that_is_turned() -> None:
    """A command that contradicts speed, current and echo is turned itself, and nothing else."""
    assert turned_signs(-15.0, Ratios(-1.0, -1.0, 1.0)) == {("current_command", WRITE): -1.0}
    assert turned_signs(-15.0, Ratios(1.0, 1.0, None)) == {("speed", READ): -1.0}


def test_readings_missed_behind_a_ramp_do_not_say_that_the_wheel_stood_still() -> None:
    """Two of them behind the one that shows the motion: the ramp ends with that one; a wheel that stood is refused."""

    class Ramped(Bench):
        def __init__(self, speeds: list[float | None]) -> None:
            self.speeds = speeds

        def run(self, move: object, at_most_s: float) -> list[Row]:
            return [Row(0.1 * i, v, None, None, None, 0, 0.1, 0.01, True) for i, v in enumerate(self.speeds)]

    rows = _ramp(Ramped([0.0, None, 1.0, 1.2, None, None]), -1.0, 0.6, 0.5)
    assert [row.speed_rad_s for row in rows] == [0.0, None, 1.0, 1.2]
    with pytest.raises(RefusedError, match="backward, the current limit, did not move"):
        _ramp(Ramped([0.0, 0.1, 0.1, None]), -1.0, 0.6, 0.5)


@pytest.mark.parametrize("ratios", [Ratios(0.1, None, None), Ratios(None, -1.1, None), Ratios(None, None, 9.55)])
def test_a_size_is_never_laid_on_either_of_two(ratios: Ratios) -> None:
    """A measured current, an echo or an angle of another size is refused, naming both scales."""
    with pytest.raises(RefusedError, match=r"one scale of the wire map is wrong, that of \w+ .*and"):
        turned_signs(15.0, ratios)


def test_a_mended_map_carries_what_was_meant(tmp_path: pytest.TempPathFactory) -> None:
    """Scales of the copy are the original's times the factors, read or written as named; all else is as it was."""
    factors = {("speed", READ): -2.0, ("current_command", WRITE): -1.0}
    made = protocol_named(write_corrected_map("sunspace-wheel", factors, tmp_path))  # type: ignore[arg-type]
    true = protocol_named("sunspace-wheel")
    for register in true.wire_map.registers:
        copy = made.wire_map.register(register.name)
        assert copy is not None
        for field in register.fields:
            same = copy.field(field.name)
            assert same is not None
            assert same.scale == factors.get((field.name, register.access), 1.0) * field.scale
            assert (same.type, same.unit, same.offset) == (field.type, field.unit, field.offset)


@pytest.mark.parametrize("in_yaml", [False, True])
def test_a_mended_map_of_can_messages_carries_what_was_meant(tmp_path: Path, in_yaml: bool) -> None:
    """Of a DBC beside it, which is copied with every other line as it was, or of messages in the map itself."""
    factors = {("speed", READ): -2.0, ("current_command", WRITE): -1.0, ("temperature", READ): 0.5}
    dbc = ROOT / "config" / "can-wheel.dbc"
    source = "can-wheel"
    if in_yaml:
        data = yaml.safe_load((ROOT / "config" / "can-wheel.yaml").read_text(encoding="utf-8"))
        del data["dbc"]
        data["messages"] = [
            {
                "name": message.name,
                "id": message.frame_id,
                "length": message.length,
                "signals": [
                    {"name": one.name, "start": one.start, "length": one.length, "scale": one.scale}
                    | {
                        "type": "signed" if one.is_signed else "unsigned",
                        "offset": one.offset,
                        "unit": one.unit or "none",
                    }
                    for one in message.signals
                ],
            }
            for message in cantools.database.load_file(dbc).messages
        ]
        (tmp_path / "own.yaml").write_text(yaml.safe_dump(data), encoding="utf-8")
        source = str(tmp_path / "own.yaml")
    made = protocol_named(write_corrected_map(source, factors, tmp_path)).wire_map
    true = protocol_named(source).wire_map
    for register in true.registers:
        copy = made.register(register.name)
        assert copy is not None
        for field, same in zip(register.fields, copy.fields, strict=True):
            assert same.scale == factors.get((field.name, register.access), 1.0) * field.scale, field.name
            assert (same.name, same.unit, same.offset) == (field.name, field.unit, field.offset)
    if not in_yaml:
        old, new = (path.read_bytes().splitlines() for path in (dbc, tmp_path / "wheel-map.dbc"))
        assert sum(one != other for one, other in zip(old, new, strict=True)) == len(factors)
    with pytest.raises(RefusedError, match="another scale of angle"):
        write_corrected_map(source, {("angle", READ): -1.0}, tmp_path)


def test_a_tachometer_read_by_hand_is_taken_for_the_mistake_that_it_shows() -> None:
    """1 % off any usual mistake is that mistake; 7 % off is no usual one, and two speeds must agree on it."""
    assert named_ratio(0.1047 * 1.01)[0] == pytest.approx(2.0 * np.pi / 60.0)
    assert named_ratio(1.07)[0] == 1.07
    assert agreed(1.07, 1.08) == pytest.approx(1.075, rel=1e-3)
    assert agreed(1.07, 1.4) is None
    with pytest.raises(ValueError, match="is none"):
        named_ratio(float("nan"))


def test_a_lattice_is_seen_and_noise_is_none() -> None:
    """Readings rounded to 0.25 have that step, whatever they are offset by; the same noise unrounded has none."""
    noise = np.random.default_rng(3).normal(0.0, 0.6, 200)
    assert lattice_of(np.round(noise / 0.25) * 0.25 + 0.07) == pytest.approx(0.25)
    assert lattice_of(noise) is None
    assert lattice_of(np.zeros(50)) is None
