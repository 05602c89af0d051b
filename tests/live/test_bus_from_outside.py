"""A line of four wheels from outside: processes of the program on a real tty, and what the wheels were sent."""

from __future__ import annotations

import json
import os
import signal
import urllib.request
from pathlib import Path
from typing import Any

import pytest

from rw_ekf.cli import main
from tests.live.bench import document_of, program, rw_ekf, wait_for
from tests.live.bus import FAMILIES, NAMES, BusBench, put, served_bus

LONG_S = 60.0


def states(bench: BusBench) -> dict[str, str]:
    """By wheel what its state file says."""
    found = {}
    for path in (bench.path.parent / "runs").glob("*.state.json"):
        document: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        found[document["wheel"]] = document["run_state"]
    return found


def is_driven(bench: BusBench, name: str) -> bool:
    """Whether a wheel carries a current."""
    return abs(bench[name].electronics.command_A) > 0.01


@pytest.mark.slow
@pytest.mark.parametrize("family", FAMILIES)
def test_one_dead_from_the_start_and_one_that_dies_come_back_while_the_others_are_driven(
    family: str, tmp_path: Path
) -> None:
    """Over a pty with echo: each wheel's log, state and zero; two are away and come by themselves; SIGTERM ends all."""
    with served_bus(tmp_path, family, "echo,rw-z=dead") as bench:
        config = str(bench.path)
        with program("run", "--config", config, "--json") as run:
            wait_for(lambda: all(is_driven(bench, name) for name in ("rw-x", "rw-y", "rw-skew")), LONG_S)
            wait_for(lambda: list(states(bench).values()).count("TRACKING") == 3, LONG_S)
            assert main(["status", "--config", config]) == 3  # one has not answered
            put(bench, "rw-z", "")
            put(bench, "rw-y", "dead")
            wait_for(lambda: is_driven(bench, "rw-z") and states(bench)["rw-y"] == "LOST", LONG_S)
            put(bench, "rw-y", "")
            wait_for(lambda: is_driven(bench, "rw-y"), LONG_S)
            reported: list[dict[str, Any]] = []
            tracked: set[str] = set()

            def each_was_reported_to_track() -> bool:
                """Not at one time: a busy machine misses a reading of one now and then."""
                reported[:] = document_of(rw_ekf("status", "--config", config, "--json").stdout)["wheels"]
                tracked.update(wheel["wheel"] for wheel in reported if wheel["state"] == "TRACKING")
                return tracked == set(NAMES)

            wait_for(each_was_reported_to_track, LONG_S)
            assert [wheel["wheel"] for wheel in reported] == list(NAMES)
            assert all(wheel["link"]["echoes_lost"] <= wheel["link"]["timeouts"] for wheel in reported)
            seen = rw_ekf("watch", "--config", config, "--once").stdout
            assert all(f"{name} on" in seen for name in NAMES)
            run.send_signal(signal.SIGTERM)
            out, errors = run.communicate(timeout=LONG_S)
        assert run.returncode == 0, errors
        document = document_of(out)
        for wheel in document["wheels"]:
            name, ran = wheel["wheel"], wheel["run"]
            assert ran["stopped_by"] == "SIGTERM"
            assert ran["loop"]["ticks"] > 0
            assert bench[name].electronics.command_A == 0.0
            assert bench[name].currents_A[-1] == 0.0
            assert ran["link"]["damaged"] <= ran["link"]["timeouts"]  # of a busy machine: one that came late is cut
        away = {wheel["wheel"]: wheel["run"]["link"]["timeouts"] for wheel in document["wheels"]}
        assert away["rw-y"] > away["rw-x"]
        assert len({wheel["run"]["logs"][0]["log"] for wheel in document["wheels"]}) == len(NAMES)


@pytest.mark.slow
def test_stop_ends_the_process_and_zeroes_every_wheel_that_lives(tmp_path: Path) -> None:
    """With all alive it confirms; with one dead it says which did not, and the others are at zero all the same."""
    with served_bus(tmp_path) as bench:
        config = str(bench.path)
        for dead, status in (("", 0), ("rw-z", 1)):
            with program("run", "--config", config) as run:
                wait_for(lambda: all(is_driven(bench, name) for name in NAMES), LONG_S)
                if dead:
                    put(bench, dead, "dead")
                done = rw_ekf("stop", "--config", config, *(["--json"] if not dead else []))
                run.communicate(timeout=LONG_S)
            assert done.returncode == status, done.stderr
            if not dead:
                assert document_of(done.stdout)["zero_confirmed"]
            else:
                assert "of several wheels not rw-z confirmed it" in done.stderr
            for name in NAMES:
                if name != dead:
                    assert bench[name].electronics.command_A == 0.0
                    assert bench[name].currents_A[-1] == 0.0


@pytest.mark.slow
def test_a_word_to_resume_is_for_the_wheel_that_was_named(tmp_path: Path) -> None:
    """Two wheels latch for heat and cool down: the one that is named is driven again, the other holds zero.

    The signal of a wheel alone, which names nobody, frees none; a word without a name is refused.
    """
    with served_bus(tmp_path) as bench, program("run", "--config", str(bench.path)) as run:
        wait_for(lambda: all(is_driven(bench, name) for name in NAMES), LONG_S)
        for degC in (80.0, 20.0):
            for name in ("rw-y", "rw-z"):
                plant = bench[name].electronics.plant
                plant.parameters = plant.parameters._replace(ambient_degC=degC)
                plant.state = plant.state._replace(temperature_degC=degC)
            wait_for(
                lambda: [states(bench)[name] for name in NAMES] == ["TRACKING", "SAFE", "SAFE", "TRACKING"], LONG_S
            )
        counts = {name: len(bench[name].written) for name in NAMES}
        run.send_signal(signal.SIGUSR1)
        nameless = rw_ekf("run", "--resume", "--config", str(bench.path))
        assert nameless.returncode == 2
        assert f"--wheel NAME, of {', '.join(NAMES)}" in nameless.stderr
        wait_for(lambda: all(len(bench[name].written) > counts[name] + 10 for name in NAMES), LONG_S)
        for name in ("rw-y", "rw-z"):
            assert set(bench[name].currents_A[counts[name] :]) == {0.0}
        done = rw_ekf("run", "--resume", "--config", str(bench.path), "--wheel", "rw-y", "--json")
        assert (done.returncode, document_of(done.stdout)["left_safe"]) == (0, True)
        wait_for(lambda: is_driven(bench, "rw-y") and states(bench)["rw-y"] == "TRACKING", LONG_S)
        assert set(bench["rw-z"].currents_A[counts["rw-z"] :]) == {0.0}
        assert states(bench)["rw-z"] == "SAFE"
        run.send_signal(signal.SIGTERM)
        run.communicate(timeout=LONG_S)
    assert {bench[name].electronics.command_A for name in NAMES} == {0.0}


@pytest.mark.slow
def test_one_wheel_of_a_line_that_runs_alone_hears_no_word_for_another(tmp_path: Path) -> None:
    """`run --wheel rw-x` latches; a word for rw-y of the same file is told to nobody, and said to be so."""
    with served_bus(tmp_path) as bench, program("run", "--config", str(bench.path), "--wheel", "rw-x") as run:
        wait_for(lambda: is_driven(bench, "rw-x"), LONG_S)
        plant = bench["rw-x"].electronics.plant
        for degC in (80.0, 20.0):
            plant.parameters = plant.parameters._replace(ambient_degC=degC)
            plant.state = plant.state._replace(temperature_degC=degC)
            wait_for(lambda: states(bench)["rw-x"] == "SAFE", LONG_S)
        count = len(bench["rw-x"].written)
        other = rw_ekf("run", "--resume", "--config", str(bench.path), "--wheel", "rw-y")
        assert other.returncode == 1
        assert "publishes nothing of rw-y here, and was told nothing" in other.stdout
        wait_for(lambda: len(bench["rw-x"].written) > count + 10, LONG_S)  # it knows that it has cooled down
        assert set(bench["rw-x"].currents_A[count:]) == {0.0}
        own = rw_ekf("run", "--resume", "--config", str(bench.path), "--wheel", "rw-x")
        assert own.returncode == 0, own.stdout
        run.send_signal(signal.SIGTERM)
        run.communicate(timeout=LONG_S)


@pytest.mark.slow
def test_the_page_of_a_line_shows_every_wheel_and_stops_all(tmp_path: Path) -> None:
    """`run --view`: a run of each wheel, one of them in a folder of its own; the button's word ends it, at zero."""
    elsewhere = {"rw-z": {"output": {"directory": str(tmp_path / "elsewhere")}}}
    with served_bus(tmp_path, wheels=elsewhere) as bench:
        with program("run", "--config", str(bench.path), "--view", "127.0.0.1:0") as run:
            assert run.stderr is not None
            address, _, token = next(line for line in run.stderr if "#token=" in line).strip().partition("#token=")
            wait_for(lambda: all(is_driven(bench, name) for name in NAMES), LONG_S)
            with urllib.request.urlopen(f"{address}api/runs", timeout=LONG_S) as answer:
                reported = json.loads(answer.read())
            assert {name.partition("Z_")[2] for name in reported["runs"]} == set(NAMES)
            assert reported["wheels"] == len(NAMES)
            request = urllib.request.Request(f"{address}api/stop", method="POST", headers={"x-token": token})
            with urllib.request.urlopen(request, timeout=LONG_S) as answer:
                assert json.loads(answer.read())["zero_confirmed"]
            run.communicate(timeout=LONG_S)
        assert run.returncode == 0
        assert {bench[name].electronics.command_A for name in NAMES} == {0.0}


@pytest.mark.slow
def test_a_supervisor_zeroes_every_wheel_of_a_daemon_that_was_killed(tmp_path: Path) -> None:
    """On a line, row 27: SIGKILL to the daemon: zero to each wheel, then it drives them again; SIGTERM ends both."""
    with served_bus(tmp_path) as bench:
        with program("run", "--supervise", "--config", str(bench.path)) as run:
            wait_for(lambda: all(is_driven(bench, name) for name in NAMES), LONG_S)
            counts = {name: len(bench[name].written) for name in NAMES}
            (pid,) = {
                json.loads(path.read_text(encoding="utf-8"))["pid"]
                for path in (bench.path.parent / "runs").glob("*.state.json")
            }
            os.kill(pid, signal.SIGKILL)
            for name in NAMES:
                wait_for(lambda name=name: 0.0 in bench[name].currents_A[counts[name] :], LONG_S)  # type: ignore[misc]
            wait_for(lambda: all(is_driven(bench, name) for name in NAMES), LONG_S)
            run.send_signal(signal.SIGTERM)
            _, errors = run.communicate(timeout=LONG_S)
        assert run.returncode == 0, errors
        assert "daemon_died" in errors
        assert {bench[name].electronics.command_A for name in NAMES} == {0.0}


@pytest.mark.slow
def test_simulate_plays_the_shipped_line_and_its_faults(tmp_path: Path) -> None:
    """`simulate --config bus` and `run --config bus` as they are documented, from two processes, one wheel dead."""
    text = Path(__file__).parents[2].joinpath("config", "bus.yaml").read_text(encoding="utf-8")
    config, link = tmp_path / "bus.yaml", tmp_path / "line"
    config.write_text(text.replace("/tmp/bus ", f"{link} "), encoding="utf-8")
    faults = "echo,rw-y=dead"
    with program(
        "simulate", "--config", str(config), "--link", str(link), "--fault", faults, "--json", cwd=tmp_path
    ) as sim:
        assert sim.stdout is not None
        text = ""
        while not text.endswith("\n}\n"):
            text += sim.stdout.readline()
        reported = document_of(text)
        assert reported["faults"] == ["echo"]
        assert [wheel["wheel"] for wheel in reported["wheels"] if wheel["faults"]] == ["rw-y"]
        done = rw_ekf("run", "--config", str(config), "--duration", "6", "--json", cwd=tmp_path)
        alone = rw_ekf("run", "--config", str(config), "--wheel", "rw-z", "--duration", "2", "--json", cwd=tmp_path)
        sim.send_signal(signal.SIGTERM)
        sim.communicate(timeout=LONG_S)
    assert "_rw-z" in document_of(alone.stdout)["logs"][0]["log"]  # one of them as if it stood alone
    document = document_of(done.stdout)
    assert done.returncode == 1  # one wheel never answered, and that is said
    assert {wheel["wheel"]: wheel["run"] is None for wheel in document["wheels"]} == {
        "rw-x": False,
        "rw-y": True,
        "rw-z": False,
        "rw-skew": False,
    }


@pytest.mark.parametrize(
    ("fault", "stated"),
    [
        ("rw-y=drop", "drop is a fault of the line, which all wheels share: leave rw-y= out"),
        ("nobody=dead", "there is no fault 'nobody=dead'"),
    ],
)
def test_a_fault_of_a_wheel_that_is_none_is_named(fault: str, stated: str, capsys: pytest.CaptureFixture[str]) -> None:
    """A line's fault cannot be one wheel's, and a name must be one of the configuration's."""
    assert main(["simulate", "--config", "bus", "--link", "nowhere", "--fault", fault]) == 2
    assert stated in capsys.readouterr().err
