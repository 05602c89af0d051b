"""A run over MQTT: each tick on TOPIC, its state retained on TOPIC/state, events on TOPIC/event.

The broker itself says "offline" on TOPIC/state where the run vanishes (the last will). Where the broker is gone the
run continues, what it would have sent is counted, and the library's own thread tries to reach it again.
"""

from __future__ import annotations

import contextlib
import json
import threading
from collections import deque
from typing import Any
from urllib.parse import urlsplit

from rw_ekf.errors import BadInputError
from rw_ekf.records import StateNow, Tick
from rw_ekf.sinks.all_sinks import RunContext
from rw_ekf.sinks.recorders.tick_record import TickRecords

NEEDS = ("paho.mqtt.client",)
_KEEPALIVE_S = 10
_TRY_AGAIN_S = (1, 30)
_MOST_WAITING = 600  # messages on their way
_MOST_BEFORE = 100  # that wait for the first connection: some seconds
_END_WITHIN_S = 1.0
OFFLINE = "offline"


class MqttRecorder:
    """One JSON object for each sample."""

    leaves_file = False

    def __init__(self, run: RunContext) -> None:
        """Begin to connect. Raises BadInputError for an address that is none."""
        from paho.mqtt import client as paho
        from paho.mqtt.enums import CallbackAPIVersion

        self._run = run
        self._records = TickRecords(run.clock, run.began, run.state_names)
        self._state: StateNow | None = run.began
        self._up = False
        self._before: deque[tuple[str, str]] | None = deque()  # messages; None once there was a connection
        self._lock = threading.Lock()
        self._closed = False
        place = urlsplit(str(run.output.mqtt))
        self._topic = place.path.strip("/")
        self._client = paho.Client(CallbackAPIVersion.VERSION2)
        self._client.max_queued_messages_set(_MOST_WAITING)
        self._client.reconnect_delay_set(*_TRY_AGAIN_S)
        self._client.will_set(f"{self._topic}/state", self._state_text(OFFLINE), qos=1, retain=True)
        self._client.on_connect = self._connected
        self._client.on_disconnect = self._disconnected
        try:
            self._client.connect_async(place.hostname or "", place.port or 1883, _KEEPALIVE_S)
        except (ValueError, OSError) as error:
            raise BadInputError(f"output.mqtt: {run.output.mqtt} cannot be reached ({error}): mend it") from None
        self._client.loop_start()

    def write(self, tick: Tick) -> None:
        """Publish a turn."""
        record = self._records.of(tick)
        if tick.state is not None and tick.state != self._state:
            self._state = tick.state
            self._publish_state()
        for event in record.events:
            self._publish("/event", event)
        if record.sample is not None:
            about = {"stamp_ns": record.stamp_ns, "run_state": record.state}
            sent = self._publish("", {**about, "sample": record.sample, "estimate": record.estimate})
            if not sent:
                self._miss(1)

    def lost(self, ticks: int) -> None:
        """They are in no message."""

    def close(self) -> None:
        """Say "offline", and leave."""
        if self._closed:
            return
        self._closed = True
        if self._before:
            self._miss(sum(topic == self._topic for topic, _ in self._before))
        if self._up:
            last = self._client.publish(f"{self._topic}/state", self._state_text(OFFLINE), qos=1, retain=True)
            with contextlib.suppress(ValueError, RuntimeError):  # it has gone this moment: its last will says the same
                last.wait_for_publish(_END_WITHIN_S)
        self._client.disconnect()
        self._client.loop_stop()

    def _miss(self, ticks: int) -> None:
        reason = f"no broker at {self._run.output.mqtt}"
        self._run.unwritten.miss("mqtt", ticks, reason, self._run.logger.warning)

    def _publish(self, under: str, message: dict[str, Any]) -> bool:
        """Whether the message is on its way, or waits for the first connection."""
        topic, text = f"{self._topic}{under}", json.dumps(message, allow_nan=False)
        with self._lock:
            if self._before is not None and len(self._before) < _MOST_BEFORE:
                self._before.append((topic, text))
                return True
            return self._up and self._client.publish(topic, text).rc == 0

    def _publish_state(self) -> None:
        if self._up:
            self._client.publish(f"{self._topic}/state", self._state_text(None), qos=1, retain=True)

    def _state_text(self, instead: str | None) -> str:
        now = self._state
        reported = {} if now is None or instead is not None else {"since_utc": now.since_utc, "reason": now.reason}
        state = instead or (None if now is None else now.state.value)
        return json.dumps({"state": state, "wheel": self._run.wheel, **reported})

    def _connected(self, client: Any, userdata: Any, flags: Any, reason: Any, properties: Any) -> None:
        if not reason.is_failure:
            with self._lock:
                self._up = True
                waiting, self._before = self._before or (), None
                for topic, text in waiting:
                    client.publish(topic, text)
            self._publish_state()
        else:
            self._run.logger.warning("mqtt_refused", reason=str(reason), do="it is tried again")

    def _disconnected(self, client: Any, userdata: Any, flags: Any, reason: Any, properties: Any) -> None:
        self._up = False


recorder_of = MqttRecorder
