"""`rw-ekf status` and `run --resume` on a daemon that is a process of its own: alive, safe, killed, never there."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from rw_ekf.live import published_state
from rw_ekf.settings.load import load_configuration
from rw_ekf.sinks.run_files import state_path
from tests.live.bench import Bench, document_of, driven, program, rw_ekf, served_wheel, wait_for


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    """A wheel on a pty."""
    with served_wheel(tmp_path) as made:
        yield made


def set_heat(bench: Bench, degC: float) -> None:
    """The wheel and what is around it have that temperature from now on."""
    plant = bench.registers.plant
    plant.parameters = plant.parameters._replace(ambient_degC=degC)
    plant.state = plant.state._replace(temperature_degC=degC)


def published(bench: Bench) -> dict[str, Any]:
    """The state file as it is now."""
    (path,) = bench.runs.glob("*.state.json")
    found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return found


def status(config: str) -> tuple[int, dict[str, Any]]:
    done = rw_ekf("status", "--config", config, "--json")
    return done.returncode, document_of(done.stdout)


def test_a_run_from_its_start_to_its_death(bench: Bench) -> None:
    """Never there: 4. TRACKING: 0, with estimate and current. Killed: 4, and since when. As text too."""
    config = str(bench.config())
    code, document = status(config)
    assert (code, document["alive"], document["state"]) == (4, False, None)
    assert "no run of this configuration" in document["reason"]
    with program("run", "--config", config) as daemon:
        wait_for(lambda: bench.runs.is_dir() and any(bench.runs.glob("*.state.json")))
        wait_for(lambda: published(bench)["run_state"] == "TRACKING")
        code, document = status(config)
        assert (code, document["alive"], document["pid"]) == (0, True, daemon.pid)
        assert document["state"] == "TRACKING"
        assert set(document["estimate"]["state"]) == set(document["estimate"]["std"])
        assert document["link"]["requests"] > 0
        stated = rw_ekf("status", "--config", config)
        assert stated.stdout.startswith("TRACKING since ")
        assert re.search(r"^TRACKING since 2\S+Z \(\d+\.\d s after the run's start\) \(process", stated.stdout)
        daemon.kill()
        daemon.wait()
    code, document = status(config)
    assert (code, document["alive"], document["state"]) == (4, False, "TRACKING")
    assert document["dead_since_utc"] is not None
    assert rw_ekf("status", "--config", config).stdout.startswith("dead since ")
    assert rw_ekf("stop", "--config", config).returncode == 0


def test_heat_latches_until_a_person_says_resume(bench: Bench) -> None:
    """SAFE: 3, still zero when cool again, `run --resume` refused while hot and heeded afterwards; the run exits 0."""
    config = str(bench.config())
    with program("run", "--config", config) as daemon:
        wait_for(driven(bench))
        set_heat(bench, 80.0)
        wait_for(lambda: published(bench)["run_state"] == "SAFE")
        code, document = status(config)
        assert (code, document["state"]) == (3, "SAFE")
        assert "limits.temperature_degC" in document["reason"]
        refused = rw_ekf("run", "--resume", "--config", config)
        assert refused.returncode == 1
        assert "stays in SAFE" in refused.stdout
        set_heat(bench, 20.0)
        seen = len(bench.recorder.requests)
        wait_for(lambda: len(bench.recorder.requests) > seen + 30)
        assert all(value == 0.0 for value in bench.recorder.writes_A()[-8:])
        heeded = rw_ekf("run", "--resume", "--config", config, "--json")
        assert (heeded.returncode, document_of(heeded.stdout)["left_safe"]) == (0, True)
        wait_for(driven(bench))
        assert rw_ekf("stop", "--config", config).returncode == 0
        daemon.communicate(timeout=240)
    assert daemon.returncode == 0


def test_a_run_that_ends_in_safe_says_so_in_its_status(bench: Bench) -> None:
    """Stopped while it held zero: exit status 5, and the last word of the dead run is SAFE."""
    config = str(bench.config())
    with program("run", "--config", config, "--json") as daemon:
        wait_for(driven(bench))
        set_heat(bench, 80.0)
        wait_for(lambda: published(bench)["run_state"] == "SAFE")
        assert rw_ekf("stop", "--config", config).returncode == 0
        out, _ = daemon.communicate(timeout=240)
    assert daemon.returncode == 5
    document = document_of(out)
    assert document["state"]["state"] == "SAFE"
    assert any("ended in SAFE" in text for text in document["logs"][0]["warnings"])
    code, reported = status(config)
    assert (code, reported["state"]) == (4, "SAFE")
    assert (
        "not now: speed" in rw_ekf("status", "--config", config).stdout
    )  # and nobody takes the last current for today's
    set_heat(bench, 20.0)
    again = rw_ekf("run", "--config", config, "--duration", "0.3")
    assert "last_run_in_safe" in again.stderr
    assert "last_run_in_safe" not in rw_ekf("run", "--config", config, "--duration", "0.3").stderr


def test_a_state_file_that_is_none_is_not_believed(bench: Bench) -> None:
    """Torn, of another schema, or a directory in its place: nothing is known, and there is no traceback."""
    config = str(bench.config())
    rw_ekf("run", "--config", config, "--duration", "0.3")
    (path,) = bench.runs.glob("*.state.json")
    for content in ("", "{", "[]", '{"schema": "rw_ekf.state/9"}', '{"schema": "rw_ekf.state/1", "pid": "me"}'):
        path.write_text(content, encoding="utf-8")
        done = rw_ekf("status", "--config", config)
        assert done.returncode == 4
        assert "Traceback" not in done.stderr
    path.unlink()
    path.mkdir()
    assert rw_ekf("status", "--config", config).returncode == 4


def test_the_folder_one_stands_in_makes_no_difference(bench: Bench, tmp_path: Path) -> None:
    """A relative output.directory: the run is found from another folder while it lives and when it is dead, for a
    resume too, also where an older run of that configuration has left its files in that folder."""
    config = str(bench.config(output={"directory": "runs"}))
    other = tmp_path / "other"
    other.mkdir()
    assert rw_ekf("run", "--config", config, "--duration", "0.3", cwd=other).returncode == 0
    with program("run", "--config", config, cwd=tmp_path) as daemon:
        wait_for(lambda: bench.runs.is_dir() and any(bench.runs.glob("*.state.json")))
        wait_for(lambda: published(bench)["run_state"] == "TRACKING")
        for folder in (other, tmp_path, Path("/")):
            done = rw_ekf("status", "--config", config, "--json", cwd=folder)
            assert (done.returncode, document_of(done.stdout)["pid"]) == (0, daemon.pid)
        assert "nothing to resume" in rw_ekf("run", "--resume", "--config", config, cwd=other).stdout
        daemon.kill()
        daemon.wait()
    for folder in (other, tmp_path, Path("/")):
        done = rw_ekf("status", "--config", config, "--json", cwd=folder)
        assert (done.returncode, document_of(done.stdout)["pid"]) == (4, daemon.pid)


def test_a_word_of_another_place_is_believed_of_nobody_else(
    bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of other users only one whose daemon has the port is; a link, a relative path, another wheel's file never."""
    monkeypatch.setattr(published_state, "DIRECTORIES", (str(tmp_path),))
    monkeypatch.setattr(published_state, "shared_directory", lambda: tmp_path)
    configuration = load_configuration(bench.config(output={"directory": "runs"}))
    here = state_path(configuration)
    published_state.leave_place(configuration)
    (word,) = tmp_path.glob("*.place")
    assert published_state.published_place(configuration) == here.absolute()
    monkeypatch.setattr("os.geteuid", lambda: 4711)
    os.chown(word, 4712, -1) if os.getuid() == 0 else pytest.skip("files of another user take root")
    assert published_state.published_place(configuration) == here
    assert published_state.published_place(configuration, [4712]) == here.absolute()
    os.chown(word, 4711, -1)
    for content in ("runs", "/tmp/other.state.json", str(here), ""):
        word.write_text(content, encoding="utf-8")
        assert published_state.published_place(configuration) == here
    word.rename(tmp_path / "kept")
    word.symlink_to(tmp_path / "kept")
    assert published_state.published_place(configuration) == here
