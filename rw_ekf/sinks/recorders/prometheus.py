"""A run as Prometheus takes it: /metrics in the text exposition format 0.0.4, made on request."""

from __future__ import annotations

import itertools
import threading
from collections import Counter
from collections.abc import Iterator, Mapping
from typing import NamedTuple

from rw_ekf.errors import BadInputError
from rw_ekf.model.state import STATE_NAMES
from rw_ekf.records import Estimate, LinkState, Outcome, RunState, Tick, WheelSample
from rw_ekf.sinks.all_sinks import RunContext
from rw_ekf.sinks.recorders.late_place import LatePlace
from rw_ekf.sinks.recorders.text_server import TextServer
from rw_ekf.sinks.recorders.tick_record import TickRecords
from rw_ekf.statistics import LATE_BOUNDS_MS
from rw_ekf.version import __version__

NEEDS = ()
CONTENT_TYPE = "text/plain; version=0.0.4; charset=utf-8"
_ACCELERATION = "radians_per_second_squared"
_STATE_METRICS = {  # name, unit: between them stands "sigma"
    "speed_rad_s": ("speed", "radians_per_second"),
    "motor_gain": ("motor_gain", f"{_ACCELERATION}_per_ampere"),
    "viscous": ("viscous_friction", "per_second"),
    "coulomb": ("coulomb_friction", _ACCELERATION),
    "static": ("static_friction", _ACCELERATION),
}
_SAMPLE_METRICS = {
    "measured_speed_radians_per_second": ("speed_rad_s", "Speed as the wheel reports it."),
    "current_amperes": ("current_A", "Current as the wheel measures it."),
    "temperature_celsius": ("temperature_degC", "Bearing temperature."),
    "pressure_pascals": ("pressure_Pa", "Case pressure."),
    "bus_voltage_volts": ("bus_voltage_V", "Bus voltage."),
    "angle_radians": ("angle_rad", "Rotor angle."),
}
_LINK_COUNTERS = {
    "requests": "Requests that were sent to the wheel.",
    "timeouts": "Requests without a reply in time.",
    "stale": "Replies to an earlier request.",
    "damaged": "Replies with a wrong checksum.",
    "reconnects": "Times the line was lost and taken up again.",
}
_ESCAPED = str.maketrans({"\\": r"\\", "\n": r"\n", '"': r"\""})


class Family(NamedTuple):
    """A metric with its samples: what follows the name, labels, value."""

    name: str
    kind: str
    meaning: str
    samples: list[tuple[str, dict[str, str], float | None]]


class PrometheusRecorder:
    """Keeps the newest turn and counts; the server's thread makes text of them."""

    leaves_file = False

    def __init__(self, run: RunContext) -> None:
        """Begin to listen, or wait for an address that this machine has not got yet.

        Raises BadInputError if the place cannot be had.
        """
        self._run = run
        self._records = TickRecords(run.clock, run.began, run.state_names)
        self._tick: Tick | None = None
        self._stamp_ns: int | None = None  # of the newest sample
        self._outcomes = Counter({outcome.value: 0 for outcome in Outcome})
        self._alarms: Counter[str] = Counter()  # that began, by name
        self._lock = threading.Lock()
        place = str(run.output.prometheus)
        try:
            self._server = LatePlace("prometheus", lambda: self._listen(place), run.logger.warning)
        except OSError as error:
            raise BadInputError(
                f"output.prometheus: {place} cannot be listened at ({error.strerror or error}): give another HOST:PORT"
            ) from None

    def _listen(self, place: str) -> TextServer:
        server = TextServer(place, "/metrics", self.page, CONTENT_TYPE)
        self._run.logger.info("metrics", address=f"http://{place.rpartition(':')[0]}:{server.port}/metrics")
        return server

    def write(self, tick: Tick) -> None:
        """Take a turn."""
        record = self._records.of(tick)
        with self._lock:
            self._tick = tick
            if tick.fresh:
                self._stamp_ns = record.stamp_ns
                self._outcomes[tick.estimate.outcome.value] += 1
            self._alarms.update(str(event["name"]) for event in record.events if event["event"] == "alarm")

    def lost(self, ticks: int) -> None:
        """They are missing from the counts."""

    def close(self) -> None:
        """Listen no more."""
        self._server.close()

    def page(self) -> str:
        """What is answered now."""
        with self._lock:
            return "".join(itertools.chain.from_iterable(_lines(family) for family in self._families()))

    def _families(self) -> Iterator[Family]:
        run, tick = self._run, self._tick
        about = {"version": __version__, "wheel": run.wheel, "port": run.port, "log": run.files.log.name}
        yield Family("run_info", "gauge", "Which run this is.", [("", about, 1.0)])
        state = run.began.state if tick is None or tick.state is None else tick.state.state
        yield _enum("run_state", "What the run is doing.", [s.value for s in RunState], state.value)
        yield from self._of_run()
        yield _by("outcome", "samples_total", "counter", "Samples, by what became of them.", self._outcomes)
        on = set() if tick is None else {alarm.name for alarm in tick.alarms}
        began = dict(sorted(self._alarms.items()))
        active = {alarm: alarm in on for alarm in began}
        yield _by("alarm", "alarm_active", "gauge", "Whether an alarm of the watch is on.", active)
        yield _by("alarm", "alarms_total", "counter", "Alarms that began.", began)
        if tick is not None:
            yield _enum("link_state", "How the line answered.", [s.value for s in LinkState], tick.link.value)
            at_s = None if self._stamp_ns is None else self._stamp_ns * 1e-9
            yield _gauge("last_sample_timestamp_seconds", "When the newest sample was taken, since 1970.", at_s)
            yield from _of_sample(tick.sample, None if tick.command is None else tick.command.current_A)
            yield from _of_estimate(tick.estimate)
            if tick.compensation is not None:
                yield _gauge("compensation_on", "Whether friction is compensated.", tick.compensation.on)
                yield _gauge("compensation_current_amperes", "Current added by it.", tick.compensation.current_A)

    def _of_run(self) -> Iterator[Family]:
        """Line, loop, and what could not be recorded."""
        link, timing, unwritten = self._run.link(), self._run.timing, self._run.unwritten
        for name, meaning in _LINK_COUNTERS.items():
            yield Family(f"link_{name}_total", "counter", meaning, [("", {}, getattr(link, name))])
        reply_s = None if link.reply_ms is None else 1e-3 * link.reply_ms
        yield _gauge("link_reply_seconds", "What replies take beyond the time of their bytes, mean of fifty.", reply_s)
        yield Family("loop_ticks_total", "counter", "Turns of the loop.", [("", {}, timing.ticks)])
        yield Family("loop_overruns_total", "counter", "Turns that took too long.", [("", {}, timing.overruns)])
        bounds = [*(str(1e-3 * bound) for bound in LATE_BOUNDS_MS), "+Inf"]
        counts = list(itertools.accumulate(timing.late_counts))
        late = [("_bucket", {"le": le}, float(count)) for le, count in zip(bounds, counts, strict=True)]
        total = [("_sum", dict[str, str](), 1e-3 * timing.late_ms_sum), ("_count", dict[str, str](), float(counts[-1]))]
        yield Family("loop_late_seconds", "histogram", "How late turns began.", [*late, *total])
        rows = {"log": unwritten.log_rows, "estimates": unwritten.estimate_rows}
        yield _by("file", "unwritten_rows_total", "counter", "Rows that are missing from the run's files.", rows)
        missed = Counter(unwritten.failed_sinks) + Counter(unwritten.not_sent)
        meaning = "Ticks that a sink failed at or could not get rid of."
        yield _by("sink", "sink_missed_ticks_total", "counter", meaning, missed)


recorder_of = PrometheusRecorder


def _of_sample(sample: WheelSample, commanded_A: float | None) -> Iterator[Family]:
    for name, (key, meaning) in _SAMPLE_METRICS.items():
        yield _gauge(name, meaning, getattr(sample, key))
    in_force_A = sample.current_command_A if commanded_A is None else commanded_A
    yield _gauge("current_command_amperes", "Current that was commanded last.", in_force_A)


def _of_estimate(estimate: Estimate) -> Iterator[Family]:
    for key in STATE_NAMES:
        name, unit = _STATE_METRICS[key]
        yield _gauge(f"{name}_{unit}", f"Estimated {name.replace('_', ' ')}.", getattr(estimate.state, key))
        yield _gauge(f"{name}_sigma_{unit}", "Its standard deviation.", getattr(estimate.std, key))
    values = {effect: believed.value for effect, believed in estimate.effects.items()}
    stds = {effect: believed.std for effect, believed in estimate.effects.items()}
    yield _by("effect", "effect_coefficient", "gauge", "Coefficient of an effect of the model, in its unit.", values)
    yield _by("effect", "effect_coefficient_sigma", "gauge", "Its standard deviation.", stds)
    if estimate.valid is not None:
        meaning, valid = "Whether a parameter may be relied on.", estimate.valid._asdict()
        yield _by("parameter", "parameter_valid", "gauge", meaning, valid)
    if (test := estimate.innovation) is not None:
        yield _gauge("innovation_radians_per_second", "Measured less predicted speed.", test.innovation_rad_s)
        yield _gauge("innovation_sigma_radians_per_second", "Its standard deviation.", test.std_rad_s)
        yield _gauge("normalised_innovation_squared", "Chi-square of one degree of freedom.", test.nis)


def _gauge(name: str, meaning: str, value: float | None) -> Family:
    return Family(name, "gauge", meaning, [("", {}, value)])


def _by(label: str, name: str, kind: str, meaning: str, values: Mapping[str, float | None]) -> Family:
    return Family(name, kind, meaning, [("", {label: key}, value) for key, value in values.items()])


def _enum(name: str, meaning: str, states: list[str], now: str) -> Family:
    return _by("state", name, "gauge", meaning, {state: state == now for state in states})


def _lines(family: Family) -> Iterator[str]:
    """A family as text; nothing where nothing is known of it."""
    known = [(suffix, labels, value) for suffix, labels, value in family.samples if value is not None]
    if not known:
        return
    name = f"rw_ekf_{family.name}"
    yield f"# HELP {name} {family.meaning}\n# TYPE {name} {family.kind}\n"
    for suffix, labels, value in known:
        reported = ",".join(f'{key}="{text.translate(_ESCAPED)}"' for key, text in labels.items())
        yield f"{name}{suffix}{f'{{{reported}}}' if reported else ''} {float(value)!r}\n"
