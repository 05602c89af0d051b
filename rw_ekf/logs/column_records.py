"""What a guess is made of: columns as they stand in a table, and what is found of them."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.logs.column_names import Role, Stated, may_be_a_term, role_of, spoken, stated_by
from rw_ekf.logs.column_units import Unit, habitual_unit, unit_among, unit_of
from rw_ekf.logs.column_words import WORDS
from rw_ekf.logs.labels import owner_of
from rw_ekf.logs.log_columns import READABLE_COLUMNS
from rw_ekf.logs.odd_columns import mark_of_missing, unsigned_turn
from rw_ekf.logs.raw_table import Factor, RawTable, number_or_none

_HIGHER_IS_BACKWARD = re.compile(
    r"\b1\s*[=:]\s*[^;,]*?,?[^;]*?(n[eé]g|ccw|backw|antihor|links|left|reverse)", re.IGNORECASE
)
_REVERSED = re.compile(r"(?<!not )\b(reversed|inverted|negated|opposite|flipped|invertiert|umgekehrt)\b", re.IGNORECASE)
_RAW = re.compile(r"(?P<of>.*\S)\s*\(RAW\)")  # COSMOS: counts, beside which stands what they were converted to
_CONVERTED = re.compile(r"\s*\([UF]\)")  # with units, formatted
_LETTER_I = re.compile(r"(?<![A-Za-z])[iI](?![A-Za-z])|(?<=[a-z])I(?![A-Za-z])|(?<![A-Za-z])[iI](?=[A-Z][a-z])")
_SYMBOL = 2  # letters: ia, iu
_TAIL = re.compile(r"\s*[(\[].*")
_DEFINED = re.compile(
    r"[\W_]*(?P<name>\w[\w.]*)[\"'`]?(?:\s*[:=–—-]\s*|\s{2,}|\t|\s(?=in\s|[\[(]))(?P<text>[\[(]?[^\W\d].*|[\[(].*)"
)
_CLAUSE = re.compile(r"[;,](?![^\[(]*[\])])")  # none within brackets
_SIGNED: tuple[Role, ...] = ("speed", "speed_set", "current", "current_set")
_COUNTING: tuple[Role, ...] = ("time", "count", "segment", "direction", "other")  # has no reading to miss
_READ: tuple[Role, ...] = ("time", "speed", "current", "current_set", "torque", "voltage", "angle")
LEAST_SHARE = 0.5  # of the rows of a column are numbers where it is one of the log's


@dataclass(frozen=True)
class Line:
    """One line of a map: what a column of the log comes from, and why."""

    name: str
    entry: dict[str, object]  # as it stands in a map
    why: str
    assumed: bool = False  # its unit is concluded from its numbers or a habit: the file does not say it


# Questions of these names are about every column: whose a cell is, and of which wheel a row.
OF_THE_TABLE = ("layout", "only")


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
    warnings: list[str] = field(default_factory=list)  # what was taken though no word of the file says so

    @property
    def is_certain(self) -> bool:
        """Whether nothing that a log needs is left open."""
        return not self.questions

    @property
    def says_units(self) -> bool:
        """Whether the file itself, or who was asked, states the unit of all that is taken from it."""
        return not any(line.assumed for line in self.lines)

    def take(self, name: str, entry: dict[str, object], why: str, *, assumed: bool = False) -> None:
        """Add a line."""
        self.lines.append(Line(name, entry, why, assumed))

    def ask(self, name: str, text: str, *answers: Line) -> None:
        """Add a question."""
        self.questions.append(Question(name, text, answers))

    def mapping(self) -> dict[str, object]:
        """The map, as a YAML document has it."""
        return {**self.options, **{line.name: line.entry for line in self.lines}}


@dataclass(eq=False)
class Column:
    """One column of a table, with what its name says and its numbers."""

    number: int
    name: str
    stated: Stated
    role: Role
    values: Float64Array  # (n,) NaN where there is no number
    key: str | int = ""  # how a map names it
    remark: str = ""  # what the file says of it in prose
    by_habit: bool = False  # whether its unit is what the program that wrote it publishes for such a name
    missing: float | None = None  # the number that stood for NaN among `values`
    turn: float | None = None  # after which they begin anew, where negative numbers were written as unsigned
    factor: float = 1.0  # by which its numbers were multiplied here, as the file says of them
    offset: float = 0.0  # that was added then
    bare_name: str = ""  # its name without what only says that its numbers are converted
    spoilt: str = ""  # a clause on what stands in it that is no number, where most of it is, or on lists

    @property
    def shown(self) -> str:
        """How a message names it."""
        return f"column '{self.name}'" if self.name else f"column {self.number}"

    @property
    def unit(self) -> str:
        """The unit that its name says, as a map has it; empty where it says none."""
        return self.stated.unit_text

    @property
    def moves(self) -> bool:
        """Whether it has numbers enough, and they are not all the same."""
        known = self.values[np.isfinite(self.values)]
        return known.size > LEAST_SHARE * self.values.size and float(np.ptp(known)) > 0.0

    @property
    def rank(self) -> tuple[int, ...]:
        """How well it fits what its role is, beside others of that role."""
        stated = self.stated
        electrical = stated.any_of("electrical", "elec", "erpm")
        linear = stated.unit is not None and stated.unit.quantity == "linear_speed"
        second = (
            linear
            or stated.unit_text.lower() == "hz"
            or stated.has("derived", "linear")
            or stated.any_of("load", "output", "gear", "left", "right")
        )
        whole = stated.unit is not None and not stated.unit.per
        elsewhere = stated.has("other_machine" if self.role == "speed" else "other_load")
        return (
            int(self.name in READABLE_COLUMNS), int(not second), int(not stated.has("aside")),
            int(not elsewhere or stated.has("machine")), int(not electrical),
            int(stated.has("torque_axis")), int(not stated.has("supply")), int(not self.is_of_a_phase),
            int(stated.has("machine")), int(stated.has("raw")), int(whole),
        )  # fmt: skip

    @property
    def is_of_a_phase(self) -> bool:
        """Whether its name says that it is of one phase of a motor: `phase_current`, `Strangstrom U`, `Ia`."""
        bare = re.sub(r"[\W_]", "", _TAIL.sub("", self.name).lower())  # in `I [A] mA` no letter says which phase
        named = any(len(word) > _SYMBOL or word in bare for word in self.stated.words & WORDS["phase"])
        return named and not self.stated.has("torque_axis", "armature")

    @property
    def says_backward(self) -> bool:
        """Whether a column of directions says that the higher of its numbers is the negative one."""
        return _HIGHER_IS_BACKWARD.search(self.remark) is not None

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
        if more.get("sign_of") is not None and more.pop("backward", False):
            more = {"scale": -1.0, **more}
        if _REVERSED.search(self.remark) and self.role in ("speed", "current"):
            more = {"scale": -1.0, **more}
        if self.factor != 1.0 or self.offset:
            more = self._converted(unit, more)
        return {
            "column": self.key,
            **({"unit": unit} if unit else {}),
            **({} if self.missing is None else {"missing": self.missing}),
            **({} if self.turn is None else {"wrap": self.turn}),
            **{k: v for k, v in more.items() if v is not None},
        }

    def _converted(self, unit: str, more: dict[str, object]) -> dict[str, object]:
        """Further keys of an entry, whose `scale` and `offset` make of the counts what was meant in `unit`."""
        known, scale, wrap = unit_of(unit) or Unit("other"), more.get("scale") or 1.0, more.get("wrap")
        per = more.get(known.per) or 1.0
        if isinstance(scale, float | int) and isinstance(per, float | int):
            # A map's value is scale * (factor of the unit * column + its offset) + offset.
            shift = scale * (known.factor / per * self.offset + known.offset * (1.0 - self.factor))
            more |= {"scale": float(f"{scale * self.factor:.12g}"), "offset": float(f"{shift:.12g}") or None}
        return more | ({"wrap": float(f"{wrap / self.factor:.12g}")} if isinstance(wrap, float | int) else {})


def columns_of(table: RawTable) -> list[Column]:
    """The columns that hold numbers, each with its role; a stamp's numbers are seconds."""
    found = []
    remarks = {**_dictionary(table), **table.remarks}
    units, factors = stated_in_columns(table)
    units, factors = {**units, **table.units}, {**factors, **table.factors}
    repeated = {name for name in table.names if table.names.count(name) > 1}
    for number, name in enumerate(table.names):
        habit, own = habitual_unit(name, table.names), stated_by(name)
        own = own._replace(unit_text="", unit=None) if unit_among(name, table.names) else own
        stated = own.in_unit(units.get(name) or habit).with_remark(remarks.get(name, ""))
        if stated.unit_text == "c" and {f"{name[:-1]}{other}" for other in "abd"} & {*table.names}:
            stated = stated._replace(unit_text="", unit=None)  # the third of several sensors
        values = table.numbers(number, stamps=True)
        if habit[:1].isdigit() and np.any(values % 1.0 > 0.0):  # hundredths, say, that somebody has converted
            habit, stated = "", stated._replace(unit_text="", unit=None) if stated.unit_text == habit else stated
        key: str | int = name if name and name not in repeated else number
        remark = remarks.get(name, "")
        role = role_of(stated) if name and name not in table.parts_of_time else "other"
        if role == "speed" and stated.unit is None and _counts_rows(values):
            role = "count"
        by_habit = own.unit is None and not units.get(name) and bool(habit)
        mark = mark_of_missing(values) if role not in _COUNTING else None
        values = values if mark is None else np.where(values == mark, np.nan, values)
        unsigned = unsigned_turn(values) if role in _SIGNED else None
        turn = unsigned[0] if unsigned else None
        values = values if turn is None else np.where(values > 0.5 * turn, values - turn, values)
        factor, offset, more = _factor_of(factors.get(name, Factor("", "")), values, role)
        remark = "; ".join(filter(None, (remark, more)))
        bare = spoken(name) if spoken(name) != name else ""
        values = values if (factor, offset) == (1.0, 0.0) else factor * values + offset
        found.append(
            Column(number, name, stated, role, values, key, remark, by_habit, mark, turn, factor, offset, bare)
        )
    for column in found:
        if column.role in _READ and table.is_text(column.number) and not np.isfinite(column.values).any():
            column.spoilt = _spoilt(table, column.number)
    return _without_terms(_without_raw(found))


def _spoilt(table: RawTable, number: int) -> str:
    """A clause on the first cell of a column of words that is no number, where most are; or on lists in it."""
    cells = [str(cell or "") for cell in table.cells(number)]
    odd = [row for row, cell in enumerate(cells) if number_or_none(cell) is None]
    if odd and len(odd) < LEAST_SHARE * len(cells):
        return f"has {cells[odd[0]]!r} in {table.place(odd[0])}, which is no number: leave the cell empty for a gap"
    lists = [cell for cell in cells if cell.strip().startswith("[")]
    stated = f"holds lists, such as {lists[0]!r}: a column for each value is needed" if lists else ""
    return stated if len(lists) > LEAST_SHARE * len(cells) else ""


def _factor_of(stated: Factor, values: Float64Array, role: Role) -> tuple[float, float, str]:
    """By what a file says that numbers (n,) are multiplied and what is added, where they are counts as yet.

    Else 1 and 0, and what it says.
    """
    factor, offset = (number_or_none(text or usual) for text, usual in ((stated.factor, "1"), (stated.offset, "0")))
    if (factor, offset) == (1.0, 0.0):
        return 1.0, 0.0, ""
    unsure = (1.0, 0.0, f"factor {stated.factor or 1}, offset {stated.offset or 0}")
    if not factor or offset is None or not np.isfinite([factor, offset]).all() or (offset and not stated.is_added):
        return unsure
    usual = role not in ("angle", "count", "other") and are_counts(values, factor)
    return (factor, offset, "") if usual else unsure


def are_counts(values: Float64Array, factor: float) -> bool:
    """Whether numbers (n,) are to be multiplied still: whole, and not all multiples of the factor, as products are."""
    known = values[np.isfinite(values)]
    return bool(np.all(known == np.round(known))) and (abs(factor) <= 1.0 or bool(np.any(known % factor)))


def _without_raw(columns: list[Column]) -> list[Column]:
    """The columns, with no role for counts beside what they were converted to: `RW_SPEED(RAW)`, `RW_SPEED(U) [RPM]`."""
    raw = {match["of"]: c for c in columns if c.stated.unit is None and (match := _RAW.fullmatch(c.name)) is not None}
    for column in columns:
        counts = raw.get(_TAIL.sub("", column.name)) if column.stated.unit is not None else None
        if counts is not None:
            counts.role, column.bare_name = "other", _CONVERTED.sub("", column.name)
    return columns


def _without_terms(columns: list[Column]) -> list[Column]:
    """The columns, no current among them that has the other terms of its controller beside it: `I` beside `P` and `D`.

    Beside a voltage, `P` alone is a power.
    """
    bare = {c.name for c in columns if c.stated.unit is None}
    volts = any(c.role in ("voltage", "bus_voltage") and c.name != "u" for c in columns)
    for column in columns:
        if column.role != "current" or not may_be_a_term(column.stated):
            continue
        terms = [_LETTER_I.sub(letter, column.name) for letter in ("PD" if "I" in column.name else "pd")]
        beside = [term for term in terms if term != column.name and term in bare]
        if len(beside) > volts:
            column.role = "term"
    return columns


def stated_in_columns(table: RawTable) -> tuple[dict[str, str], dict[str, Factor]]:
    """Units and factors that a column beside another has: `speed_unit`, `speed_scale`.

    A factor is no number where it changes, or where the other's name has a unit too (`speed_rpm`): that is asked about.
    """
    units: dict[str, str] = {}
    factors: dict[str, Factor] = {}
    for index, name in enumerate(table.names):
        owner = re.sub(r"[ _]units?$", "", name, flags=re.IGNORECASE)
        stated = table.distinct(index, 1) if owner != name and table.is_text(index) else []
        if stated:
            units |= {other: stated[0] for other in table.names if other in (owner, f"{owner}_value")}
        owner, kind = owner_of(name)
        owned = [other for other in table.names if _is_of(owner, other)] if kind == "factor" and owner else []
        text = "/".join(table.distinct(index, 2)) if owned else ""
        factors |= {other: Factor(text if other == owner and text else f"{text} in {name}", "") for other in owned}
    return units, factors


def _is_of(owner: str, name: str) -> bool:
    """Whether a name is another, or that with a unit behind it: `speed_rpm` is a `speed`."""
    rest = name.removeprefix(owner) if name.startswith(owner) else "?"
    return not rest or (rest[0] in "_ .[(" and unit_of(rest) is not None)


def _counts_rows(values: Float64Array) -> bool:
    return values.size > 2 and bool(np.all(np.diff(values) == 1.0))


def _dictionary(table: RawTable) -> dict[str, str]:
    """What lines above the names say of columns: `# i   motor current, signed [mA]`; `omega: wheel rate (rad/s)`."""
    found: dict[str, str] = {}
    for line in table.preamble:
        matches = [[_DEFINED.fullmatch(text) for text in texts] for texts in (_CLAUSE.split(line), [line])]
        several, whole = ([m for m in each if m is not None and m["name"] in table.names] for each in matches)
        for match in several if len(several) > 1 else whole:  # `time in ms, speed in rpm`
            found.setdefault(match["name"], match["text"])
    return found


def best_of(candidates: Sequence[Column]) -> list[Column]:
    """Those that fit best: one, or several that fit as well."""
    top = max((column.rank for column in candidates), default=())
    return [column for column in candidates if column.rank == top]


def chosen(
    candidates: Sequence[Column], what: str, name: str, guess: Guess, line_of: Callable[[Column], Line | None]
) -> Column | None:
    """The one that fits best; a question where two fit as well. None where there is none, or it becomes a question.

    line_of: the line of one of them, None where its unit is the next question.
    """
    best = best_of(candidates)
    if len(best) > 1:
        shown = ", ".join(column.shown for column in best[:4])
        answers = [line for line in map(line_of, best) if line is not None]
        whole = len(answers) == len(best)
        how = "" if whole else f" --set {name.partition('_')[0]}=COLUMN."
        text = f"{shown}: which of them is the {what}?{how}"
        guess.ask(name, text, *(answers if whole else ()))
    return best[0] if len(best) == 1 else None
