"""Faults as a user writes them: `drop:0.1`, `freeze@30s:5s`, `delay/from:60ms:1/3@10s:20s:60s`.

KIND[/to|/from|/REGISTER][:AMOUNT[:AMOUNT]][@START[:LASTS[:PERIOD]]]
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any

from rw_ekf.drivers.sim.faults import CABLE, FROM, KINDS, LINE, TO, WHEEL, Fault, FaultKind, Share
from rw_ekf.errors import BadInputError
from rw_ekf.units import seconds_from

_SHOWN = {
    "share": "SHARE (0.1, 10% or 1/3: exactly every third)",
    "time": "TIME (16ms, 5s, 2m, 1h)",
    "count": "a whole number",
    "number": "a number",
    "name": "the name of a field",
    "value": "FIELD=NUMBER (nan and inf too)",
}


def parse_faults(texts: Iterable[str]) -> tuple[Fault, ...]:
    """The faults of texts that each hold some, separated by commas. Raises BadInputError naming the wrong word."""
    return tuple(parse_fault(part) for text in texts for part in text.split(","))


def parse_bus_faults(
    texts: Iterable[str], names: Sequence[str]
) -> tuple[tuple[Fault, ...], dict[str, tuple[Fault, ...]]]:
    """The faults of a line with several wheels: those of the line, and by name those of each wheel.

    `NAME=FAULT` is of that wheel alone: one of the wheel itself, or its silence. Without a name, those of a line and
    its port are of the line, others of every wheel. Raises BadInputError as parse_faults.
    """
    of_line: list[Fault] = []
    of_wheel: dict[str, list[Fault]] = {name: [] for name in names}
    for part in (part.strip() for text in texts for part in text.split(",")):
        name, equals, rest = part.partition("=")
        if not equals or name not in of_wheel:
            fault = parse_fault(part)
            for faults in of_wheel.values() if KINDS[fault.kind].place == WHEEL else (of_line,):
                faults.append(fault)
            continue
        fault = parse_fault(rest)
        if KINDS[fault.kind].place != WHEEL and fault.kind != "silence":
            raise BadInputError(
                f"--fault {part!r}: {fault.kind} is a fault of the line, which all wheels share: leave {name}= out"
            )
        of_wheel[name].append(fault)
    return tuple(of_line), {name: tuple(faults) for name, faults in of_wheel.items()}


def parse_fault(text: str) -> Fault:
    """One fault. Raises BadInputError naming the wrong word, and what is known."""
    text = text.strip()
    head, at, schedule = text.partition("@")
    words = head.split(":")
    kind_word, *qualifiers = words[0].split("/")
    kind = KINDS.get(kind_word)
    if kind is None:
        raise BadInputError(f"--fault {text!r}: there is no fault {kind_word!r}; there are: {', '.join(KINDS)}")
    way, register = _qualified(text, kind_word, kind, qualifiers)
    fields = {"way": way, "register": register, "text": text} | _amounts(text, kind_word, kind, words[1:])
    if at:
        fields |= _schedule(text, kind_word, schedule)
    return Fault(kind_word, **fields)


def describe_faults() -> list[str]:
    """One line for each kind: how it is written with its defaults, and what it does."""
    return [f"{written(word)}  {kind.what}" for word, kind in KINDS.items()]


def fault_documents() -> list[dict[str, str]]:
    """The same as a document has them."""
    return [{"fault": word, "default": written(word), "meaning": kind.what} for word, kind in KINDS.items()]


def written(word: str) -> str:
    """A kind with its amounts' defaults, as one may write it."""
    kind = KINDS[word]
    way = f"/{kind.way}" if kind.way in (TO, FROM) else ""
    return word + way + "".join(f":{_default(sort, value)}" for sort, value in kind.amounts.items())


def _default(sort: str, value: Any) -> str:
    if sort == "share":
        return f"{value.probability:g}"
    if sort == "time":
        return f"{value:g}s" if value == 0.0 or value >= 1.0 else f"{1e3 * value:g}ms"
    return "speed=nan" if sort == "value" else f"{value:g}" if isinstance(value, float) else str(value)


def _qualified(text: str, word: str, kind: FaultKind, qualifiers: list[str]) -> tuple[str | None, str | None]:
    """Way and register of a fault."""
    way, register = kind.way, None
    for qualifier in qualifiers:
        if qualifier in (TO, FROM) and kind.way is not None:
            way = qualifier
        elif qualifier in ("", TO, FROM) or kind.place == CABLE:
            what = "direction" if qualifier in (TO, FROM) else "register"
            raise BadInputError(f"--fault {text!r}: {word} takes no {what}, here {qualifier!r}; leave it out")
        else:
            register = qualifier
    if register is not None and kind.place == LINE:
        if TO in qualifiers or kind.way is None:
            raise BadInputError(f"--fault {text!r}: on the line only replies are known by register, here {register!r}")
        way = FROM
    return way, register


def _amounts(text: str, word: str, kind: FaultKind, given: list[str]) -> dict[str, Any]:
    """The amounts of a fault, those left out by default."""
    if len(given) > len(kind.amounts):
        takes = " and ".join(_SHOWN[sort] for sort in kind.amounts) or "no amount"
        raise BadInputError(f"--fault {text!r}: {given[len(kind.amounts)]!r} is one too many: {word} takes {takes}")
    found: dict[str, Any] = {}
    for (sort, default), amount in zip(kind.amounts.items(), [*given, *[""] * len(kind.amounts)], strict=False):
        value = default if amount == "" else _amount(text, word, sort, amount)
        if value is None:
            raise BadInputError(f"--fault {text!r}: {word} needs {_SHOWN[sort]}, e.g. {written(word)}")
        if sort == "value":
            found["name"], found["number"] = value
        else:
            found["time_s" if sort == "time" else sort] = value
    return found


def _amount(text: str, word: str, sort: str, amount: str) -> Any:
    """One amount by its sort; None where it is not one."""
    value: Any = None
    if sort == "share":
        value = _share(amount)
    elif sort == "time":
        value = seconds_from(amount)
        value = None if value is not None and value < 0.0 and word != "clock" else value
    elif sort == "count":
        value = int(amount) if amount.isdecimal() else None
    elif sort == "number":
        value = _number(amount)
        value = None if value is None or not math.isfinite(value) else value
    elif sort == "name":
        value = amount if amount.isidentifier() else None
    elif sort == "value":
        name, _, number = amount.partition("=")
        value = None if not name.isidentifier() or _number(number) is None else (name, _number(number))
    if value is None:
        raise BadInputError(f"--fault {text!r}: {amount!r} is not {_SHOWN[sort]}, which {word} takes here")
    return value


def _schedule(text: str, word: str, schedule: str) -> dict[str, float]:
    """Start, length and period."""
    names = ("start_s", "lasts_s", "period_s")
    parts = schedule.split(":")
    if len(parts) > len(names):
        raise BadInputError(f"--fault {text!r}: {parts[3]!r} is one too many: write @START[:LASTS[:PERIOD]]")
    times: dict[str, float] = {}
    for name, part in zip(names, parts, strict=False):
        value = seconds_from(part)
        if value is None or value < 0.0 or (name == "period_s" and value == 0.0):
            raise BadInputError(f"--fault {text!r}: {part!r} is not a time of a schedule, e.g. @30s:5s:1min")
        times[name] = value
    lasts_s, period_s = times.get("lasts_s", math.inf), times.get("period_s", math.inf)
    if lasts_s > period_s:
        raise BadInputError(f"--fault {text!r}: {word} lasts {lasts_s:g} s, longer than its period of {period_s:g} s")
    return times


def _share(text: str) -> Share | None:
    one, slash, of = text.partition("/")
    if slash:
        return Share(1.0 / int(of), int(of)) if one == "1" and of.isdecimal() and int(of) > 0 else None
    value = _number(text.removesuffix("%"))
    if value is None:
        return None
    value *= 0.01 if text.endswith("%") else 1.0
    return Share(value) if 0.0 <= value <= 1.0 else None


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None
