"""The files shipped in config/, and the documentation of the keys."""

from __future__ import annotations

from pathlib import Path

import pytest

from rw_ekf.cli import main
from rw_ekf.errors import ConfigError
from rw_ekf.settings import resources
from rw_ekf.settings.load import _yaml_value, load_configuration, load_configurations
from rw_ekf.settings.schema import SECTIONS
from rw_ekf.settings.stop_settings import read_line

ROOT = Path(__file__).resolve().parents[2]


def test_a_shipped_file_is_found_with_and_without_its_suffix() -> None:
    """Proves that both spellings name the same file."""
    assert resources.config_resource("example") == resources.config_resource("example.yaml")


@pytest.mark.parametrize("name", ["nothing", "../pyproject", "sub/example"])
def test_an_unknown_name_lists_what_there_is(name: str) -> None:
    """Proves that a wrong name, or one that leaves the directory, is refused with the available ones."""
    with pytest.raises(ConfigError, match=r"available: .*example"):
        resources.config_resource(name)


@pytest.mark.parametrize("name", [*resources.CONFIGURATIONS, "simulated.yaml"])
def test_a_shipped_configuration_is_read_by_its_name(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Proves that every verb's ways to a configuration know the shipped ones in an empty folder, `stop`'s too."""
    monkeypatch.chdir(tmp_path)
    assert load_configurations(name) == read_line(name).wheels
    assert main(["check-config", name]) == 0


def test_a_file_here_comes_before_a_shipped_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Proves that a file of the name wins, with its suffix left out too, and that a folder of the name does not."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "simulated").mkdir()
    assert load_configuration("simulated").wheel.port == "/tmp/wheel0"
    (tmp_path / "simulated.yaml").write_text("wheel: {port: /dev/mine}\nlimits: {current_A: 0.1}\n")
    for name in ("simulated", "simulated.yaml"):
        assert load_configuration(name).wheel.port == "/dev/mine"


@pytest.mark.parametrize("name", ["my-wheel.yaml", "columns-emps", ""])
def test_a_configuration_that_is_nowhere_is_told_what_there_is(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Proves that a bare name which is no file, no shipped configuration, or nothing, ends in one sentence."""
    assert main(["status", "--config", name]) == 2
    assert capsys.readouterr().err.endswith("no such file here, and the program ships example, simulated, bus\n")


def test_an_installed_package_carries_its_own_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Proves that rw_ekf/_config is used where it exists, and that a stray config/ beside the package is not."""
    package = tmp_path / "site-packages" / "rw_ekf"
    (package / "_config").mkdir(parents=True)
    (package / "_config" / "wheel.yaml").write_text("a: 1\n")
    (tmp_path / "site-packages" / "config").mkdir()
    monkeypatch.setattr(resources, "_PACKAGE", package)
    assert resources.available_resources() == ["wheel"]
    (package / "_config" / "wheel.yaml").unlink()
    (package / "_config").rmdir()
    with pytest.raises(ConfigError, match="install the package again"):
        resources.config_resource("wheel")


def test_a_protocol_is_a_name_or_a_path(tmp_path: Path) -> None:
    """Proves that a user's own wire map is taken by path, and a missing one is named."""
    own = tmp_path / "own.yaml"
    own.write_text("a: 1\n")
    assert resources.protocol_path(str(own)) == own
    with pytest.raises(ConfigError, match="no such wire map"):
        resources.protocol_path(str(tmp_path / "gone.yaml"))


def test_every_key_is_documented_with_its_default() -> None:
    """Proves that docs/configuration.md has a row for each key of the schema, with meaning and default."""
    text = (ROOT / "docs" / "configuration.md").read_text()
    for section, model in SECTIONS.items():
        assert f"## {section}" in text
        for key, info in model.model_fields.items():
            row = next((line for line in text.splitlines() if line.startswith(f"| `{section}.{key}` |")), None)
            assert row is not None, f"{section}.{key} has no row"
            assert (info.description or "").replace("|", "/") in row, row
            shown = (
                "required" if info.is_required() else f"`{_yaml_value(info.get_default(call_default_factory=True))}`"
            )
            assert f"| {shown} |" in row, row
