"""A run over MQTT: what a broker gets, what it is left with, and what its absence costs."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from rw_ekf.records import RunState, StateNow
from tests.recorders.broker import Broker
from tests.recorders.ticks import ALARM, TRACKING, recorder, turn, until

pytest.importorskip("paho.mqtt.client")

TOPIC = "wheels/rw0"


@pytest.fixture
def broker() -> Iterator[Broker]:
    """A broker that is there."""
    made = Broker()
    made.begin()
    yield made
    made.vanish()


def connected(tmp_path: Path, broker: Broker) -> tuple[Any, Any]:
    sink, made = recorder(tmp_path, "mqtt", f"mqtt://127.0.0.1:{broker.port}/{TOPIC}")
    until(lambda: sink._up)
    return sink, made


def state_of(broker: Broker) -> Any:
    return json.loads(broker.retained.get(f"{TOPIC}/state", "{}")).get("state")


def events_of(broker: Broker) -> list[str]:
    return [json.loads(text)["event"] for topic, text in broker.published if topic == f"{TOPIC}/event"]


def rows(broker: Broker) -> list[Any]:
    return [json.loads(text) for topic, text in broker.published if topic == TOPIC]


def test_each_tick_its_state_and_its_events_are_published(tmp_path: Path, broker: Broker) -> None:
    """One JSON object a tick, in order; the state retained as it changes; alarms as events; offline at the end."""
    sink, made = connected(tmp_path, broker)
    until(lambda: state_of(broker) == "CONNECTING")
    for i in range(20):
        sink.write(turn(i, *([ALARM] if i > 10 else [])))
    until(lambda: len(rows(broker)) == 20)
    assert [row["sample"]["time_s"] for row in rows(broker)] == [turn(i).sample.time_s for i in range(20)]
    assert rows(broker)[4]["estimate"]["speed_rad_s"] == 0.2
    assert state_of(broker) == "TRACKING"
    sink.write(turn(20, state=StateNow(RunState.SAFE, "2000-01-01T00:00:05Z", "a person is asked")))
    until(lambda: state_of(broker) == "SAFE")
    until(lambda: len(events_of(broker)) == 4)
    assert events_of(broker) == ["state", "alarm", "state", "alarm_over"]
    sink.close()
    until(lambda: state_of(broker) == "offline")
    assert made.unwritten.not_sent == {}


def test_a_run_that_vanishes_leaves_its_last_will(tmp_path: Path, broker: Broker) -> None:
    """Cut off without a word, the broker says offline for it; once it is there again the state is what it is."""
    sink, _ = connected(tmp_path, broker)
    sink.write(turn(0))
    until(lambda: state_of(broker) == "TRACKING")
    broker.cut()
    until(lambda: state_of(broker) == "offline")
    until(lambda: state_of(broker) == "TRACKING")
    assert broker.connects == 2
    sink.close()


def test_a_broker_that_is_gone_costs_its_ticks_alone_and_is_found_again(tmp_path: Path, broker: Broker) -> None:
    """Gone for 30 ticks: these are counted and said once, the run is not called unwritten, and what follows arrives."""
    sink, made = connected(tmp_path, broker)
    sink.write(turn(0))
    until(lambda: rows(broker))
    broker.vanish()
    until(lambda: not sink._up)
    for i in range(1, 31):
        sink.write(turn(i))
    assert made.unwritten.not_sent == {"mqtt": 30}
    assert made.logger.events == ["not_recorded"]
    assert not made.unwritten
    broker.begin()
    until(lambda: sink._up)
    sink.write(turn(31, state=TRACKING))
    until(lambda: len(rows(broker)) == 2)
    assert rows(broker)[-1]["sample"]["time_s"] == turn(31).sample.time_s
    assert state_of(broker) == "TRACKING"
    broker.vanish()
    sink.close()  # nobody hears its last word, which is no error
    broker.begin()


def test_a_broker_that_comes_up_after_the_run_misses_nothing_of_the_first_seconds(tmp_path: Path) -> None:
    """Forty ticks before there is anybody, ten after: all arrive, in order. Without one at all, all are counted."""
    broker = Broker()
    broker.begin()
    broker.vanish()
    sink, made = recorder(tmp_path, "mqtt", f"mqtt://127.0.0.1:{broker.port}/{TOPIC}")
    for i in range(40):
        sink.write(turn(i))
    broker.begin()
    until(lambda: sink._up)
    for i in range(40, 50):
        sink.write(turn(i))
    until(lambda: len(rows(broker)) == 50)
    assert [row["sample"]["time_s"] for row in rows(broker)] == [turn(i).sample.time_s for i in range(50)]
    sink.close()
    broker.vanish()
    assert made.unwritten.not_sent == {}
    alone, made = recorder(tmp_path, "mqtt", f"mqtt://127.0.0.1:{broker.port}/{TOPIC}")
    for i in range(300):
        alone.write(turn(i))
    alone.close()
    assert made.unwritten.not_sent == {"mqtt": 300}
    assert made.logger.events == ["not_recorded"]
