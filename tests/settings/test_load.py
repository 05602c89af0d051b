"""The configuration: defaults, mistakes, paths, and the resolved listing."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from pydantic import ValidationError

from rw_ekf.checking.yaml_loader import load_yaml, parse_yaml
from rw_ekf.control.profiles import PROFILE_NAMES, make_profile
from rw_ekf.errors import ConfigError
from rw_ekf.settings.load import configuration_from, load_configuration, resolved_lines
from rw_ekf.settings.resources import config_directory, config_resource
from rw_ekf.settings.schema import CommandSection, Configuration

LEAST = "wheel: {port: /dev/ttyUSB0, protocol: ./map.yaml}\nlimits: {current_A: 0.6}\n"


def load(tmp_path: Path, text: str) -> Configuration:
    (tmp_path / "map.yaml").write_text("registers: {}\n")
    path = tmp_path / "wheel.yaml"
    path.write_text(text)
    return load_configuration(path)


def findings(tmp_path: Path, text: str) -> list[str]:
    with pytest.raises(ConfigError) as caught:
        load(tmp_path, text)
    assert caught.value.exit_status == 2
    return [finding.removeprefix(f"{tmp_path}/") for finding in caught.value.findings]


def test_a_log_given_for_a_configuration_is_not_printed(tmp_path: Path) -> None:
    """A file without any key is one long text to YAML: its length and its begin are told."""
    (found,) = findings(tmp_path, "time_s,speed_rad_s\n" + "0.1,2.5\n" * 20_000)
    assert "characters that begins 'time_s,speed_rad_s 0.1,2.5" in found
    assert len(found) < 400


def test_everything_but_port_and_current_limit_has_a_default(tmp_path: Path) -> None:
    """Proves the defaults of the contract."""
    configuration = load(tmp_path, LEAST)
    assert configuration.wheel.inertia_kg_m2 == 1.5e-3
    assert configuration.wheel.stribeck_speed_rpm == 4.0
    assert configuration.limits.silence_s == 0.5
    assert configuration.loop.rate_hz == 10.0
    assert configuration.loop.reply_timeout_ms == 40.0
    assert configuration.filter.model is None
    assert configuration.command.profile == "sine"
    assert configuration.output.directory == "runs"
    assert configuration.simulation.effects == ()


def test_an_empty_section_is_the_same_as_none(tmp_path: Path) -> None:
    """Proves that `loop:` with nothing under it takes the defaults."""
    assert load(tmp_path, LEAST + "loop:\noutput:\n") == load(tmp_path, LEAST)


def test_a_configuration_cannot_be_changed(tmp_path: Path) -> None:
    """Proves that nothing can raise a limit after loading."""
    configuration = load(tmp_path, LEAST)
    with pytest.raises(ValidationError):
        configuration.limits.current_A = 5.0  # type: ignore[misc]


def test_required_keys_say_what_they_are(tmp_path: Path) -> None:
    """Proves that the current limit has no default and says so in plain words."""
    found = findings(tmp_path, "wheel: {protocol: ./map.yaml}\nlimits:\n  speed_rpm: 4200\n")
    assert found[0].startswith("wheel.yaml:1:1: wheel.port is required: serial port")
    assert found[1] == (
        "wheel.yaml:2:1: limits.current_A is required: the largest current ever commanded [A]; there is no default"
    )


def test_a_missing_section_names_its_required_key(tmp_path: Path) -> None:
    """Proves that a file without limits is refused."""
    assert "limits.current_A is required" in findings(tmp_path, "wheel: {port: x, protocol: ./map.yaml}\n")[0]


@pytest.mark.parametrize(
    ("extra", "place", "words"),
    [
        ("loop: {rate_hs: 10}", "3:8", "unknown key loop.rate_hs; did you mean 'rate_hz'?"),
        ("lop: {}", "3:1", "unknown section lop; did you mean 'loop'?"),
        ("loop: {rate_hz: fast}", "3:17", "loop.rate_hz must be a number, found the text 'fast'"),
        ("loop: {rate_hz: true}", "3:17", "loop.rate_hz must be a number, found true"),
        ("loop: {rate_hz: [1]}", "3:17", "loop.rate_hz must be a number, found a list"),
        ("loop: {rate_hz: null}", "3:17", "loop.rate_hz must be a number, found null"),
        ("loop: {rate_hz: 0}", "3:17", "loop.rate_hz must be at least 0.1, found 0"),
        ("loop: 10", "3:7", "loop must be a table of keys, found 10"),
        ("command: {seed: 1.5}", "3:17", "command.seed must be a whole number, found 1.5"),
        ("command: {profile: snie}", "3:20", "did you mean 'sine'?"),
        ("output: {directory: 7}", "3:21", "output.directory must be text, found 7"),
        ("output: {directory: ''}", "3:21", "output.directory must not be empty"),
        ("filter: {prior: {viscus: {value: 1, std: 1}}}", "3:18", "did you mean 'viscous'?"),
        ("filter: {prior: {viscous: {value: 1}}}", "3:18", "filter.prior.viscous.std is required"),
        ("filter: {model: gone.yaml}", "3:17", "filter.model: no such file"),
        ("filter: {model: ~nobody.of.that.name/m.yaml}", "3:17", "filter.model: no such file"),
        (f"filter: {{model: {'long' * 100}.yaml}}", "3:17", "filter.model: no such file"),
        ('filter: {model: "nul\\0.yaml"}', "3:17", "filter.model: no such file"),
        ("filter: {gate_probability: 1.0}", "3:28", "must be below 1, found 1"),
        ("simulation: {effects: [quadratic drag]}", "3:24", "write an effect as ID:name=value"),
        ("simulation: {effects: 3}", "3:23", "simulation.effects must be a list, found 3"),
        ("command: {profile: log}", "3:20", "command.log is required"),
        ("command: {log: map.yaml}", "3:16", "command.log is given but command.profile is sine"),
        ("command: {profile: log, log: gone.csv}", "3:30", "command.log: no such file"),
        ("output: {plotjuggler: 'a b'}", "3:23", "write HOST:PORT, such as"),
        (
            "output: {plotjuggler: '127.0.0.1:70000'}",
            "3:23",
            "the port must be a number up to 65535",
        ),
        ("output: {prometheus: '[::1]:99999'}", "3:22", "the port must be a number up to 65535"),
        ("output: {mqtt: 'mqtt://127.0.0.1:99999/t'}", "3:16", "the port must be a number up to 65535"),
        ("output: {influx: 'udp://127.0.0.1:99999'}", "3:18", "the port must be a number up to 65535"),
        ("output: {influx: 'http://127.0.0.1:99999/x'}", "3:18", "the port must be a number up to 65535"),
        ("output: {influx: 'https://me:it@[::1]:x/y:1'}", "3:18", "the port must be a number up to 65535"),
        ("loop: {rate_hz: 1}", "2:1", "limits.silence_s 0.5 s must exceed one loop period, 1 s"),
        ("loop: {reply_timeout_ms: 100}", "3:26", "must be below one loop period, 100 ms"),
    ],
)
def test_mistakes_name_place_key_and_remedy(tmp_path: Path, extra: str, place: str, words: str) -> None:
    """Proves that each kind of mistake gives exactly one finding with file:line:column and the dotted key."""
    found = findings(tmp_path, LEAST + extra + "\n")
    assert len(found) == 1, found
    assert found[0].startswith(f"wheel.yaml:{place}: ")
    assert words in found[0]


@pytest.mark.parametrize(
    "place",
    [
        "influx: 'http://me:it@h/write?bucket=a:70000'",
        "influx: 'udp://[::1]:65535'",
        "influx: file",
        "mqtt: 'mqtt://h:1/t:70000'",
    ],
)
def test_a_port_that_there_is_is_taken(tmp_path: Path, place: str) -> None:
    """The largest, none, and a colon that stands before no port."""
    load(tmp_path, f"{LEAST}output: {{{place}}}\n")


def test_all_mistakes_are_told_at_once_in_the_order_of_the_file(tmp_path: Path) -> None:
    """Proves that mistakes in several sections, and between sections, come together."""
    text = "wheel: {prt: x, protocol: ./map.yaml}\nlimits: {current_A: 0.1}\ncommand: {amplitude_A: 0.2}\n"
    text += "loop: {rate_hz: no}\n"
    found = findings(tmp_path, text)
    assert [line.split(": ")[0] for line in found] == [
        "wheel.yaml:1:1", "wheel.yaml:1:9", "wheel.yaml:3:24", "wheel.yaml:4:17"
    ]  # fmt: skip


def test_a_command_beyond_the_limit_names_both_keys(tmp_path: Path) -> None:
    """Proves that amplitude plus bias is held against limits.current_A, for the profiles that use them only."""
    text = "wheel: {port: x, protocol: ./map.yaml}\nlimits: {current_A: 0.2}\n"
    found = findings(tmp_path, text + "command: {amplitude_A: 0.15, bias_A: -0.1}\n")
    assert "command.amplitude_A 0.15 A plus |command.bias_A| 0.1 A is 0.25 A" in found[0]
    assert "limits.current_A 0.2 A" in found[0]
    load(tmp_path, text + "command: {profile: zero, amplitude_A: 5.0}\n")


def test_an_unknown_protocol_lists_the_shipped_ones(tmp_path: Path) -> None:
    """Proves that a wrong protocol name is found before the port is opened."""
    found = findings(tmp_path, "wheel: {port: x, protocol: sunspce}\nlimits: {current_A: 0.6}\n")
    assert found[0].startswith(
        "wheel.yaml:1:28: wheel.protocol: no shipped wire map is called 'sunspce'; give a path, or one of: "
    )
    assert "sunspace-wheel" in found[0]
    assert "example" not in found[0]


def test_paths_of_input_files_are_relative_to_the_configuration(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Proves that a configuration works from any directory, and that runs go to the working directory."""
    (tmp_path / "model.yaml").write_text("x: 1\n")
    monkeypatch.chdir("/")
    configuration = load(tmp_path, LEAST + "filter: {model: model.yaml}\n")
    assert configuration.filter.model == str(tmp_path / "model.yaml")
    assert Path(configuration.wheel.protocol) == tmp_path / "map.yaml"
    assert configuration.output.directory == "runs"


def test_a_configuration_that_is_no_table_is_refused() -> None:
    """Proves that a bare list or text is one finding."""
    with pytest.raises(ConfigError, match="must be a table of sections, found a list"):
        configuration_from(parse_yaml("[1, 2]", "f.yaml"))


def test_the_resolved_listing_marks_defaults_and_reads_back(tmp_path: Path) -> None:
    """Proves that check-config's listing is itself a configuration with the same values."""
    configuration = load(tmp_path, LEAST + 'simulation: {effects: ["a:b=1"]}\nloop: {rate_hz: 5}\n')
    text = resolved_lines(configuration, load_yaml(tmp_path / "wheel.yaml"))
    assert "  slew_A_per_s: 5.0  # default: fastest change of the commanded current [A/s]" in text
    assert "  rate_hz: 5.0  # cycles per second [Hz]" in text
    (tmp_path / "again.yaml").write_text(text)
    assert load_configuration(tmp_path / "again.yaml") == configuration


def test_every_profile_of_the_schema_can_be_made() -> None:
    """Proves that configuration and excitation know the same profiles; log and none are not excitations."""
    names = set(CommandSection.model_fields["profile"].annotation.__args__)  # type: ignore[union-attr]
    assert names == {*PROFILE_NAMES, "log", "none"}
    assert all(make_profile(name).name == name for name in PROFILE_NAMES)


@pytest.mark.parametrize("name", ["example", "simulated"])
def test_the_shipped_examples_are_valid(name: str) -> None:
    """Proves that what a user copies first passes check-config."""
    load_configuration(config_directory() / f"{name}.yaml")


def test_settings_import_nothing_heavy() -> None:
    """Proves that `rw-ekf stop` does not wait for numerical libraries."""
    code = (
        "import sys, rw_ekf.settings.load, rw_ekf.control.profiles;"
        "print([m for m in ('numpy', 'scipy', 'pyarrow', 'numba') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_a_wire_map_in_a_configuration_s_place_is_told_from_it() -> None:
    """One sentence, and no list of sections that a map does not have."""
    with pytest.raises(ConfigError, match="this is a wire map, no configuration"):
        load_configuration(config_resource("ascii-wheel"))
