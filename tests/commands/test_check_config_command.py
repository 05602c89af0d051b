"""`rw-ekf check-config`: good files shown whole, bad ones refused with every finding and its place; `run` agrees."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml

from rw_ekf.cli import main
from rw_ekf.settings.resources import protocol_path
from tests.live.bench import ROOT, document_of, write_config

Map = dict[str, Any]
CONFIGURATIONS = [
    path.name for path in sorted((ROOT / "config").glob("*.yaml")) if "\nlimits:" in path.read_text(encoding="utf-8")
]


def findings(capsys: pytest.CaptureFixture[str], config: Path) -> str:
    """What check-config finds; `run` finds something too, and neither writes to standard output."""
    assert main(["check-config", str(config)]) == 2
    out, errors = capsys.readouterr()
    assert out == ""
    assert all(line.startswith("rw-ekf: error: ") for line in errors.splitlines())
    assert main(["run", "--config", str(config)]) == 2
    assert capsys.readouterr().out == ""
    return errors


@pytest.mark.parametrize("name", CONFIGURATIONS)
def test_the_shipped_configurations_are_good(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Each passes, as text that says what is a default, and as one JSON document."""
    path = str(ROOT / "config" / name)
    assert main(["check-config", path]) == 0
    shown = capsys.readouterr().out
    assert "# default: " in shown
    assert yaml.safe_load(shown)["limits"]["current_A"] > 0.0
    assert main(["check-config", path, "--json"]) == 0
    document = document_of(capsys.readouterr().out)
    assert document["schema"] in ("rw_ekf.configuration/1", "rw_ekf.bus_configuration/1")
    for one in document.get("wheels", [document]):
        assert set(one["configuration"]) >= {"wheel", "limits", "loop", "filter", "command", "output"}


def test_all_findings_come_at_once_with_line_and_column(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """An unknown key, a repeated one and a wrong type in one file: three lines, each with file:line:column."""
    config = tmp_path / "bad.yaml"
    config.write_text(
        "wheel: {port: /dev/ttyUSB0, colour: red}\nlimits: {current_A: much}\nloop: {rate_hz: 10, rate_hz: 20}\n",
        encoding="utf-8",
    )
    errors = findings(capsys, config)
    assert f"{config}:3:" in errors
    config.write_text("wheel: {port: /dev/ttyUSB0, colour: red}\nlimits: {current_A: much}\n", encoding="utf-8")
    errors = findings(capsys, config)
    assert f"{config}:1:" in errors
    assert f"{config}:2:" in errors
    assert "colour" in errors
    assert "current_A" in errors


@pytest.mark.parametrize(("key", "value"), [("current_A", 5.0), ("speed_rpm", 20000)])
def test_a_limit_that_the_wire_cannot_carry(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], key: str, value: float
) -> None:
    """Beyond what i16 of 0.1 mA or 0.5 rpm holds: the limit's own place, and what the map carries."""
    errors = findings(capsys, write_config(tmp_path, str(tmp_path / "ttyUSB0"), limits={key: value}))
    assert f"limits.{key}" in errors
    assert "wheel.yaml:" in errors


@pytest.mark.parametrize("verb", [("check-config",), ("run", "--config")])
def test_a_temperature_limit_on_a_map_without_a_temperature(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], verb: tuple[str, ...]
) -> None:
    """Nobody could keep it: refused where it is written down, and no word about the default."""
    content = yaml.safe_load(protocol_path("sunspace-wheel").read_text(encoding="utf-8"))
    for register in content["registers"]:
        register["fields"] = [f for f in register["fields"] if f["name"] != "temperature"]
    wire_map = tmp_path / "map.yaml"
    wire_map.write_text(yaml.safe_dump(content), encoding="utf-8")
    named = {"wheel": {"protocol": str(wire_map)}}
    assert (
        main(
            [*verb, str(write_config(tmp_path, str(tmp_path / "nowhere"), **named, limits={"temperature_degC": 50.0}))]
        )
        == 2
    )
    assert "limits.temperature_degC" in capsys.readouterr().err
    assert main(["check-config", str(write_config(tmp_path, str(tmp_path / "nowhere"), **named))]) == 0


def duplicate_id(content: Map) -> None:
    content["registers"].append({"id": 137, "name": "again", "access": "read", "fields": [{"name": "x", "type": "u8"}]})


def without_register(*names: str) -> Callable[[Map], None]:
    def change(content: Map) -> None:
        content["registers"] = [r for r in content["registers"] if r["name"] not in names]

    return change


BAD_MAPS: dict[str, tuple[Callable[[Map], None], str]] = {
    "two registers with one id": (duplicate_id, "137"),
    "no speed": (without_register("speed", "cycle"), "speed"),
    "no current command": (without_register("current_command"), "current_command"),
}


@pytest.mark.parametrize("name", BAD_MAPS)
def test_a_bad_wire_map_is_refused_before_a_port_is_opened(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    """check-config and run both name the map's file and place; the port, which is not there, is never tried."""
    change, expected = BAD_MAPS[name]
    content = yaml.safe_load(protocol_path("sunspace-wheel").read_text(encoding="utf-8"))
    change(content)
    wire_map = tmp_path / "map.yaml"
    wire_map.write_text(yaml.safe_dump(content), encoding="utf-8")
    errors = findings(capsys, write_config(tmp_path, str(tmp_path / "nowhere"), wheel={"protocol": str(wire_map)}))
    assert str(wire_map) in errors
    assert expected in errors


@pytest.mark.parametrize(
    "wheels", [{}, {"wheels": [{"name": "a", "address": 1}, {"name": "b", "protocol": "./bad-map.yaml"}]}]
)
def test_a_mistake_of_the_configuration_hides_none_of_its_wire_map(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], wheels: Map
) -> None:
    """An unknown section and a limit below zero, and two mistakes in the map that one wheel names: all four, once."""
    content = yaml.safe_load(protocol_path("nsp-wheel").read_text(encoding="utf-8"))
    content["link"]["baud"] = 3
    content["registers"][2]["fields"][0]["unit"] = "furlong"
    (tmp_path / "bad-map.yaml").write_text(yaml.safe_dump(content), encoding="utf-8")
    config = tmp_path / "bad.yaml"
    wheel = {"port": "p"} | ({"protocol": "nsp-wheel"} if wheels else {"protocol": "./bad-map.yaml"})
    config.write_text(
        yaml.safe_dump({"wheel": wheel, "limits": {"current_A": -1}, "limit": {}} | wheels), encoding="utf-8"
    )
    reported = findings(capsys, config).splitlines()
    assert len(reported) == 4, reported
    for text in ("unknown section limit;", "limits.current_A must be above 0", "baud must be at", "'furlong'"):
        assert sum(text in line for line in reported) == 1, reported


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("id: 0x02, name: current_command", "id: 0x7F, name: current_command"),
        ("id: 255, name: identity", "id: 255, name: pressure"),
        ("own_address: 0x11", "own_address: 0x33"),
    ],
)
def test_a_map_that_says_what_its_frames_cannot_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], old: str, new: str
) -> None:
    """NSP: a mode that would be INIT, a file that would be PING, an echo that would be a reply."""
    text = protocol_path("nsp-wheel").read_text(encoding="utf-8")
    assert text.count(old) == 1
    wire_map = tmp_path / "map.yaml"
    wire_map.write_text(text.replace(old, new), encoding="utf-8")
    errors = findings(capsys, write_config(tmp_path, str(tmp_path / "nowhere"), wheel={"protocol": str(wire_map)}))
    line = text[: text.index(old)].count("\n") + 1
    assert f"{wire_map}:{line}:" in errors


@pytest.mark.parametrize("protocol", ["nsp-wheel-torque", "nsp-wheel-large"])
def test_a_torque_s_slew_is_not_left_to_a_default_in_amperes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], protocol: str
) -> None:
    """Where the wheel takes newton metres: refused without limits.slew_A_per_s, good with it."""
    limits: dict[str, Any] = {"current_A": 0.005}
    config = tmp_path / "torque.yaml"
    wheel = {"port": str(tmp_path / "nowhere"), "protocol": protocol}  # a port that no other process asks for
    content = {"wheel": wheel, "limits": limits, "command": {"amplitude_A": 0.002}}
    config.write_text(yaml.safe_dump(content), encoding="utf-8")
    errors = findings(capsys, config)
    assert "limits.slew_A_per_s" in errors
    assert "N m per second" in errors
    limits["slew_A_per_s"] = 0.01
    config.write_text(yaml.safe_dump(content), encoding="utf-8")
    assert main(["check-config", str(config)]) == 0


def test_a_good_map_of_one_s_own_passes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A copy of the shipped map under another path is as good."""
    wire_map = tmp_path / "map.yaml"
    wire_map.write_text(protocol_path("sunspace-wheel").read_text(encoding="utf-8"), encoding="utf-8")
    assert (
        main(["check-config", str(write_config(tmp_path, str(tmp_path / "nowhere"), wheel={"protocol": "map.yaml"}))])
        == 0
    )
    assert str(wire_map) in capsys.readouterr().out


@pytest.mark.parametrize(
    ("section", "content", "expected"),
    [
        ("filter", {"model": "missing.yaml"}, "missing.yaml"),
        ("command", {"profile": "log"}, "command.log"),
        ("command", {"amplitude_A": 0.9}, "amplitude_A"),
        ("simulation", {"effects": ["no_such_effect:x=1"]}, "no_such_effect"),
        ("loop", {"rate_hz": 1000.0}, "reply_timeout_ms"),
        ("limits", {"silence_s": 0.01}, "silence_s"),
    ],
)
def test_keys_that_contradict_each_other_or_the_disk(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], section: str, content: dict[str, Any], expected: str
) -> None:
    """A model that is not there, a log not named, a command beyond its limit, an unknown effect: named, status 2."""
    config = write_config(tmp_path, str(tmp_path / "nowhere"), **{section: content})
    assert main(["check-config", str(config)]) == 2
    out, errors = capsys.readouterr()
    assert out == ""
    assert expected in errors
    assert "wheel.yaml:" in errors


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("RPM={speed:.1f}", "RPM={speed:.1g}", "no such form"),
        ("RPM={speed:.1f}", "RPM={sped:.1f}", "has a place {sped} and no field of that name"),
        (
            'request: "T?"',
            'request: "RPM=1.0 CUR=1.0000 SET=1.0000 TEMP=1.0 VOLT=1.00 MS=1"',
            "its echo would be taken",
        ),
        ("CUR={current_command:.4f}", "CUR={current_command}", "without its digits"),
        (
            "fields: [{name: current_command, unit: A, range: [-3, 3]}]",
            "fields: [{name: current_command, unit: A}]",
            "any number",
        ),
        ("range: [-3, 3]", "range: [1, 3]", "does not hold 0"),
        ("range: [-3, 3]", "range: [3, -3]", "the lowest comes first"),
        ("checksum: xor ", "checksum: crc ", "must be one of none, xor"),
        ("ERR RANGE", "OK", "is also what register current_command answers"),
        ("restarted: READY", "restarted: READY {n}", "has a place for a number"),
        ("unit: ms}", "unit: rpm}", "does not fit, uptime in rpm"),
    ],
)
def test_a_map_of_lines_that_cannot_be_says_where(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], old: str, new: str, words: str
) -> None:
    """ASCII: forms, places, echoes, limits: each refused with the line of the map, and before a port is opened."""
    text = protocol_path("ascii-wheel").read_text(encoding="utf-8")
    wire_map = tmp_path / "map.yaml"
    wire_map.write_text(text.replace(old, new, 1), encoding="utf-8")
    errors = findings(capsys, write_config(tmp_path, str(tmp_path / "nowhere"), wheel={"protocol": str(wire_map)}))
    at = errors.index(f"{wire_map}:")
    line = int(errors[at:].split(":")[1])
    assert words in errors
    assert (
        abs(line - text[: text.index(old)].count("\n") - 1) <= 3
    )  # the key itself, or its counterpart in the register


@pytest.mark.parametrize(("limit_A", "status"), [(3.0, 0), (3.1, 2)])
def test_a_limit_beyond_the_range_of_a_line_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], limit_A: float, status: int
) -> None:
    """Text carries any number: the map's range is what the wire carries."""
    config = write_config(tmp_path, "nowhere", wheel={"protocol": "ascii-wheel"}, limits={"current_A": limit_A})
    assert main(["check-config", str(config)]) == status
    assert ("from -3 to 3 A" in capsys.readouterr().err) == (status == 2)


def test_a_line_that_is_too_slow_for_the_rate_says_which_it_can(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The bytes of a turn at the line's baud rate, ten bits each, must fit into a period; the rate told does."""
    config = tmp_path / "fast.yaml"

    def write(rate_hz: float, baud: int, port: str = "/dev/ttyUSB0") -> None:
        config.write_text(
            f"wheel: {{port: {port}, baud: {baud}}}\nlimits: {{current_A: 0.5}}\n"
            f"loop: {{rate_hz: {rate_hz}, reply_timeout_ms: 4}}\ncommand: {{profile: none}}\n",
            encoding="utf-8",
        )

    write(100.0, 9600)
    reported = findings(capsys, config)
    assert f"{config}:3:17: loop.rate_hz is 100, but the bytes of a turn take the line " in reported
    able = float(reported.split("give at most ")[1].split(",")[0])
    assert 5.0 < able < 100.0
    for rate_hz, baud, port in ((able, 9600, "/dev/ttyUSB0"), (100.0, 921600, "/dev/ttyUSB0"), (100.0, 9600, "/tmp/w")):
        write(rate_hz, baud, port)
        assert main(["check-config", str(config)]) == 0
        capsys.readouterr()
    write(able * 1.01, 9600)
    assert "give at most" in findings(capsys, config)
