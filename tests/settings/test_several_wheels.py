"""`wheels` of a configuration: what each entry comes to, and every mistake with file:line:column."""

from __future__ import annotations

from pathlib import Path

import pytest

from rw_ekf.cli import main
from rw_ekf.errors import ConfigError
from rw_ekf.settings.load import load_configuration, load_configurations
from rw_ekf.settings.stop_settings import read_line
from tests.live.bench import served_wheel, write_config

GOOD = """\
wheel: {port: /dev/line, protocol: nsp-wheel, echo: true, inertia_kg_m2: 2.0e-3}
wheels:
  - {name: rw-x, address: 0x31}
  - name: rw-y
    address: 0x32
    inertia_kg_m2: 3.0e-3
    limits: {current_A: 0.2}
    filter: {prior: {coulomb: {value: 0.5, std: 0.1}}}
limits: {current_A: 0.6, speed_rpm: 1000}
loop: {reply_timeout_ms: 25}
"""


def findings(directory: Path, text: str) -> list[str]:
    """What is told of a file, without its directory."""
    path = directory / "bus.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError) as caught:
        load_configurations(path)
    return [finding.replace(f"{directory}/", "") for finding in caught.value.findings]


def test_each_wheel_has_the_file_s_keys_but_those_of_its_entry(tmp_path: Path) -> None:
    """A key of an entry stands in place of that key; the others of its section stay the file's."""
    path = tmp_path / "bus.yaml"
    path.write_text(GOOD, encoding="utf-8")
    x, y = load_configurations(path)
    assert (x.wheel.name, x.wheel.address, x.wheel.port, x.wheel.echo) == ("rw-x", 0x31, "/dev/line", True)
    assert (x.wheel.inertia_kg_m2, x.limits.current_A, x.limits.speed_rpm) == (2.0e-3, 0.6, 1000)
    assert (y.wheel.inertia_kg_m2, y.limits.current_A, y.limits.speed_rpm) == (3.0e-3, 0.2, 1000)
    assert x.filter.prior is None
    assert y.filter.prior is not None
    assert load_configuration(path, "rw-y") == y
    assert read_line(path).wheels == (x, y)


def test_a_verb_for_one_wheel_asks_which(tmp_path: Path) -> None:
    """Without a name the known ones are told; with a wrong one too."""
    path = tmp_path / "bus.yaml"
    path.write_text(GOOD, encoding="utf-8")
    with pytest.raises(ConfigError, match="it has 2 wheels; say which one is meant: --wheel NAME, of rw-x, rw-y"):
        load_configuration(path)
    with pytest.raises(ConfigError, match="it has no wheel 'rw-q'; known here: rw-x, rw-y"):
        load_configuration(path, "rw-q")


@pytest.mark.parametrize(
    ("old", "new", "stated"),
    [
        ("address: 0x31", "adress: 0x31", "bus.yaml:3:18: unknown key wheels.0.adress; did you mean 'address'?"),
        ("address: 0x31", "port: /dev/x", "bus.yaml:3:18: wheels.0.port: all wheels are on one line: give it in"),
        ("address: 0x31", "loop: {}", "bus.yaml:3:18: wheels.0.loop: one loop reads all wheels: give it in the sect"),
        ("name: rw-x, ", "", "bus.yaml:3:5: wheels.0.name is required: what reports and logs call this wheel"),
        ("name: rw-y", "name: rw-x", "bus.yaml:4:11: wheels.1.name 'rw-x' is the name of a wheel above"),
        ("address: 0x31", "address: 300", "bus.yaml:3:27: wheel.address must be at most 255, found 300"),
        ("{current_A: 0.2}", "{curent_A: 0.2}", "bus.yaml:7:14: unknown key limits.curent_A; did you"),
        ("{current_A: 0.2}", "{current_A: -1}", "bus.yaml:7:25: limits.current_A must be above 0, found -1"),
        ("{current_A: 0.2}", "7", "bus.yaml:7:13: limits must be a table of keys, found 7"),
        ("current_A: 0.6,", "current_A: x,", "bus.yaml:9:21: limits.current_A must be a number, found the text 'x'"),
        ("  - {name: rw-x, address: 0x31}", "  - rw-x", "bus.yaml:3:5: wheels.0 must be a table with a name, fou"),
        ("reply_timeout_ms: 25", "reply_timeout_ms: 60", "bus.yaml:10:26: loop.reply_timeout_ms 60 must be below half"),
        ("loop:", "output: {mqtt: 'mqtt://h:1/t'}\nloop:", "bus.yaml:10:16: output.mqtt 'mqtt://h:1/t' is that of"),
    ],
)  # fmt: skip
def test_every_mistake_has_its_place(tmp_path: Path, old: str, new: str, stated: str) -> None:
    """In the entry where it stands there, else in the section; told once though it is every wheel's."""
    reported = findings(tmp_path, GOOD.replace(old, new, 1))
    assert len(reported) == 1, reported
    assert stated in reported[0]


@pytest.mark.parametrize("wheels", ["wheels: []", "wheels: 3", "wheels:"])
def test_a_list_without_wheels_is_told(tmp_path: Path, wheels: str) -> None:
    """Empty, a number, nothing."""
    reported = findings(tmp_path, f"wheel: {{port: p}}\nlimits: {{current_A: 1}}\n{wheels}\n")
    assert len(reported) == 1
    assert "wheels must be a list of wheels, each with a name" in reported[0]


@pytest.mark.parametrize(
    ("old", "new", "stated"),
    [
        ("address: 0x32", "address: 0x31", ":5:14: wheel.address 49 of rw-y is that of rw-x too"),
        ("address: 0x32", "address: 0x11", ":5:14: wheel.address is 17, which is this program's own"),
        ("address: 0x32", "protocol: vesc-wheel", ":5:15: wheel.protocol: the wire map 'vesc-wheel' is of a family"),
        (
            "address: 0x32",
            "address: 2\n    protocol: ascii-wheel",
            "wheel.address is 2, but the lines of the wire map have no place {address:d}",
        ),
        ("address: 0x32", "protocol: sunspace-wheel", "wheel.address is required for rw-y: it is one of several"),
        (
            "reply_timeout_ms: 25",
            "reply_timeout_ms: 5, rate_hz: 60",
            "loop.rate_hz is 60, but the bytes of a turn of "
            "each of 2 wheels take the line 42 ms: give at most 23.8, or a faster line.",
        ),  # 121 bytes at 57600 baud each
    ],
)
def test_check_config_says_why_wheels_cannot_share_a_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], old: str, new: str, stated: str
) -> None:
    """Two of one address, the program's own, a family without addresses, a map without one: each with its place."""
    path = tmp_path / "bus.yaml"
    path.write_text(GOOD.replace(old, new, 1), encoding="utf-8")
    assert main(["check-config", str(path)]) == 2
    assert stated in capsys.readouterr().err


@pytest.mark.parametrize(
    ("old", "new", "stated"),
    [
        ("{address: 1, ", "{", ":11:14: registers.0.request has a place {address:d}: give framing.address"),
        ("#{address:02d} T?", "T?", ":11:14: registers.0.request has no {address:d}, and framing.address is given"),
        ("#{address:02d} OK", "OK", "registers.1.reply has no {address:d}, and framing.address is given"),
        ("#{address:02d} T?", "#{address} T?", "write {address:d} or {address:02d}"),
        ("name: temperature", "name: address", "is kept for framing.address; give it another name"),
    ],
)
def test_a_map_of_lines_that_bear_an_address_says_what_is_wrong(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], old: str, new: str, stated: str
) -> None:
    """A place and no address, an address and no place, a place of any digits, and a field of that name."""
    good = Path(__file__).parents[1].joinpath("live", "addressed-lines.yaml").read_text(encoding="utf-8")
    assert old in good
    (tmp_path / "map.yaml").write_text(good.replace(old, new, 1), encoding="utf-8")
    path = tmp_path / "wheel.yaml"
    path.write_text("wheel: {port: nowhere, protocol: ./map.yaml}\nlimits: {current_A: 0.3}\n", encoding="utf-8")
    assert main(["check-config", str(path)]) == 2
    assert stated in capsys.readouterr().err


def test_an_address_of_one_wheel_that_is_this_program_s_to_another_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """`own_address` of one map is the address of the other wheel: each would take for its own what is the other's."""
    own_map = Path(__file__).parents[2].joinpath("config", "nsp-wheel.yaml").read_text(encoding="utf-8")
    (tmp_path / "other.yaml").write_text(own_map.replace("own_address: 0x11", "own_address: 0x31"), encoding="utf-8")
    path = tmp_path / "bus.yaml"
    path.write_text(GOOD.replace("address: 0x32", "address: 0x32\n    protocol: ./other.yaml"), encoding="utf-8")
    assert main(["check-config", str(path)]) == 2
    assert ":3:27: wheel.address 49 of rw-x is this program's own to rw-y" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("key", "places", "is_one"),
    [
        ("prometheus", ("localhost:9464", "127.0.0.1:9464"), True),
        ("prometheus", ("LocalHost:9464", "[::1]:9464"), True),
        ("prometheus", ("0.0.0.0:9464", "127.0.0.1:9464"), True),
        ("prometheus", ("localhost:9464", "127.0.0.1:9465"), False),
        ("prometheus", ("127.0.0.1:9464", "127.0.0.2:9464"), False),
        ("plotjuggler", ("localhost:9870", "127.0.0.1:9870"), True),
        ("mqtt", ("mqtt://localhost:1883/w", "mqtt://127.0.0.1:1883/w"), True),
        ("mqtt", ("mqtt://localhost:1883/w/x", "mqtt://127.0.0.1:1883/w/y"), False),
    ],
)
def test_one_place_in_two_ways_of_writing_is_found(
    tmp_path: Path, key: str, places: tuple[str, str], is_one: bool
) -> None:
    """The loopback by name and by number, and every address of the computer; other ports and topics are others."""
    text = GOOD.replace("{name: rw-x,", f"{{name: rw-x, output: {{{key}: '{places[0]}'}},")
    text = text.replace("    inertia_kg_m2: 3.0e-3", f"    output: {{{key}: '{places[1]}'}}")
    if is_one:
        (reported,) = findings(tmp_path, text)
        assert f"output.{key} '{places[1]}' is that of rw-x and of rw-y" in reported
    else:
        path = tmp_path / "bus.yaml"
        path.write_text(text, encoding="utf-8")
        assert len(load_configurations(path)) == 2


@pytest.mark.parametrize(("port", "protocol"), [("can:socketcan:can0", "can-wheel"), ("/dev/ttyACM0", "can-wheel")])
def test_an_echo_is_of_a_serial_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], port: str, protocol: str
) -> None:
    """There is none on a CAN bus, whatever the adapter: told before a run, with its place."""
    path = tmp_path / "can.yaml"
    wheel = f"wheel: {{port: '{port}', protocol: {protocol}, echo: true}}"
    path.write_text(f"{wheel}\nlimits: {{current_A: 0.5}}\n", encoding="utf-8")
    assert main(["check-config", str(path)]) == 2
    assert f"wheel.echo is true, but {port} and the wire map 'can-wheel' are of no serial" in capsys.readouterr().err


def test_stop_writes_zero_on_a_can_bus_whatever_is_said_of_an_echo(tmp_path: Path) -> None:
    """What `check-config` refuses keeps no current in force."""
    with served_wheel(tmp_path, protocol="can-wheel") as bench:
        bench.registers._drive(0.1)
        assert bench.registers.command_A == 0.1
        config = write_config(tmp_path, bench.port, wheel={"protocol": "can-wheel", "echo": True})
        assert main(["stop", "--config", str(config)]) == 0
        assert bench.registers.command_A == 0.0


def test_stop_finds_every_wheel_of_a_file_with_mistakes(tmp_path: Path) -> None:
    """A misspelt limit, and text that is no YAML behind it: the line and every address are there all the same."""
    path = tmp_path / "bus.yaml"
    path.write_text(GOOD.replace("speed_rpm", "sped_rpm"), encoding="utf-8")
    line = read_line(path)
    assert line.findings
    assert [(one.wheel.name, one.wheel.address) for one in line.wheels] == [("rw-x", 0x31), ("rw-y", 0x32)]
    assert {(one.wheel.port, one.wheel.protocol, one.wheel.echo) for one in line.wheels} == {
        ("/dev/line", "nsp-wheel", True)
    }


def test_names_that_are_one_as_names_of_files_are_refused(tmp_path: Path) -> None:
    """What two such wheels learn and publish would be each other's."""
    found = findings(tmp_path, GOOD.replace("rw-y", "rw x"))
    assert found == [
        "bus.yaml:4:11: wheel.name 'rw x' gives the same file names as 'rw-x': what they learn and publish would be "
        "each other's; give another name"
    ]


@pytest.mark.parametrize(
    ("good", "bad", "doubt"),
    [
        ("address: 0x32", 'address: "0x4l"', "wheels.1.address cannot be used"),
        ("name: rw-y", "name: [rw-y]", "wheels.1.name cannot be used"),
        ("  - {name: rw-x, address: 0x31}", "  - rw-x", "wheels.0 is no table"),
    ],
)
def test_an_entry_that_cannot_be_read_is_a_doubt_of_stop(tmp_path: Path, good: str, bad: str, doubt: str) -> None:
    """Zero may not have reached that wheel: it must not be said that all confirmed it."""
    path = tmp_path / "bus.yaml"
    path.write_text(GOOD.replace(good, bad), encoding="utf-8")
    line = read_line(path)
    assert line.names_wheels
    assert any(doubt in text for text in line.doubts)


@pytest.mark.parametrize("given", [[], ["--keep-safe"]])
def test_a_line_keeps_safe_where_a_service_starts_it_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, given: list[str]
) -> None:
    """The option of the unit that `install-service` writes reaches the run of several wheels, as of one."""
    path, wanted = tmp_path / "bus.yaml", []

    def run_bus(*_: object, keep_safe: bool = False) -> int:
        wanted.append(keep_safe)
        return 0

    path.write_text(GOOD, encoding="utf-8")
    monkeypatch.setattr("rw_ekf.commands.run_bus.run_bus", run_bus)
    assert main(["run", "--config", str(path), *given]) == 0
    assert wanted == [bool(given)]


def test_resume_on_a_line_takes_a_name_and_begins_no_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A wheel that moves again is asked for by name, also with --supervise; where nothing runs, nothing begins."""
    path = tmp_path / "bus.yaml"
    path.write_text(GOOD, encoding="utf-8")
    for more in ([], ["--supervise"]):
        assert main(["run", "--config", str(path), "--resume", *more]) == 2
        assert "--wheel NAME, of rw-x, rw-y" in capsys.readouterr().err
        assert main(["run", "--config", str(path), "--wheel", "rw-y", "--resume", *more]) == 1
        assert "no run drives this line: nothing to resume" in capsys.readouterr().err
