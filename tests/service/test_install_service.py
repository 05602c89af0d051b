"""The unit and the rule that `install-service` makes: what they say, and that systemd understands them."""

from __future__ import annotations

import dataclasses
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from rw_ekf.errors import BadInputError
from rw_ekf.live.port_claim import DIRECTORIES
from rw_ekf.service.udev import by_id_name, rule_text
from rw_ekf.service.unit import Service, line, path_word, unit_text, word
from rw_ekf.settings.schema import OutputSection
from tests.live.bench import document_of, rw_ekf, write_config

ADAPTER = "usb-FTDI_FT232R_USB_UART_A50285BI-if00-port0"
SERVICE = Service(
    wheel="wheel",
    port=f"/dev/serial/by-id/{ADAPTER}",
    program=("/bin/true",),
    config="/etc/wheel.yaml",
    working_directory="/",
    output_directories=("/var",),
    lock_directories=DIRECTORIES,
    user="root",
    group=None,
    devices=("ttyUSB",),
    hung_after_s=5.0,
)


def keys(text: str) -> dict[str, list[str]]:
    """Every key of a unit with its values, in order."""
    found: dict[str, list[str]] = {}
    for key, value in re.findall(r"^(\w+)=(.*)$", text, re.MULTILINE):
        found.setdefault(key, []).append(value)
    return found


def test_the_unit_says_what_keeps_the_wheel_safe() -> None:
    """A watchdog, zero behind every end, no start after bad input or SAFE, and a claim that `stop` can find."""
    unit = keys(unit_text(SERVICE))
    assert unit["Type"] == ["notify"]
    assert unit["WatchdogSec"] == ["5"]
    assert unit["ExecStart"] == ["/bin/true run --keep-safe --config /etc/wheel.yaml"]
    assert unit["ExecStopPost"] == ["/bin/true stop --config /etc/wheel.yaml"]
    assert (unit["Restart"], unit["RestartPreventExitStatus"]) == (["on-failure"], ["2 5"])
    assert unit["PrivateTmp"] == ["no"]
    assert set(DIRECTORIES) == {path.removeprefix("-") for path in unit["ReadWritePaths"][0].split()} - {"/var"}
    assert unit["DeviceAllow"] == ["char-ttyUSB rw"]
    assert unit["RestrictAddressFamilies"] == ["AF_UNIX"]


def test_a_wheel_that_another_controller_commands_is_not_stopped() -> None:
    """A run that never writes leaves nothing behind that does."""
    assert "ExecStopPost" not in keys(unit_text(dataclasses.replace(SERVICE, writes=False)))


def test_a_wheel_on_the_network_gets_the_network_and_no_device() -> None:
    """A port that is a URL: no device is allowed, the families of the internet are."""
    unit = keys(unit_text(dataclasses.replace(SERVICE, port="socket://lab:4000", devices=())))
    assert "DeviceAllow" not in unit
    assert unit["RestrictAddressFamilies"] == ["AF_UNIX AF_INET AF_INET6"]
    bus = keys(unit_text(dataclasses.replace(SERVICE, port="can:socketcan:can0", devices=())))
    assert bus["RestrictAddressFamilies"] == ["AF_UNIX AF_INET AF_INET6 AF_CAN"]


def test_a_run_that_is_asked_for_over_the_network_gets_it_beside_its_device() -> None:
    """Recorders that listen or send work under the unit; those that write files need no network."""
    unit = keys(unit_text(dataclasses.replace(SERVICE, network=True)))
    assert unit["DeviceAllow"] == ["char-ttyUSB rw"]
    assert unit["RestrictAddressFamilies"] == ["AF_UNIX AF_INET AF_INET6"]
    files, places = {"mcap": True, "influx": "file"}, ("prometheus", "plotjuggler")
    assert not OutputSection.model_validate(files).over_network
    sent = [{name: "a:1"} for name in places] + [{"influx": "udp://a:1"}, {"mqtt": "mqtt://a:1/b"}]
    assert all(OutputSection.model_validate(output).over_network for output in sent)


@pytest.mark.parametrize(
    "name", ["plain", "with blank", 'a "quote"', "it's", "100%h", "$HOME", "back\\slash", "Prüfstand"]
)
def test_systemd_reads_the_unit_as_it_is_meant(tmp_path: Path, name: str) -> None:
    """`systemd-analyze verify` has nothing to say, whatever is in a path; the program's is found, or refused."""
    if shutil.which("systemd-analyze") is None:
        pytest.skip("there is no systemd-analyze on this machine")
    place = tmp_path / name
    place.mkdir()
    program = place / "rw-ekf"
    program.symlink_to("/bin/true")
    service = dataclasses.replace(
        SERVICE,
        wheel=name,
        program=("/bin/true",),
        config=str(place / "wheel.yaml"),
        working_directory=str(place),
        output_directories=(str(place),),
    )
    verify(tmp_path, service)
    service = dataclasses.replace(service, program=(str(program),))
    if any(character in name for character in "\"'\\"):
        with pytest.raises(BadInputError, match="install elsewhere"):
            unit_text(service)
    else:
        verify(tmp_path, service)


def verify(directory: Path, service: Service) -> None:
    """Let systemd read a unit."""
    unit = directory / "rw-ekf-test.service"
    unit.write_text(unit_text(service), encoding="utf-8")
    done = subprocess.run(["systemd-analyze", "verify", "--man=no", unit], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_words_that_cannot_stand_in_a_unit_are_refused() -> None:
    """A line break would be another key: refused with the name; what systemd would expand is doubled."""
    assert word("$HOME %h") == '"$$HOME %%h"'
    assert path_word('/a "b"') == "'/a \"b\"'"
    for bad in ("a\nUser=root", "", " a"):
        with pytest.raises(BadInputError, match="cannot stand"):
            line(bad)


def test_the_verb_prints_what_it_would_write_and_overwrites_nothing(tmp_path: Path) -> None:
    """--print and --write have the same text; the second time nothing is written, status 2, the file is named."""
    config = str(write_config(tmp_path, "/nowhere/ttyUSB0"))
    arguments = ("install-service", "--config", config, "--user", "root", "--root", str(tmp_path))
    shown = document_of(rw_ekf(*arguments, "--json").stdout)
    assert not shown["written"]
    written = rw_ekf(*arguments, "--write")
    assert written.returncode == 0, written.stderr
    (unit,) = shown["files"]
    assert Path(unit["path"]).read_text(encoding="utf-8") == unit["text"]
    assert f"run --keep-safe --config {config}" in unit["text"]
    assert "systemctl enable --now rw-ekf-wheel" in written.stdout
    again = rw_ekf(*arguments, "--write")
    assert again.returncode == 2
    assert unit["path"] in again.stderr
    assert "by-id" in again.stderr
    assert rw_ekf(*arguments, "--user", "nobody-of-that-name").returncode == 2


def test_a_line_has_one_unit_with_what_any_of_its_wheels_needs(tmp_path: Path) -> None:
    """Zero behind every end though the first is only listened to; each folder is writable; the network for one's sink.

    A line that could not run has no unit.
    """
    x = "{name: rw-x, address: 1, command: {profile: none}}"
    y = "{name: rw-y, address: 2, output: {directory: elsewhere, prometheus: 'localhost:9464'}}"
    config = tmp_path / "triad.yaml"
    config.write_text(
        f"wheel: {{port: /nowhere/ttyUSB0, protocol: nsp-wheel}}\nlimits: {{current_A: 0.5}}\n"
        f"loop: {{rate_hz: 10}}\nwheels: [{x}, {y}]\n",
        encoding="utf-8",
    )
    done = rw_ekf("install-service", "--config", str(config), "--user", "root", "--json", cwd=tmp_path)
    (file,) = document_of(done.stdout)["files"]
    unit = keys(file["text"])
    assert Path(file["path"]).name == "rw-ekf-triad.service"
    assert unit["ExecStopPost"][0].endswith(f"stop --config {config}")
    assert {str(tmp_path / "runs"), str(tmp_path / "elsewhere")} <= set(unit["ReadWritePaths"][0].split())
    assert unit["RestrictAddressFamilies"] == ["AF_UNIX AF_INET AF_INET6"]
    assert f"sudo install -d -o root {tmp_path / 'runs'} {tmp_path / 'elsewhere'}" in done.stderr
    config.write_text(config.read_text(encoding="utf-8").replace("rate_hz: 10", "rate_hz: 60, reply_timeout_ms: 5"))
    refused = rw_ekf("install-service", "--config", str(config), "--user", "root")
    assert refused.returncode == 2
    assert "give at most" in refused.stderr


def test_a_rule_keeps_other_programs_from_the_adapter() -> None:
    """Row 5: ModemManager and brltty leave exactly this adapter alone, and an FTDI chip answers at once."""
    rule = rule_text(ADAPTER)
    assert 'ENV{ID_SERIAL}!="FTDI_FT232R_USB_UART_A50285BI", GOTO="rw_ekf_end"' in rule
    assert rule.count('ENV{ID_MM_DEVICE_IGNORE}="1"') == 2
    assert 'ENV{SYSTEMD_WANTS}=""' in rule
    assert 'ATTR{device/latency_timer}="1"' in rule
    for text in rule.splitlines():
        assert re.fullmatch(
            r'#.*|([A-Z]+(\{[\w/]+\})?(==|!=|=)"[^"]*")(, ([A-Z]+(\{[\w/]+\})?(==|!=|=)"[^"]*"))*', text
        )


@pytest.mark.parametrize(
    ("names", "found"),
    [
        (["/dev/ttyUSB0", f"/dev/serial/by-id/{ADAPTER}"], ADAPTER),
        (["/dev/serial/by-id/usb-1a86_USB_Serial-if00"], "usb-1a86_USB_Serial-if00"),
        (["/dev/ttyUSB0", "/dev/serial/by-path/pci-0000:00:14.0-usb-0:1:1.0-port0"], None),
        (['/dev/serial/by-id/usb-a"b-if00'], None),
        ([], None),
    ],
)
def test_the_stable_name_of_an_adapter_is_found(names: list[str], found: str | None) -> None:
    """Row 5: only a name by which udev knows the adapter itself makes a rule."""
    assert by_id_name(names) == found
