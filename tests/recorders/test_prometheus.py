"""/metrics: what Prometheus's own parser makes of it, what a hostile client costs, what the shipped files ask for."""

from __future__ import annotations

import errno
import json
import re
import socket
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.error import HTTPError
from urllib.request import urlopen

import pytest
import yaml

from rw_ekf.errors import BadInputError
from rw_ekf.records import CompensationNow, LinkState, ParameterFlags
from rw_ekf.settings.resources import config_directory
from tests.recorders.ticks import ALARM, recorder, turn, until


@pytest.fixture
def served(tmp_path: Path) -> Iterator[tuple[Any, Any, int]]:
    """A recorder that listens, its run, its port."""
    sink, run = recorder(tmp_path, "prometheus", "127.0.0.1:0")
    yield sink, run, sink._server.had.port
    sink.close()


def fetched(port: int, path: str = "/metrics") -> str:
    with urlopen(f"http://127.0.0.1:{port}{path}", timeout=10) as answer:
        assert answer.headers["Content-Type"].startswith("text/plain; version=0.0.4")
        return str(answer.read().decode())


def parsed(text: str) -> dict[str, float]:
    """Samples by name and labels, as prometheus_client reads them."""
    parser = pytest.importorskip("prometheus_client.parser")
    found: dict[str, float] = {}
    for family in parser.text_string_to_metric_families(text):
        assert family.documentation
        assert family.type in ("gauge", "counter", "histogram"), family.name
        for sample in family.samples:
            labels = ",".join(f"{key}={value}" for key, value in sorted(sample.labels.items()))
            assert f"{sample.name}{{{labels}}}" not in found
            found[f"{sample.name}{{{labels}}}"] = sample.value
    return found


def test_the_page_says_what_the_run_is(served: tuple[Any, Any, int]) -> None:
    """Estimate with sigma, enum of the state, alarms, counters of samples and line, histogram of lateness."""
    sink, run, port = served
    run.link().requests = 7
    for late_s in (0.0001, 0.003, 0.003, 7.0):
        run.timing.note(late_s)
    run.unwritten.not_sent["mqtt"] = 3
    for i in range(5):
        sink.write(turn(i, *([ALARM] if i in (1, 2) else [])))
    sink.write(turn(5, speed_rad_s=None))
    found = parsed(fetched(port))
    assert found["rw_ekf_speed_radians_per_second{}"] == pytest.approx(1 / 6)
    assert found["rw_ekf_coulomb_friction_sigma_radians_per_second_squared{}"] == 0.04
    assert found["rw_ekf_current_command_amperes{}"] == pytest.approx(0.05)
    assert "rw_ekf_measured_speed_radians_per_second{}" not in found  # the last turn had none
    states = {key: value for key, value in found.items() if key.startswith("rw_ekf_run_state")}
    assert states.pop("rw_ekf_run_state{state=TRACKING}") == 1.0
    assert set(states.values()) == {0.0}
    assert len(states) == 4
    assert found["rw_ekf_samples_total{outcome=updated}"] == 5.0
    assert found["rw_ekf_samples_total{outcome=missing}"] == 1.0
    assert (found["rw_ekf_alarm_active{alarm=drag_spike}"], found["rw_ekf_alarms_total{alarm=drag_spike}"]) == (
        0.0,
        1.0,
    )
    assert found["rw_ekf_loop_late_seconds_bucket{le=0.0005}"] == 1.0
    assert found["rw_ekf_loop_late_seconds_bucket{le=0.005}"] == 3.0
    assert found["rw_ekf_loop_late_seconds_bucket{le=1.0}"] == 3.0
    assert found["rw_ekf_loop_late_seconds_bucket{le=+Inf}"] == found["rw_ekf_loop_late_seconds_count{}"] == 4.0
    assert found["rw_ekf_loop_late_seconds_sum{}"] == pytest.approx(7.0061)
    assert found["rw_ekf_sink_missed_ticks_total{sink=mqtt}"] == 3.0
    assert found["rw_ekf_last_sample_timestamp_seconds{}"] == pytest.approx(run.clock.utc().timestamp(), abs=1.0)


def test_odd_names_are_escaped(tmp_path: Path) -> None:
    """Strokes, quotes and newlines in a label come back as they were."""
    from dataclasses import replace

    from rw_ekf.sinks.recorders.prometheus import PrometheusRecorder

    first, run = recorder(tmp_path, "prometheus", "127.0.0.1:0")
    first.close()
    name = 'a "b"\\n\\c\nd'
    sink = PrometheusRecorder(replace(run, wheel=name))
    parser = pytest.importorskip("prometheus_client.parser")
    families = {family.name: family for family in parser.text_string_to_metric_families(sink.page())}
    assert families["rw_ekf_run_info"].samples[0].labels["wheel"] == name
    sink.close()


def test_who_stalls_floods_or_wanders_costs_nobody_else(served: tuple[Any, Any, int]) -> None:
    """Twenty silent clients, one of a request without end, one that reads nothing: the page comes; no other does."""
    sink, _, port = served
    sink.write(turn(0))
    held = [socket.create_connection(("127.0.0.1", port)) for _ in range(22)]
    held[0].sendall(b"GET /metrics HTTP/1.1\r\n" + b"x: y\r\n" * 5000)
    held[1].sendall(b"GET /metrics HTTP/1.1\r\n\r\n")
    assert "rw_ekf_speed_radians_per_second" in fetched(port)
    for path in ("/", "/metrics/../../etc/passwd", "/%2e%2e/%2e%2e/etc/passwd"):
        with pytest.raises(HTTPError, match="404"):
            fetched(port, path)
    with pytest.raises(HTTPError, match="405"):
        urlopen(f"http://127.0.0.1:{port}/metrics", data=b"x", timeout=10)
    with socket.create_connection(("127.0.0.1", port)) as odd:
        odd.sendall(b"\x16\x03\x01\xff\xfe\r\n\r\n")
        assert b"405" in odd.recv(100)
    for one in held[2:]:
        one.settimeout(10.0)
        assert one.recv(1) == b""  # let go of after seconds
    for one in held:
        one.close()
    assert "rw_ekf_speed_radians_per_second" in fetched(port)


def test_a_place_that_is_taken_is_bad_input(tmp_path: Path) -> None:
    """One sentence with the key and the place."""
    with socket.create_server(("127.0.0.1", 0)) as taken:
        place = f"127.0.0.1:{taken.getsockname()[1]}"
        with pytest.raises(BadInputError, match=rf"output.prometheus: {place} cannot be listened at \(Address already"):
            recorder(tmp_path, "prometheus", place)


def test_an_address_that_no_interface_has_yet_is_waited_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As at boot: the run goes on, it is said once, and the page is there once the address is; a close ends it."""
    monkeypatch.setattr("rw_ekf.sinks.recorders.late_place._TRY_EVERY_S", 0.01)
    listen, tried, up = socket.create_server, [], threading.Event()

    def create_server(address: tuple[str, int], **options: Any) -> socket.socket:
        tried.append(address)
        if not up.is_set():
            raise OSError(errno.EADDRNOTAVAIL, "Cannot assign requested address")
        return listen(("127.0.0.1", 0), **options)

    monkeypatch.setattr(socket, "create_server", create_server)
    sink, run = recorder(tmp_path, "prometheus", "192.0.2.7:9464")
    other, _ = recorder(tmp_path / "other", "prometheus", "192.0.2.8:9464")
    sink.write(turn(0))
    until(lambda: tried.count(("192.0.2.7", 9464)) > 3 and ("192.0.2.8", 9464) in tried)
    other.close()
    up.set()
    assert "rw_ekf_speed_radians_per_second" in fetched(until(lambda: sink._server.had).port)
    until(lambda: run.logger.events == ["recorder_waits", "metrics"])
    assert other._server.had is None
    sink.close()
    sink.close()


def wanted_for(name: str) -> set[str]:
    """Names of metrics in the expressions of a shipped file."""
    text = (config_directory() / name).read_text()
    if name.endswith(".json"):
        expressions = [target["expr"] for panel in json.loads(text)["panels"] for target in panel["targets"]]
    else:
        groups = yaml.safe_load(text)["groups"]
        expressions = [rule["expr"] for group in groups for rule in group["rules"]]
    assert len(expressions) > 7
    return {metric for expression in expressions for metric in re.findall(r"\brw_ekf_\w+", expression)}


@pytest.mark.parametrize("name", ["grafana-dashboard.json", "prometheus-rules.yml"])
def test_every_metric_of_a_shipped_file_is_served(served: tuple[Any, Any, int], name: str) -> None:
    """The dashboard and the rules of alerts ask for nothing that a run does not say."""
    from dataclasses import replace

    sink, run, port = served
    run.unwritten.not_sent["mqtt"] = 1
    tick = turn(1, ALARM)
    flags = ParameterFlags(True, True, False, False)
    now = CompensationNow("dmc", on=True, parameters="filter", share=1.0, current_A=0.01, reason="")
    tick = replace(tick, link=LinkState.ANSWERED, estimate=replace(tick.estimate, valid=flags), compensation=now)
    sink.write(tick)
    served_names = {key.partition("{")[0] for key in parsed(fetched(port))}
    assert wanted_for(name) - served_names == set()
