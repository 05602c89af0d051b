"""What the columns of a foreign log are, as far as names, units and numbers say; what they leave open is asked.

A guess is made only where nothing else fits. Names say which column is what (`column_names`), a unit says how large one
of it is, the numbers say whether a column can be that (a time rises, an angle begins anew after a turn). Two columns
that fit as well, or a unit that may be either of two, are a question: no number is taken in a wrong meaning in silence.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.errors import LogError
from rw_ekf.logs.column_names import Role, Said, role_of, said_by
from rw_ekf.logs.column_time import Clock, clock_of, rate_in
from rw_ekf.logs.column_units import unit_of
from rw_ekf.logs.raw_table import RawTable
from rw_ekf.logs.wheel_log import READABLE_COLUMNS

_LEAST_SHARE = 0.5  # of the rows of a column are numbers where it is one of the log's
_AMPERES = (0.02, 20.0)  # largest current that, with decimals and no unit, is in amperes: less moves no motor
_TURNING = 20.0  # largest speed called n that is in 1/min; no wheel turns at less than that and no more
_TURNS = (2.0 * math.pi, 360.0, 1.0, *(2.0**bits for bits in range(8, 25)), 4000.0, 3600.0)
_FULL = 0.97  # of a turn, which an angle that begins anew covers
_SAME = 0.03  # relative: a rate of an angle, and a speed, are the same
_EXTRA = {"temperature": "temperature_degC", "pressure": "pressure_Pa", "bus_voltage": "bus_voltage_V"}
_DRIVES: tuple[tuple[Role, str], ...] = (
    ("torque", "a torque stands where a current would: motor_gain is then per newton metre"),
    ("force", "a force stands where a current would: motor_gain is then per newton"),
    ("voltage", "a voltage stands where a current would: motor_gain is then per volt, and viscous has the back-EMF"),
    ("share", "a share of the full drive stands where a current would: motor_gain is then at full drive"),
)  # fmt: skip


@dataclass(frozen=True)
class Line:
    """One line of a map: what a column of the log comes from, and why."""

    name: str
    entry: dict[str, object]  # as it stands in a map
    why: str


@dataclass(frozen=True)
class Question:
    """What the file does not say; `answers` are the lines of which one is right."""

    name: str
    text: str
    answers: tuple[Line, ...] = ()


@dataclass
class Guess:
    """A map as far as it can be guessed."""

    lines: list[Line] = field(default_factory=list)
    options: dict[str, object] = field(default_factory=dict)  # further keys of the map
    questions: list[Question] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    @property
    def is_certain(self) -> bool:
        """Whether nothing that a log needs is left open."""
        return not self.questions

    def mapping(self) -> dict[str, object]:
        """The map, as a YAML document has it."""
        return {**self.options, **{line.name: line.entry for line in self.lines}}


@dataclass(eq=False)
class Column:
    """One column of a table, with what its name says and its numbers."""

    number: int
    name: str
    said: Said
    role: Role
    values: Float64Array  # (n,) NaN where there is no number
    key: str | int = ""  # how a map names it

    @property
    def shown(self) -> str:
        """How a message names it."""
        return f"column '{self.name}'" if self.name else f"column {self.number}"

    @property
    def top(self) -> float:
        """Largest size of its numbers."""
        return float(np.nanmax(np.abs(self.values)))

    @property
    def is_whole(self) -> bool:
        """Whether all its numbers are whole."""
        known = self.values[np.isfinite(self.values)]
        return bool(np.all(known == np.round(known)))

    def entry(self, unit: str = "", **more: object) -> dict[str, object]:
        """Its entry in a map."""
        return {
            "column": self.key,
            **({"unit": unit} if unit else {}),
            **{k: v for k, v in more.items() if v is not None},
        }


def needs_guess(table: RawTable) -> bool:
    """Whether a table lacks, under the log's own names, what a log needs."""
    names = set(table.names)
    return not (
        "time_s" in names and names & {"speed_rad_s", "speed_rpm"} and names & {"current_A", "current_command_A"}
    )


def guess_columns(table: RawTable, answers: dict[str, str] | None = None) -> Guess:
    """Guess what the columns of a table are. answers: of `--set`: a column, or of NAME.unit a value."""
    told = Answers(answers or {}, table)
    columns = columns_of(table)
    guess = Guess()
    clock = _time(table, columns, told, guess)
    taken: set[int] = set() if clock is None else {clock.number}
    time_s = None if clock is None else clock.time_s
    speed = _speed(table, [c for c in columns if c.number not in taken], time_s, told, guess)
    taken |= {speed.number} if speed is not None else set()
    _drive(table, [c for c in columns if c.number not in taken], speed, told, guess)
    _further(columns, speed, taken, told, guess)
    told.add_unasked(guess)
    return guess


def columns_of(table: RawTable) -> list[Column]:
    """The columns that hold numbers, each with its role; a stamp's numbers are seconds."""
    found = []
    repeated = {name for name in table.names if table.names.count(name) > 1}
    for number, name in enumerate(table.names):
        said = said_by(name)
        try:
            values = table.floats(number, stamps=True)
        except LogError:
            values = np.full(table.rows, np.nan)
        key: str | int = name if name and name not in repeated else number
        found.append(Column(number, name, said, role_of(said) if name else "other", values, key))
    return found


_SHORT = {
    "time": "time_s",
    "speed": "speed_rad_s",
    "current": "current_A",
    "angle": "angle_rad",
    "temperature": "temperature_degC",
}


class Answers:
    """What was given with `--set`: `current=3`, `current.unit=mA`, `speed.scale=-1`."""

    def __init__(self, given: dict[str, str], table: RawTable) -> None:
        self._table = table
        self.columns: dict[str, int | None] = {}
        self.more: dict[str, dict[str, object]] = {}
        for key, value in given.items():
            name, _, part = key.partition(".")
            name = _SHORT.get(name, name)
            if name not in READABLE_COLUMNS:
                raise LogError(f"--set {key}={value}: {name} is none of a log's columns: {', '.join(READABLE_COLUMNS)}")
            if part:
                self.more.setdefault(name, {})[part] = _value(value)
            else:
                column, _, unit = value.partition(":")
                self.columns[name] = None if column == "none" else self._number(column, key)
                if unit:
                    self.more.setdefault(name, {})["unit"] = unit

    def _number(self, text: str, key: str) -> int:
        if text in self._table.names:
            return self._table.names.index(text)
        if text.isdigit() and int(text) < len(self._table.names):
            return int(text)
        raise LogError(
            f"--set {key}={text}: {self._table.path} has no such column; by name: {self._table.described_columns()}; "
            f"by number: 0 to {len(self._table.names) - 1}"
        )

    def of(self, *names: str) -> tuple[str, int | None] | None:
        """Which column was given for one of these."""
        return next(((name, self.columns[name]) for name in names if name in self.columns), None)

    def unit(self, *names: str) -> str:
        """Which unit was given for one of these."""
        return next((str(self.more[name]["unit"]) for name in names if "unit" in self.more.get(name, {})), "")

    def with_more(self, name: str, entry: dict[str, object]) -> dict[str, object]:
        """An entry with what else was given for it."""
        return {**entry, **self.more.get(name, {})}

    def add_unasked(self, guess: Guess) -> None:
        """Give what was set for columns that nothing asked for."""
        known = {line.name for line in guess.lines}
        for name, column in self.columns.items():
            if name not in known and column is not None and name != "speed_rpm":
                key = self._table.names[column] or column
                guess.lines.append(Line(name, self.with_more(name, {"column": key}), "as it was set"))


def _value(text: str) -> object:
    try:
        return float(text)
    except ValueError:
        return text


def _time(table: RawTable, columns: list[Column], told: Answers, guess: Guess) -> Clock | None:
    """Choose the time."""
    given = told.of("time_s")
    named = [c for c in columns if c.role == "time" and np.isfinite(c.values).mean() > 1.0 - 1.0e-9]
    if given is not None and given[1] is not None:
        named = [columns[given[1]]]
    unit = told.unit("time_s")
    clocks = [
        clock
        for column in named
        if (
            clock := clock_of(
                column.number, column.name, column.said, column.values, unit, _is_stamp(table, column.number)
            )
        )
        is not None
    ]
    clocks = [clock for clock in clocks if clock.is_clock] or ([] if given is None else clocks)
    best = max((clock.rank for clock in clocks), default=0)
    clocks = [clock for clock in clocks if clock.rank == best]
    if clocks:
        clock = clocks[0]
        column = columns[clock.number]
        entry = column.entry(clock.unit, wrap=clock.wrap)
        if clock.asks:
            answers = tuple(Line("time_s", column.entry(unit), unit) for unit in clock.asks)
            guess.questions.append(
                Question(
                    "time_s",
                    f"{column.shown} has no unit, and its steps may be of {' or '.join(clock.asks)}: which?",
                    answers,
                )
            )
        else:
            guess.lines.append(Line("time_s", told.with_more("time_s", entry), clock.why))
        guess.options |= {
            key: value for key, value in (("restarts", clock.restarts), ("repeats", clock.repeats)) if value
        }
        guess.notes += clock.notes
        return clock
    rate = rate_in((*table.preamble, *table.names))
    if rate is not None:
        guess.options["rate_hz"] = rate[0]
        guess.notes.append(f"there is no column of time; rows are {rate[0]:g} a second, by '{rate[1]}'")
        return Clock(-1, np.arange(table.rows) / rate[0])
    rising = [c for c in columns if not c.name and np.all(np.diff(c.values) > 0.0) and table.rows > 2]
    answers = tuple(Line("time_s", c.entry("s"), "it rises") for c in rising[:3])
    guess.questions.append(
        Question("time_s", "no column is known to be the time: --set time=COLUMN, or `rate_hz` in the map.", answers)
    )
    return None


def _is_stamp(table: RawTable, number: int) -> bool:
    column = table.columns[number]
    if isinstance(column, np.ndarray):
        return False
    return str(column.type) not in {
        "double",
        "int64",
        "int32",
        "float",
        "null",
        "uint64",
        "int16",
        "uint16",
        "int8",
        "uint8",
        "uint32",
    }


def _choose(candidates: Sequence[Column], what: str, name: str, guess: Guess) -> Column | None:
    """The one that fits best; a question where two fit as well. None where there is none, or it is asked."""
    if not candidates:
        return None
    ranked = sorted(candidates, key=_rank, reverse=True)
    if len(ranked) > 1 and _rank(ranked[0]) == _rank(ranked[1]):
        same = [c for c in ranked if _rank(c) == _rank(ranked[0])]
        answers = tuple(Line(name, c.entry(c.said.unit_text), "") for c in same)
        shown = ", ".join(c.shown for c in same[:4])
        guess.questions.append(Question(name, f"{shown}: which of them is the {what}?", answers))
        return None
    return ranked[0]


def _rank(column: Column) -> tuple[int, ...]:
    said = column.said
    electrical = said.any_of("electrical", "elec", "erpm", "phase") and not said.any_of("phase_current", "phasecurrent")
    second = said.has("derived") or said.has("linear") or said.any_of("load", "output", "gear", "left", "right")
    whole = said.unit is not None and not said.unit.per
    return (
        int(column.name in READABLE_COLUMNS), int(not second), int(not electrical), int(said.any_of("iq", "q", "i_q")),
        int(not said.has("supply")), int(said.has("machine")), int(said.has("raw")), int(whole),
    )  # fmt: skip


def _moves(column: Column) -> bool:
    known = column.values[np.isfinite(column.values)]
    return known.size > _LEAST_SHARE * column.values.size and float(np.ptp(known)) > 0.0


def _speed(
    table: RawTable, columns: list[Column], time_s: Float64Array | None, told: Answers, guess: Guess
) -> Column | None:
    """Choose the speed, or the angle of which it is the rate."""
    given = told.of("speed_rad_s", "speed_rpm")
    speeds = [c for c in columns if c.role == "speed" and _moves(c)]
    angles = [c for c in columns if c.role == "angle" and _moves(c)]
    if given is not None and given[1] is not None:
        speeds = [c for c in columns if c.number == given[1]]
    if not speeds and angles:
        return _rate_of_angle(table, angles, told, guess)
    asked = len(guess.questions)
    column = _choose(speeds, "speed of the wheel", "speed_rad_s", guess)
    if column is None:
        if len(guess.questions) == asked:
            guess.questions.append(Question("speed_rad_s", "no column is known to be the speed: --set speed=COLUMN."))
        return None
    if column.said.any_of("electrical", "elec") and not told.unit("speed_rad_s", "speed_rpm"):
        divided = (
            _speed_line(column, column.said.unit_text or "rpm", "", None, told),
            Line("speed_rad_s", column.entry("erpm", pole_pairs=7), ""),
        )
        text = f"{column.shown} is electrical: has it been divided by the pole pairs, and by how many if not?"
        guess.questions.append(Question("speed_rad_s", text, divided))
        return column
    unit, why = _speed_unit(
        column,
        angles,
        time_s,
        told.unit("speed_rad_s", "speed_rpm") or ("rpm" if given and given[0] == "speed_rpm" else ""),
    )
    sign = _direction(columns, column)
    if unit is None:
        answers = tuple(_speed_line(column, unit, "", sign, told) for unit in ("rpm", "rad/s", "deg/s"))
        text = f"{column.shown} has no unit, and goes to {column.top:.4g}: rpm, rad/s or deg/s?"
        guess.questions.append(Question("speed_rad_s", text, answers))
        return column
    known = unit_of(unit)
    if known is not None and known.per and known.per not in told.more.get("speed_rad_s", {}):
        per = _per_turn(table, column) if known.per == "counts_per_turn" else None
        if per is None:
            text = f"{column.shown} is in {unit}: how many {known.per.replace('_', ' ')}? --set speed.{known.per}=N."
            guess.questions.append(Question("speed_rad_s", text, (_speed_line(column, unit, "", sign, told),)))
            return column
        told.more.setdefault("speed_rad_s", {})[known.per] = per
    if known is not None and known.quantity == "linear_speed":
        guess.notes.append(f"{column.shown} is in {unit}: metres stand where radians would, and nothing here turns")
    guess.lines.append(_speed_line(column, unit, why, sign, told))
    return column


def _speed_line(column: Column, unit: str, why: str, sign: Column | None, told: Answers) -> Line:
    by = None if sign is None else sign.key
    why = why if sign is None else f"{why}; without a sign, which {sign.shown} has"
    if unit_of(unit) == unit_of("rpm") and "unit" not in told.more.get("speed_rad_s", {}):
        entry = told.with_more("speed_rpm", column.entry(sign_of=by))
        return Line("speed_rpm", entry | told.more.get("speed_rad_s", {}), why)
    return Line("speed_rad_s", told.with_more("speed_rad_s", column.entry(unit, sign_of=by)), why)


def _speed_unit(column: Column, angles: list[Column], time_s: Float64Array | None, told: str) -> tuple[str | None, str]:
    """The speed's unit, and what says so; None where nothing does."""
    said = column.said
    if told:
        return told, "as it was set"
    if column.name in {"speed_rad_s", "speed_rpm"}:
        return ("rpm" if column.name == "speed_rpm" else "rad/s"), "its name is the log's own"
    if said.unit is not None:
        return said.unit_text, f"its name says {said.unit_text}"
    for word in ("erpm", "krpm", "rpm", "dps"):
        if said.any_of(word, f"rpm{word}"):
            return word, f"its name says {word}"
    for angle in angles:
        found = _by_angle(column, angle, time_s)
        if found is not None:
            return found, f"{angle.shown} turns as fast as that"
    if (
        said.any_of("n", "nm", "drehzahl", "motordrehzahl", "istdrehzahl", "raddrehzahl", "giri", "tours", "regime")
        and column.top > _TURNING
    ):
        return "1/min", "what is called so is counted per minute"
    if said.any_of(
        "omega", "w", "thetadot", "dtheta", "qdot", "qd", "dq", "phidot", "omg", "winkelgeschwindigkeit"
    ) and (not column.is_whole and column.top < 300.0):
        return "rad/s", "what is called so is in rad/s"
    return None, ""


def _by_angle(column: Column, angle: Column, time_s: Float64Array | None) -> str | None:
    """The unit in which a speed is the rate of an angle of a known unit."""
    if time_s is None or angle.said.unit is None or angle.said.unit.per:
        return None
    turn = 2.0 * math.pi / angle.said.unit.factor
    change = np.diff(angle.values)
    if float(np.ptp(angle.values[np.isfinite(angle.values)])) <= turn * (1.0 + 1e-9):
        change -= turn * np.round(change / turn)
    mean = 0.5 * (column.values[1:] + column.values[:-1]) * np.diff(time_s)
    sure = np.isfinite(mean) & np.isfinite(change) & (np.abs(mean) > 0.3 * np.nanmax(np.abs(mean)))
    if int(sure.sum()) < 20:
        return None
    ratio = float(np.median(change[sure] / mean[sure])) * angle.said.unit.factor
    for unit in ("rpm", "rad/s", "deg/s", "rev/s"):
        known = unit_of(unit)
        if known is not None and abs(ratio / known.factor - 1.0) < _SAME:
            return unit
    return None


def _rate_of_angle(table: RawTable, angles: list[Column], told: Answers, guess: Guess) -> Column | None:
    """The speed as the rate of an angle."""
    column = _choose(angles, "angle of the wheel", "speed_rad_s", guess)
    if column is None:
        return None
    turn = _turn_of(column)
    unit = column.said.unit_text if column.said.unit is not None else told.unit("angle_rad", "speed_rad_s")
    known = unit_of(unit) if unit else None
    entry: dict[str, object] = {"derivative_of": column.key}
    if known is not None and known.per:
        per = _per_turn(table, column) or told.more.get("speed_rad_s", {}).get(known.per) or turn
        if per is None:
            text = f"{column.shown} is in {unit}: how many to a turn? --set speed.counts_per_turn=N."
            guess.questions.append(
                Question("speed_rad_s", text, (Line("speed_rad_s", entry | {"unit": unit, known.per: 4096}, ""),))
            )
            return column
        entry |= {"unit": unit, known.per: per}
    elif known is not None:
        entry["unit"] = unit
    elif turn is not None:
        entry["scale"] = 1.0 if abs(turn - 2.0 * math.pi) < 1e-6 else float(f"{2.0 * math.pi / turn:.12g}")
    else:
        answers = tuple(Line("speed_rad_s", entry | {"unit": unit}, "") for unit in ("rad", "deg", "turns"))
        guess.questions.append(
            Question("speed_rad_s", f"{column.shown} is an angle without a unit: rad, deg, turns or counts?", answers)
        )
        return column
    if turn is not None:
        entry["wrap"] = turn
    more = {key: value for key, value in told.more.get("speed_rad_s", {}).items() if key != "unit"}
    why = f"there is no speed: it is the rate of {column.shown}" + (
        f", which begins anew after {turn:.6g}" if turn else ""
    )
    guess.lines.append(Line("speed_rad_s", entry | more, why))
    return column


def _turn_of(column: Column) -> float | None:
    """After how much an angle begins anew; None where it does not."""
    values = column.values[np.isfinite(column.values)]
    spread, change = float(np.ptp(values)), np.diff(values)
    unit = column.said.unit
    turns = _TURNS if unit is None or unit.per else (2.0 * math.pi / unit.factor,)
    for turn in turns:
        jumps = np.abs(change) > 0.5 * turn
        if _FULL * turn <= spread <= turn * (1.0 + 1.0e-9) and jumps.any():
            return turn
    return None


_PER_TURN = tuple(
    re.compile(pattern, re.IGNORECASE)
    for pattern in (
        r"(\d{2,8})\s*(?:counts?|cpr|ppr|ticks?|inc\w*|pulses|lines|steps)?\s*(?:/|per\s|pro\s)\s*(?:turn|rev|u\b|umdr)",
        r"(?:cpr|ppr|(?:counts?|ticks|inc\w*|steps|pulses)[ _-]*(?:per|pro|/)[ _-]*(?:turn|rev\w*|umdr\w*))"
        r"\D{0,4}(\d{2,8})",
        r"(\d{2,8})\s*(?:cpr|ppr)\b",
    )
)


def _per_turn(table: RawTable, column: Column) -> float | None:
    """How many counts a turn has, where a name or a line above the names says so."""
    for text in (column.name, *table.preamble, *table.names):
        match = next((found for pattern in _PER_TURN if (found := pattern.search(text))), None)
        if match is not None:
            return float(match[1])
    return None


def _direction(columns: list[Column], speed: Column) -> Column | None:
    """The column that has the sign of a speed that has none."""
    if float(np.nanmin(speed.values)) < 0.0:
        return None
    return next((c for c in columns if c.role == "direction" and c.number != speed.number), None)


def _drive(table: RawTable, columns: list[Column], speed: Column | None, told: Answers, guess: Guess) -> None:
    """Choose what drives the wheel."""
    given = told.of("current_A", "current_command_A")
    if given is not None:
        name, number = given
        if number is None:
            guess.lines.append(Line(name, {"constant": 0.0}, "as it was set: no current"))
            return
        _current_line(next(c for c in columns if c.number == number), name, told, guess)
        return
    asked = len(guess.questions)
    found = False
    for role, name, what in (
        ("current", "current_A", "current of the motor"),
        ("current_set", "current_command_A", "current that was commanded"),
    ):
        candidates = [c for c in columns if c.role == role and np.isfinite(c.values).mean() > _LEAST_SHARE]
        alive = [c for c in candidates if _moves(c)]
        column = _choose(alive, what, name, guess)
        if column is not None and role == "current" and column.said.has("supply") and not column.said.has("machine"):
            text = f"{column.shown} seems to be what the supply gives: is it the motor's current?"
            guess.questions.append(Question(name, text, (Line(name, column.entry(column.said.unit_text), ""),)))
        elif column is not None:
            found = True
            _current_line(column, name, told, guess)
    if found or len(guess.questions) > asked:
        return
    for role, note in _DRIVES:
        column = _choose([c for c in columns if c.role == role and _moves(c)], "drive", "current_A", guess)
        if column is not None:
            unit = column.said.unit_text if column.said.unit is not None else ""
            guess.lines.append(Line("current_A", told.with_more("current_A", column.entry(unit)), note))
            guess.notes.append(f"{column.shown}: {note}")
            return
        if len(guess.questions) > asked:
            return
    if speed is not None and _coasts(speed.values):
        guess.lines.append(
            Line("current_command_A", {"constant": 0.0}, "no column is a drive, and the speed only falls: a coast-down")
        )
        return
    none = Line("current_command_A", {"constant": 0.0}, "if it coasted all the time")
    guess.questions.append(
        Question(
            "current_A", "no column is known to be the current: --set current=COLUMN, or --set current=none.", (none,)
        )
    )


def _current_line(column: Column, name: str, told: Answers, guess: Guess) -> None:
    """Add a current, with its unit; a question where that is not known."""
    unit = told.unit(name, "current_A", "current_command_A")
    why = "as it was set" if unit else "its name says so"
    if not unit and column.name not in READABLE_COLUMNS:
        if column.said.unit is not None:
            unit, why = column.said.unit_text, f"its name says {column.said.unit_text}"
        elif not column.is_whole and _AMPERES[0] < column.top < _AMPERES[1]:
            unit, why = "A", f"it goes to {column.top:.3g}, with decimals: in mA that would move nothing"
        else:
            answers = tuple(Line(name, column.entry(unit), "") for unit in ("mA", "A"))
            guess.questions.append(
                Question(name, f"{column.shown} has no unit, and goes to {column.top:.4g}: mA or A?", answers)
            )
            return
    unit = "" if unit_of(unit) == unit_of("A") else unit
    guess.lines.append(Line(name, told.with_more(name, column.entry(unit)), why))


def _coasts(speed: Float64Array) -> bool:
    """Whether the size of a speed (n,) falls all the way, but for its noise."""
    size = np.abs(speed[np.isfinite(speed)])
    if size.size < 20:
        return False
    parts = np.array([float(np.median(part)) for part in np.array_split(size, 12)])
    return bool(np.all(np.diff(parts) <= 1.0e-3 * parts[0])) and parts[-1] < 0.9 * parts[0]


def _further(columns: list[Column], speed: Column | None, taken: set[int], told: Answers, guess: Guess) -> None:
    """Add what a log may have beside: where one column fits and says its unit."""
    for role, name in _EXTRA.items():
        candidates = [c for c in columns if c.role == role and np.isfinite(c.values).mean() > _LEAST_SHARE]
        ranked = sorted(candidates, key=_rank, reverse=True)
        if not ranked or (len(ranked) > 1 and _rank(ranked[0]) == _rank(ranked[1])):
            continue
        unit = ranked[0].said.unit_text if ranked[0].said.unit is not None else ""
        if unit or ranked[0].name == name:
            guess.lines.append(Line(name, told.with_more(name, ranked[0].entry(unit)), f"its name says {unit or 'so'}"))
    angles = [c for c in columns if c.role == "angle" and c.number not in taken and _moves(c)]
    usable = [c for c in angles if c.said.unit is not None and not c.said.unit.per]
    if len(angles) == 1 and usable and speed is not None and usable[0].number != speed.number:
        guess.lines.append(
            Line("angle_rad", usable[0].entry(usable[0].said.unit_text), f"its name says {usable[0].said.unit_text}")
        )
