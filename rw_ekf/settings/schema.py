"""The configuration: one frozen model per section, each key with its unit, default, range and meaning.

The descriptions are shown to users (docs/configuration.md, `rw-ekf check-config`, messages for missing keys); the
unit stands in brackets at their end. Types are strict: a boolean or a text is not a number, an integer is a fine float.
"""

from __future__ import annotations

from typing import Annotated, Literal
from urllib.parse import urlsplit

from pydantic import AfterValidator, Field

from rw_ekf.checking.section import Section, matching, one_of
from rw_ekf.plugins import added

CommandProfile = Literal[
    "sine", "zero", "steps", "random-sines", "identification", "log", "none", "P1", "P2", "S1", "S2", "S3", "S4", "S5"
]
RUN_SCHEMES = (
    "pid_current", "dmc", "pistiner_offset", "dither_triangular", "dither_sine", "dither_square", "dither_offset",
    "command_shaping", "pi_drag", "pi_drag_high_gain", "mrac", "walrath", "ekbf", "disturbance_observer", "adrc",
    "adrc_model", "sliding_mode", "predictive_crossing",
)  # fmt: skip


def _run_schemes() -> tuple[str, ...]:
    """Those that a run takes, and what installed packages add (docs/extending.md)."""
    return (*RUN_SCHEMES, *added("rw_ekf.compensations", RUN_SCHEMES))


CompensationScheme = Annotated[str, one_of(_run_schemes)]
CompensationRequest = Literal["socket", "profile", "log"]
StribeckLaw = Literal["gauss", "tustin", "lorentz"]

_LARGEST_PORT = 65535


def _port_there_is(text: str) -> str:
    """A place whose port, where it has one, is a number that ports may have; its form has been looked at before."""
    try:
        _ = urlsplit(text if "://" in text else f"//{text}").port
    except ValueError:
        raise ValueError(f"the port must be a number up to {_LARGEST_PORT}") from None
    return text


_PORT = AfterValidator(_port_there_is)
_PLACE = r"(\[[0-9a-fA-F:.]+\]|[\w.-]+):\d{1,5}"
HostPort = Annotated[str, matching(_PLACE, "write HOST:PORT, such as 127.0.0.1:9464"), _PORT]
InfluxTarget = Annotated[
    str,
    matching(
        rf"file|udp://{_PLACE}|https?://[^\s/]+/\S*", "write file, udp://HOST:PORT or http://HOST:PORT/api/v2/write?..."
    ),
    _PORT,
]
MqttTopic = Annotated[
    str,
    matching(rf"mqtt://{_PLACE}/[^\s#+]+", "write mqtt://HOST:PORT/TOPIC, such as mqtt://127.0.0.1:1883/wheels/rw0"),
    _PORT,
]

_EFFECT = r"[a-z][a-z0-9_]*(:[A-Za-z]\w*=[^,=\s]+(,[A-Za-z]\w*=[^,=\s]+)*)?"
Effect = Annotated[str, matching(_EFFECT, "write an effect as ID:name=value,name=value")]


class WheelSection(Section):
    """The wheel and the line it is on."""

    port: str = Field(
        min_length=1, description="serial port, any URL of pyserial's serial_for_url, or a bus: can:socketcan:can0"
    )
    name: str = Field("wheel", min_length=1, description="what reports and logs call this wheel")
    protocol: str = Field("sunspace-wheel", min_length=1, description="wire map: a name from config/ or a path")
    inertia_kg_m2: float = Field(
        1.5e-3, gt=0, le=1e3, description="rotor inertia, turns accelerations into torques [kg m^2]"
    )
    stribeck_speed_rpm: float = Field(4.0, gt=0, le=1e4, description="speed scale of the Stribeck bump [rpm]")
    stribeck_law: StribeckLaw = Field("gauss", description="shape of the Stribeck bump: gauss, tustin or lorentz")
    baud: int | None = Field(None, gt=0, le=10_000_000, description="line speed; null takes the wire map's [baud]")
    dtr: bool = Field(True, description="what the port's DTR line is set to when it is opened, and stays at")
    rts: bool = Field(True, description="what the port's RTS line is set to when it is opened, and stays at")
    address: int | None = Field(
        None, ge=0, le=255, description="the wheel's address on its line; null takes the wire map's"
    )
    echo: bool = Field(
        False, description="whether the adapter echoes what is sent, as on two wires: the echo is taken out and checked"
    )


class LimitsSection(Section):
    """What may never be exceeded, whatever the rest of the configuration says."""

    current_A: float = Field(gt=0, le=1e3, description="the largest current ever commanded [A]")
    slew_A_per_s: float = Field(5.0, gt=0, le=1e6, description="fastest change of the commanded current [A/s]")
    speed_rpm: float = Field(4200.0, gt=0, le=1e6, description="above it only a braking current is written [rpm]")
    temperature_degC: float = Field(60.0, gt=-100, le=500, description="above it only zero is written [degC]")
    silence_s: float = Field(0.5, gt=0, le=3600, description="zero is written after so long without telemetry [s]")
    safe_after_s: float | None = Field(
        5.0,
        gt=0,
        le=1e6,
        description="after so long without telemetry (silence_s at least) the run stays at zero; null: it goes on [s]",
    )


class LoopSection(Section):
    """The cycle: read, filter, write."""

    rate_hz: float = Field(10.0, ge=0.1, le=2000, description="cycles per second [Hz]")
    reply_timeout_ms: float = Field(40.0, gt=0, le=60_000, description="how long a reply is waited for [ms]")


class PriorValue(Section):
    """One prior: a value and how sure of it you are."""

    value: float = Field(description="expected value [unit of the parameter]")
    std: float = Field(gt=0, description="standard deviation of the expectation [unit of the parameter]")


class PriorSection(Section):
    """What is known of the four parameters beforehand; what is left out keeps the built-in wide prior."""

    motor_gain: PriorValue | None = Field(None, description="acceleration per ampere [rad/s^2/A]")
    viscous: PriorValue | None = Field(None, description="viscous friction per inertia [1/s]")
    coulomb: PriorValue | None = Field(None, description="Coulomb friction per inertia [rad/s^2]")
    static: PriorValue | None = Field(None, description="break-away friction per inertia [rad/s^2]")


class FilterSection(Section):
    """The extended Kalman filter."""

    speed_noise_rpm: float = Field(1.0, gt=0, le=1e4, description="standard deviation of one speed reading [rpm]")
    acceleration_noise_rpm_per_sqrt_s: float = Field(
        0.03, ge=0, le=1e4, description="random walk of the true speed that the model does not explain [rpm/sqrt(s)]"
    )
    parameter_drift_percent_per_sqrt_hour: float = Field(
        0.1, ge=0, le=1e3, description="random walk allowed to the four parameters [%/sqrt(h)]"
    )
    gate_probability: float = Field(
        0.9999, gt=0.5, lt=1, description="share of healthy readings that pass the outlier gate [-]"
    )
    max_gap_s: float = Field(2.0, gt=0, le=1e6, description="after a longer gap the speed is seeded anew [s]")
    model: str | None = Field(
        None, min_length=1, description="model YAML, as a run or `fit --out` writes it; null: none"
    )
    prior: PriorSection | None = Field(None, description="priors of the four parameters; null: the built-in ones")
    continue_learned: bool = Field(
        True, description="whether a run goes on from what this wheel's runs have learned; false: from model and prior"
    )


class WatchSection(Section):
    """The watch over the running estimator: alarms when the residual is not noise, and on drag spikes."""

    enabled: bool = Field(True, description="whether the daemon watches its own residual")
    false_alarms_per_1000_h: float = Field(
        1.0,
        gt=0,
        le=1e3,
        description="false alarms that the thresholds are reckoned for [1/1000 h]; measured is < 15 at 95 %",
    )
    window_s: float = Field(
        600.0, ge=60, le=86_400, description="longest stretch of residual that is judged at once [s]"
    )
    smallest_spike_percent: float = Field(
        15.0, gt=0, le=1e4, description="smallest drag spike that is reported, share of Coulomb friction [%]"
    )


class CommandSection(Section):
    """The current that `run` commands."""

    profile: CommandProfile = Field(
        "sine", description="what is commanded; none never writes, log repeats a recorded current"
    )
    amplitude_A: float = Field(0.1, ge=0, le=1e3, description="amplitude of sine, steps and random-sines [A]")
    period_s: float = Field(30.0, gt=0, le=1e6, description="period of sine, steps and random-sines [s]")
    bias_A: float = Field(0.0, ge=-1e3, le=1e3, description="constant current added to it [A]")
    seed: int = Field(1, ge=0, le=2**63 - 1, description="seed of the random profiles [-]")
    log: str | None = Field(None, min_length=1, description="the log to repeat; required if profile is log, else null")
    confirm_sign: bool = Field(
        True, description="whether a run first moves a wheel a little whose sign and gain were never confirmed"
    )

    @property
    def writes(self) -> bool:
        """Whether the wheel is commanded at all, and not only listened to."""
        return self.profile != "none"


class CompensationSection(Section):
    """Friction compensation of what is requested of the wheel, and where the request for it comes from."""

    scheme: CompensationScheme | None = Field(
        None, description="how friction is compensated; null: not at all, command.profile goes out as it is"
    )
    request: CompensationRequest = Field(
        "socket", description="what the wheel is asked for: torques over a socket, or command.profile taken as such"
    )
    socket: str | None = Field(
        None, min_length=1, description="path of the socket; null: NAME.PORT.request.sock in output.directory"
    )
    stale_s: float = Field(0.5, gt=0, le=3600, description="a request over the socket that is older fades to zero [s]")
    fade_s: float = Field(
        3.0, gt=0, le=3600, description="within so long a stale request fades out, and the compensation in [s]"
    )
    limit_A: float = Field(
        0.1, gt=0, le=1e3, description="the largest current that compensation adds to the request's own [A]"
    )


class OutputSection(Section):
    """Where the runs go."""

    directory: str = Field("runs", min_length=1, description="directory that gets one log and metadata per run")
    estimates_every_s: float = Field(
        2.0,
        ge=0,
        le=86_400,
        description="how often the estimates have the state and its sigmas; 0: at every sample [s]",
    )
    part_hours: float = Field(24.0, gt=0, le=87_600, description="a log goes on in a new part after so long [h]")
    part_megabytes: float = Field(
        256.0, gt=0, le=1e6, description="and where one of the part's files has got so long [MB]"
    )
    mcap: bool = Field(False, description="whether a run also leaves an MCAP file, for Foxglove, beside its log")
    prometheus: HostPort | None = Field(None, description="HOST:PORT at which /metrics is served; null: not")
    influx: InfluxTarget | None = Field(
        None,
        description="line protocol goes to: file (beside the log), udp://HOST:PORT or http://...; null: not",
    )
    plotjuggler: HostPort | None = Field(None, description="HOST:PORT that gets each tick as JSON over UDP; null: not")
    mqtt: MqttTopic | None = Field(None, description="mqtt://HOST:PORT/TOPIC that gets each tick as JSON; null: not")

    @property
    def over_network(self) -> bool:
        """Whether anything of a run is requested, or sent, over a network."""
        return any(place not in (None, "file") for place in (self.prometheus, self.influx, self.plotjuggler, self.mqtt))


class TrueWheelSection(Section):
    """What a simulated wheel is in truth."""

    motor_gain: float = Field(15.205, gt=0, le=1e6, description="true motor gain [rad/s^2/A]")
    viscous: float = Field(0.00322, ge=0, le=1e3, description="true viscous friction per inertia [1/s]")
    coulomb: float = Field(0.5863, ge=0, le=1e6, description="true Coulomb friction per inertia [rad/s^2]")
    static: float = Field(0.6037, ge=0, le=1e6, description="true break-away friction per inertia [rad/s^2]")


class SimulationSection(TrueWheelSection):
    """The wheel that `simulate` serves; an estimator never reads this."""

    speed_noise_rpm: float = Field(1.0, ge=0, le=1e4, description="standard deviation of one speed reading [rpm]")
    ambient_degC: float = Field(20.0, ge=-100, le=500, description="ambient temperature [degC]")
    acceleration_noise_rpm_per_sqrt_s: float = Field(
        0.0, ge=0, le=1e4, description="random walk added to the true speed [rpm/sqrt(s)]"
    )
    effects: tuple[Effect, ...] = Field(
        (), strict=False, description='effects of the catalogue, as "ID:name=value,name=value"'
    )


class Configuration(Section):
    """A whole configuration. Made by `rw_ekf.settings.load.load_configuration`, which also checks sections together."""

    wheel: WheelSection = Field(description="the wheel and its line")
    limits: LimitsSection = Field(description="what may never be exceeded")
    loop: LoopSection = Field(default_factory=LoopSection, description="the cycle")
    filter: FilterSection = Field(default_factory=FilterSection, description="the extended Kalman filter")
    watch: WatchSection = Field(default_factory=WatchSection, description="the watch over the running estimator")
    command: CommandSection = Field(default_factory=CommandSection, description="the current that run commands")
    compensation: CompensationSection = Field(
        default_factory=CompensationSection, description="friction compensation of what is asked for"
    )
    output: OutputSection = Field(default_factory=OutputSection, description="where the runs go")
    simulation: SimulationSection = Field(default_factory=SimulationSection, description="the wheel of simulate")

    @property
    def takes_torques(self) -> bool:
        """Whether what is requested of the wheel comes over a socket."""
        return self.compensation.scheme is not None and self.compensation.request == "socket"


SECTIONS: dict[str, type[Section]] = {
    "wheel": WheelSection,
    "limits": LimitsSection,
    "loop": LoopSection,
    "filter": FilterSection,
    "watch": WatchSection,
    "command": CommandSection,
    "compensation": CompensationSection,
    "output": OutputSection,
    "simulation": SimulationSection,
}
