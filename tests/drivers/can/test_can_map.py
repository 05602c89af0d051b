"""Maps of CAN messages: what is wrong with one, and wheels of other kinds by configuration alone."""

from __future__ import annotations

import copy
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

from rw_ekf.attach.wire import checked_protocol, load_protocol
from rw_ekf.cli import main
from rw_ekf.clock import SystemClock
from rw_ekf.drivers.can.can_file import CanFile
from rw_ekf.errors import ConfigError
from rw_ekf.settings.load import load_configuration
from tests.live.bench import ROOT, Bench, served_wheel, wait_for, write_config
from tests.live.can_bus import opened

pytest.importorskip("cantools")

Map = dict[str, Any]
INLINE: Map = {  # no DBC: floats, big-endian words, extended identifiers, no counter, no checksum
    "family": "can",
    "name": "another-wheel",
    "messages": [
        {
            "name": "State",
            "id": 0x18FF0101,
            "extended": True,
            "length": 8,
            "signals": [
                {"name": "Omega", "start": 0, "length": 32, "type": "float", "unit": "rad/s"},
                {
                    "name": "Iq",
                    "start": 39,
                    "length": 16,
                    "type": "signed",
                    "byte_order": "big",
                    "scale": 0.001,
                    "unit": "A",
                },
                {
                    "name": "T",
                    "start": 55,
                    "length": 12,
                    "type": "unsigned",
                    "byte_order": "big",
                    "offset": -50.0,
                    "unit": "degC",
                },
            ],
        },
        {
            "name": "Drive",
            "id": 0x18FF0201,
            "extended": True,
            "length": 4,
            "signals": [{"name": "Current", "start": 0, "length": 32, "type": "float", "unit": "A"}],
        },
        {
            "name": "Power",
            "id": 0x18FF0301,
            "extended": True,
            "length": 1,
            "signals": [{"name": "On", "start": 0, "length": 1}],
        },
        {
            "name": "Poll",
            "id": 0x18FF0401,
            "extended": True,
            "length": 1,
            "signals": [{"name": "Which", "start": 0, "length": 8}],
        },
    ],
    "telemetry": {"speed": "State.Omega", "current": "State.Iq", "temperature": "State.T"},
    "cycle": {"messages": ["State"], "period_ms": 10},
    "command": {"signal": "Drive.Current", "confirmed_by": "current", "tolerance": 0.005},
}


def changed(**sections: Any) -> Map:
    """The map with other sections."""
    return copy.deepcopy(INLINE) | sections


@pytest.fixture
def serve(tmp_path: Path) -> Iterator[Callable[[Map], Bench]]:
    """serve(map) gives a simulated wheel that speaks it, behind an slcan adapter."""
    stack: list[Any] = []

    def made(content: Map) -> Bench:
        path = tmp_path / f"map{len(stack)}.yaml"
        path.write_text(yaml.safe_dump(content), encoding="utf-8")
        stack.append(served_wheel(tmp_path, protocol=str(path), link=f"wheel{len(stack)}", noise_rpm=0.0))
        bench: Bench = stack[-1].__enter__()
        return bench

    yield made
    for one in stack:
        one.__exit__(None, None, None)


def test_a_wheel_of_another_kind_by_its_map_alone(serve: Callable[[Map], Bench]) -> None:
    """Floats, big-endian and 12-bit words, extended identifiers; a command confirmed by the current measured."""
    bench = serve(INLINE)
    wheel = opened(bench)
    sample = wheel.read(0.5)
    assert sample is not None
    assert sample.speed_rad_s == pytest.approx(20.0, abs=1.5)
    assert sample.temperature_degC == pytest.approx(20.0, abs=0.5)
    issued = wheel.command_current(-0.3215)
    assert (issued.acknowledged, issued.reason) == (True, None)
    assert issued.current_A == pytest.approx(-0.3215, rel=1e-6)
    assert bench.registers.command_A == pytest.approx(-0.3215, rel=1e-6)
    assert wheel.stop_current().acknowledged
    wheel.close()


@pytest.mark.parametrize("confirmed_by", ["current", "current_command"])
def test_a_sign_that_is_wrong_where_the_current_is_written_is_named(
    serve: Callable[[Map], Bench], tmp_path: Path, confirmed_by: str
) -> None:
    """Telemetry tells the opposite of each command, whatever confirms it: that is the reason, and it is never taken."""
    reported = {"speed": "State.Omega", confirmed_by: "State.Iq"}
    content = changed(telemetry=reported, command=INLINE["command"] | {"confirmed_by": confirmed_by})
    bench = serve(content)
    drive = next(message for message in content["messages"] if message["name"] == "Drive")
    drive["signals"][0]["scale"] = -1.0
    wrong = tmp_path / "wrong.yaml"
    wrong.write_text(yaml.safe_dump(content), encoding="utf-8")
    bench.protocol = str(wrong)
    wheel = opened(bench)
    assert [wheel.command_current(current_A).reason for current_A in (0.1, 0.1, 0.2, -0.3)] == ["opposite"] * 4
    assert wheel.command_current(0.0).reason is None
    wheel.close()


def test_a_wheel_that_tells_no_current_confirms_none(serve: Callable[[Map], Bench]) -> None:
    """Neither commanded nor measured: the command goes out, acts, and stays unacknowledged, and so does a zero."""
    content = changed(telemetry={"speed": "State.Omega"}, command={"signal": "Drive.Current"})
    bench = serve(content)
    wheel = opened(bench)
    assert wheel.read(0.5) is not None
    issued = wheel.command_current(0.2)
    assert (issued.acknowledged, issued.reason) == (False, "timeout")
    wait_for(lambda: bench.registers.command_A == pytest.approx(0.2))
    assert not wheel.stop_current().acknowledged
    wait_for(lambda: bench.registers.command_A == 0.0)
    wheel.close()


@pytest.mark.parametrize("request_", ["remote", {"message": "Poll", "signals": {"Which": 7}}])
def test_telemetry_that_is_asked_for(serve: Callable[[Map], Bench], request_: Any) -> None:
    """By a remote frame or a message: nothing comes unasked, each reading is of its own request."""
    bench = serve(changed(cycle={"messages": ["State"], "period_ms": 10, "request": request_}))
    wheel = opened(bench)
    before = wheel.link.requests
    assert all(wheel.read(0.5) is not None for _ in range(5))
    assert wheel.link.requests == before + 5
    bench.fault("silence")
    assert wheel.read(0.05) is None
    bench.fault("")
    assert wheel.read(0.5) is not None
    wheel.close()


def test_a_wheel_that_wants_to_be_enabled_is(serve: Callable[[Map], Bench]) -> None:
    """Before a current that follows a zero; so a restarted wheel is enabled again, since zero is written first."""
    bench = serve(changed(enable={"message": "Power", "signals": {"On": 1}}))
    wheel = opened(bench)
    assert wheel.command_current(0.1).reason is None
    assert bench.registers.command_A == pytest.approx(0.1)
    bench.registers.restart()
    assert wheel.command_current(0.1).reason == "not_taken"
    assert wheel.command_current(0.0).acknowledged
    assert wheel.command_current(0.1).reason is None
    wheel.close()


def test_a_watchdog_of_the_wheel_lets_go_when_nobody_commands(serve: Callable[[Map], Bench]) -> None:
    """Each tick repeats the command, and nothing else does: a driver that hangs leaves a wheel without current."""
    command = INLINE["command"] | {"watchdog_ms": 150}
    bench = serve(changed(command=command))
    wheel = opened(bench)
    for _ in range(8):
        assert wheel.command_current(0.2).reason is None
        SystemClock().sleep(0.05)
    assert bench.registers.command_A == pytest.approx(0.2)
    wait_for(lambda: bench.registers.command_A == 0.0)
    wheel.close()


SPOILT: dict[str, tuple[Callable[[Map], Any], str]] = {
    "both": (lambda m: m.update(dbc="x.dbc"), "dbc or messages: exactly one of them"),
    "neither": (lambda m: m.pop("messages"), "dbc or messages: exactly one of them"),
    "no speed": (lambda m: m["telemetry"].pop("speed"), "telemetry needs speed"),
    "no such message": (
        lambda m: m["telemetry"].update(current="Stat.Iq"),
        "current is Stat: there is no such message; there are: Drive, Poll, Power, State",
    ),
    "no such signal": (
        lambda m: m["telemetry"].update(current="State.I"),
        "telemetry.current is I: message State has no such signal",
    ),
    "no place": (lambda m: m["telemetry"].update(current="Iq"), "write Message.Signal"),
    "unknown value": (lambda m: m["telemetry"].update(speeed="State.Omega"), "speeed must be one of speed, current"),
    "unit": (
        lambda m: m["telemetry"].update(current={"signal": "State.Iq", "unit": "rpm"}),
        "unit must be one of A, mA",
    ),
    "speed beside the cycle": (
        lambda m: m["cycle"].update(messages=["Poll"]),
        "must have the message of telemetry.speed",
    ),
    "standard identifier": (lambda m: m["messages"][0].update(extended=False), "a standard identifier is below 0x800"),
    "overlap": (lambda m: m["messages"][0]["signals"][1].update(start=24), "messages.0 (State): "),
    "too long": (lambda m: m["messages"][1].update(length=2), "messages.1 (Drive): "),
    "short float": (lambda m: m["messages"][1]["signals"][0].update(length=16), "a float has 32 or 64 bits"),
    "twice": (lambda m: m["messages"][1].update(id=0x18FF0101), "messages.1.id is already used above"),
    "zero scale": (lambda m: m["messages"][0]["signals"][1].update(scale=0.0), "scale must not be 0"),
    "checksum": (lambda m: m.update(frames={"State": {"checksum": "T"}}), "checksum is T: it must be one whole byte"),
    "no such frame": (lambda m: m.update(frames={"Stat": {}}), "frames.Stat is Stat: there is no such message"),
    "algorithm": (lambda m: m.update(frames={"State": {"algorithm": "crc32"}}), "algorithm must be one of crc8"),
    "same count": (lambda m: m["cycle"].update(same_alive=True), "cycle.same_alive needs frames.State.alive"),
    "confirmed by nothing": (
        lambda m: m["command"].update(confirmed_by="current_command"),
        "which is not in telemetry",
    ),
    "no tolerance": (lambda m: m["command"].update(tolerance=0.0), "tolerance must be above 0"),
    "one message for both": (lambda m: m["command"].update(signal="State.Iq"), "nobody could tell who sent it"),
    "idle": (
        lambda m: m.update(idle={"message": "Power", "signals": {"Off": 1}}),
        "idle.signals.Off is Off: message Power has",
    ),
    "beyond its bits": (
        lambda m: m.update(idle={"message": "Power", "signals": {"On": 2}}),
        "idle.signals.On is 2: signal On has 1 bits",
    ),
    "bit rate": (lambda m: m.update(bus={"bitrate": 5}), "bus.bitrate must be at least 10000"),
    "key": (lambda m: m.update(registers=[]), "unknown key registers"),
}


@pytest.mark.parametrize("case", SPOILT)
def test_a_spoilt_map_says_where_and_what(case: str, tmp_path: Path) -> None:
    """Each mistake gives a finding with file:line:column and what to write instead."""
    spoil, message = SPOILT[case]
    content = changed()
    spoil(content)
    path = tmp_path / "map.yaml"
    path.write_text(yaml.safe_dump(content), encoding="utf-8")
    with pytest.raises(ConfigError) as raised:
        load_protocol(str(path))
    assert message in str(raised.value)
    assert all(finding.startswith(f"{path}:") for finding in raised.value.findings)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (None, "cannot be read"),
        ("BO_ 385 Motion 8 Wheel", "is no DBC file"),
        ("\x00\xff", "is no DBC file"),
        ('VERSION ""', "there is no such message"),
    ],
)
def test_a_dbc_that_cannot_be_used_says_which_and_why(tmp_path: Path, text: str | None, message: str) -> None:
    """Missing, with a mistake in its third word, no text at all, empty: one sentence each, and no traceback."""
    shipped = (ROOT / "config" / "can-wheel.yaml").read_text(encoding="utf-8")
    (tmp_path / "map.yaml").write_text(shipped.replace("can-wheel.dbc", "mine.dbc"), encoding="utf-8")
    if text is not None:
        (tmp_path / "mine.dbc").write_text(text, encoding="latin-1")
    with pytest.raises(ConfigError) as raised:
        load_protocol(str(tmp_path / "map.yaml"))
    assert message in str(raised.value)
    assert "mine.dbc" in str(raised.value) or "map.yaml:" in str(raised.value)


def test_the_fingerprint_is_of_the_dbc_too(tmp_path: Path) -> None:
    """Another scale in the DBC is another map: what was confirmed of signs and scales no longer counts."""
    for name in ("can-wheel.yaml", "can-wheel.dbc"):
        (tmp_path / name).write_bytes((ROOT / "config" / name).read_bytes())
    path = tmp_path / "can-wheel.dbc"
    before = load_protocol(str(tmp_path / "can-wheel.yaml"))
    path.write_text(path.read_text(encoding="utf-8").replace("(0.5,0)", "(0.25,0)"), encoding="utf-8")
    after = load_protocol(str(tmp_path / "can-wheel.yaml"))
    assert after.fingerprint != before.fingerprint
    assert after.limits.speed_step_rad_s == pytest.approx(0.5 * before.limits.speed_step_rad_s)


def test_without_cantools_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """One sentence that says what to install."""
    monkeypatch.setitem(sys.modules, "cantools.database", None)
    with pytest.raises(ConfigError, match=r"pip install \"rw-ekf\[can\]\""):
        load_protocol("can-wheel")


@pytest.mark.parametrize(
    ("loop", "watchdog_ms", "words"),
    [
        ({"rate_hz": 150.0, "reply_timeout_ms": 5.0}, None, "give at most 100"),
        ({"reply_timeout_ms": 15.0}, None, "give 20 or more"),
        ({"rate_hz": 60.0, "reply_timeout_ms": 15.0}, None, "give less than 50, and loop.reply_timeout_ms: 20"),
        ({"rate_hz": 5.0}, 150, "give more than 6.66667"),
    ],
)
def test_a_loop_that_does_not_fit_the_wheel_is_refused(
    tmp_path: Path, loop: dict[str, float], watchdog_ms: int | None, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Faster than telemetry, no time for a confirmation, too slow for the wheel's watchdog: check-config says so."""
    content = changed(command=INLINE["command"] | ({} if watchdog_ms is None else {"watchdog_ms": watchdog_ms}))
    (tmp_path / "map.yaml").write_text(yaml.safe_dump(content), encoding="utf-8")
    config = write_config(tmp_path, "can:virtual:x", wheel={"protocol": str(tmp_path / "map.yaml")}, loop=loop)
    assert main(["check-config", str(config)]) == 2
    assert words in capsys.readouterr().err
    with pytest.raises(ConfigError):
        checked_protocol(load_configuration(config))


@pytest.mark.parametrize(
    ("port", "protocol", "words"),
    [
        ("can:socketcan", "can-wheel", "names no CAN bus: write can:socketcan:can0"),
        ("can:", "can-wheel", "names no CAN bus"),
        ("can:sockcan:can0", "can-wheel", "python-can has no interface sockcan"),
        ("can:socketcan:can0", "sunspace-wheel", "is for a serial line"),
    ],
)
def test_a_port_that_is_no_bus_is_refused_before_a_run(
    tmp_path: Path, port: str, protocol: str, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """A run would end with status 1, and a service start it for ever: check-config and a run's start say it, with 2."""
    config = write_config(tmp_path, port, wheel={"protocol": protocol})
    assert main(["check-config", str(config)]) == 2
    assert words in capsys.readouterr().err
    with pytest.raises(ConfigError, match=words):
        checked_protocol(load_configuration(config))


def test_the_shipped_map_is_what_the_file_of_keys_knows() -> None:
    """Every key of the map's sections can be left out but those that are documented as required."""
    assert {name for name, key in CanFile.model_fields.items() if key.is_required()} == {
        "telemetry",
        "cycle",
        "command",
    }
