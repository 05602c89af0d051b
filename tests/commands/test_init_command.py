"""`rw-ekf init`: a configuration that can be used, for whatever ports there are, and never over a file."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace

import pytest

from rw_ekf.cli import main
from rw_ekf.errors import ConfigError
from rw_ekf.live import port_name
from rw_ekf.settings.load import load_configuration
from rw_ekf.settings.schema import Configuration
from tests.contract import check_document


def find(monkeypatch: pytest.MonkeyPatch, *devices: str) -> None:
    """These are the serial ports of the machine; those on USB have a vendor."""
    ports = [SimpleNamespace(device=device, vid=0x0403 if "USB" in device else None) for device in devices]
    monkeypatch.setattr("serial.tools.list_ports.comports", lambda: ports)


def with_limit(path: str, current_A: float) -> Configuration:
    """The file with the one number that its owner has to give."""
    text = Path(path).read_text(encoding="utf-8")
    assert text.count("\n  current_A: ") == 1
    Path(path).write_text(text.replace("\n  current_A: ", f"\n  current_A: {current_A} "), encoding="utf-8")
    return load_configuration(path)


@pytest.fixture(autouse=True)
def _here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize(
    ("devices", "port", "stated"),
    [
        ((), "/dev/serial/by-id/NAME-OF-YOUR-ADAPTER", "no serial port was found: wheel.port is a placeholder"),
        (("/dev/ttyUSB7",), "/dev/ttyUSB7", "written; wheel.port is /dev/ttyUSB7"),
        (("/dev/ttyS0", "/dev/ttyUSB7"), "/dev/ttyUSB7", "2 serial ports were found: wheel.port is /dev/ttyUSB7"),
    ],
)
def test_the_file_is_the_example_with_the_port_that_was_found(
    devices: tuple[str, ...],
    port: str,
    stated: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """With no port, one, or several: the example but for the port and the largest current; what was done is said."""
    find(monkeypatch, *devices)
    assert main(["init"]) == 0
    assert stated in capsys.readouterr().out
    made, example = with_limit("my-wheel.yaml", 0.6), load_configuration("example")
    assert made.wheel == example.wheel.model_copy(update={"port": port})
    assert made.model_copy(update={"wheel": example.wheel}) == example
    others = [line for line in Path("my-wheel.yaml").read_text().splitlines() if "also found" in line]
    assert others == ["  # also found: /dev/ttyS0"] * (len(devices) > 1)


def test_a_port_goes_by_the_name_that_stays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """What udev calls the adapter is written, not the number of the day; the document names it."""
    device = tmp_path / "ttyUSB0"
    device.touch()
    (tmp_path / "by-id").mkdir()
    (tmp_path / "by-id" / "usb-adapter").symlink_to(device)
    monkeypatch.setattr(port_name, "_ALIASES", (str(tmp_path / "by-id"),))
    find(monkeypatch, str(device))
    assert main(["init", "--json", "-o", "w.yaml"]) == 0
    document = json.loads(capsys.readouterr().out)
    check_document(document)
    stays = str(tmp_path / "by-id" / "usb-adapter")
    assert (document["port"], document["found"]) == (stays, [stays])
    assert with_limit("w.yaml", 0.2).wheel.port == stays


def test_a_port_that_is_named_is_taken_as_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    """--port, whatever signs it has, and without a look at the machine's own."""
    find(monkeypatch, "/dev/ttyUSB7")
    port = 'socket://10.0.0.5:4001?a="#: ü'
    assert main(["init", "--port", port]) == 0
    assert with_limit("my-wheel.yaml", 0.2).wheel.port == port
    assert "ttyUSB7" not in Path("my-wheel.yaml").read_text()


def test_what_may_move_the_wheel_is_not_made_up(monkeypatch: pytest.MonkeyPatch) -> None:
    """The file is refused until its owner has given the largest current."""
    find(monkeypatch, "/dev/ttyUSB7")
    assert main(["init"]) == 0
    with pytest.raises(ConfigError, match=r"my-wheel\.yaml:\d+:\d+: limits\.current_A must be a number, found null"):
        load_configuration("my-wheel.yaml")


@pytest.mark.parametrize("out", ["mine.yaml", "link.yaml", "folder", "gone/my.yaml", "a\0b"])
def test_no_file_is_written_over(out: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A file, a dangling link, a folder, a place that is none: one sentence, status 2, and all is as it was."""
    (tmp_path / "mine.yaml").write_text("mine")
    (tmp_path / "link.yaml").symlink_to(tmp_path / "elsewhere")
    (tmp_path / "folder").mkdir()
    assert main(["init", "--port", "/dev/ttyS0", "--out", out]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert (tmp_path / "mine.yaml").read_text() == "mine"
    assert not (tmp_path / "elsewhere").exists()
