"""What a column's name says: the words of labs in several languages, and the unit that stands with them."""

from __future__ import annotations

import itertools
import re
import unicodedata
from typing import Literal, NamedTuple

from rw_ekf.logs.column_units import Unit, plain_spelling, unit_of
from rw_ekf.logs.column_words import SIGNS, WORDS

Role = Literal[
    "time", "speed", "speed_set", "angle", "current", "current_set", "torque", "force", "voltage", "share",
    "temperature", "pressure", "bus_voltage", "direction", "segment", "count", "term", "other",
]  # fmt: skip

_IN_BRACKETS = re.compile(r"[\s_.,:-]*[\[(<{](?P<unit>[^\[\](){}<>]*)[\])>}]\s*")
_SPOKEN = re.compile(r"^(?P<name>.+?)(?:\s+in\s+|\s*/\s+|\s+/\s*|,\s*)(?P<unit>[^\s,]+)$")


_ENDS = (
    "strom", "drehzahl", "temperatur", "spannung", "moment", "winkel", "geschwindigkeit", "istwert", "sollwert",
    "begrenzung",
)  # fmt: skip
_OF_PROSE = frozenset(
    {"in", "input", "line", "source", "total", "main", "charge", "m", "max", "min", "limit"}
)  # mean nothing
_WHICH_WAY = frozenset({"direction", "richtung", "drehrichtung", "sens", "sentido", "senso", "dir"})
_FEW = 2  # words of a name beside which a letter may be a symbol
_QUALIFIED = re.compile(
    r"(?P<name>.*[_ ].*)[_ .]"
    r"(?P<last>filt|filtered|raw|mean|avg|lp|meas|measured|act|est|med|data|values?|hex|u?int\d*|[uif]\d+)",
    re.I,
)
_EVERY = re.compile(  # an interval is no unit: counts_per_100ms; behind a stroke only one of counts, ticks and the like
    r"(?:(?<![A-Za-z])(?:every|each|per|over|within|alle|je|pro)|(?<=nts|unt|cnt|cks|ick|inc|ses|ges)\s*/)"
    r"[\s_]*\d+(?:[.,]\d+)?[\s_]*[mun]?s(?:ec)?(?![A-Za-z])",
    re.IGNORECASE,
)
# A limit or a setting, and no unit of the numbers: `speed: 6000 rpm`; of a power of ten it is one, `0.1 rpm`.
_AMOUNT = re.compile(r"(?<![\w.])(?!(?:0?\.0*1|10*)\s)[+-]?\d[\d.,]*\s+(?!by|of|to)[A-Za-z°µ%][\w/°%^-]*")
_STARRED = re.compile(r"(\w)\*(?!\w)")  # n*: what is wanted, in the notation of drives
_DERIVATIVE = re.compile(r"\bder\(")  # of what stands behind it, in Modelica
_SECOND = re.compile(r"(?<![A-Za-z])d2(?=[A-Za-z])")  # derivative of what stands behind it: d2theta_dt2
_RATES = frozenset({"thetadot", "phidot", "qdot"})  # of an angle, which are speeds; any other dot is no speed
_ACCELERATIONS = frozenset({"dd", "dotdot", "doubledot"})
_TIMES = re.compile(r"(?<=\w)[_ ]?[x×]_?10+$", re.IGNORECASE)  # behind the unit: current_A_x100, which is asked about
_PRESENT = re.compile(  # the one of now, and no ampere: current_speed, current_time
    r"(?<![A-Za-z])current[_ ]?(?=(?:time|speed|vel|pos|angle|rpm|temp|torque|state|volt|date)[a-z]*(?![a-z]))",
    re.IGNORECASE,
)
_LAST_INDEX = re.compile(r"(?<=\w)\[\d{1,3}\]$")  # current_A[0], of one among several
_LEVELS = re.compile(r"'([^']*)'")
_CUT = re.compile(r"([a-z0-9])([A-Z])")
_ELISION = re.compile(r"(?<![A-Za-z])[dl]['\u2019](?=[^\W\d_]{2})", re.IGNORECASE)  # courant d'entrée: no d axis
_LONGEST_FIRST = sorted(SIGNS.items(), key=lambda pair: -len(pair[0]))
_COMPOUND = re.compile(r"[\u3040-\u30ff\u4e00-\u9fff\uac00-\ud7af]+")  # of signs, which stand together as words do


class Stated(NamedTuple):
    """What a name says."""

    words: frozenset[str]
    unit_text: str  # as it stands there; empty: none
    unit: Unit | None
    odd_part: str = (
        ""  # what a compound begins with and no list of words has: the Heiz of Heizstrom, the 励磁 of 励磁电流
    )

    def in_unit(self, text: str) -> Stated:
        """The same with the unit that a file has beside the name, where the name has none."""
        unit = unit_of(text) if text and self.unit is None else None
        return self if unit is None else self._replace(unit_text=text, unit=unit)

    def with_remark(self, remark: str) -> Stated:
        """The same with the unit that a remark ends with, where it has none, and its words, where it says no role.

        A remark is prose: `motor current, mA`; `wheel rate (rad/s)`; `bench clock in microseconds`.
        """
        if not remark:
            return self
        remark = _AMOUNT.sub(" ", _EVERY.sub("", remark))
        stated = self.in_unit(unit_in_prose(remark))
        if stated.unit is None and (spoken := stated_by(remark)).unit is not None:
            stated = self._replace(unit_text=spoken.unit_text, unit=spoken.unit)
        more = stated_by(remark).words
        if role_of(self._replace(unit=None)) != "other":  # then only what distinguishes it from others of its role
            more &= (WORDS["supply"] | WORDS["machine"] | WORDS["set"] | WORDS["derived"]) - _OF_PROSE
        return stated._replace(words=stated.words | more)

    def has(self, *groups: str) -> bool:
        """Whether one of the words belongs to one of the groups."""
        return any(self.words & WORDS[group] for group in groups)

    @property
    def says_time(self) -> bool:
        """Whether one of the words is a time's, in one piece or at its end: Laufzeit, runtime."""
        letter = "t" in self.words and not self.has("machine", "derived", "supply", "bus", "place")  # of a temperature
        spelt = self.words & (WORDS["time"] - {"t"})
        return letter or bool(spelt) or any(word.endswith(("zeit", "time")) for word in self.words)

    def any_of(self, *words: str) -> bool:
        """Whether one of these words is among them."""
        return bool(self.words.intersection(words))


def spoken(name: str) -> str:
    """A name of several levels as words, where pandas wrote it as Python has it: `('rw1', 'speed_rpm')`."""
    levels = _LEVELS.findall(name) if name.startswith("('") and name.endswith(")") else []
    return " ".join(filter(None, levels)) or name


def stated_by(name: str) -> Stated:
    """Take a name apart."""
    name = spoken(name)
    name = _PRESENT.sub("", _LAST_INDEX.sub("", name))
    name = _TIMES.sub("", _SECOND.sub("ddot ", _DERIVATIVE.sub("derivative (", _EVERY.sub("", name))))
    bare, text, unit = _split(name.strip())
    if unit is None and (match := _QUALIFIED.fullmatch(name.strip())) is not None:  # omega_deg_s_filt
        bare, text, unit = _split(match["name"])
        bare = f"{bare} {match['last']}" if unit is not None else name.strip()
    bare = _STARRED.sub(r"\1 set", bare)
    if unit is None:  # in brackets, what is no word and no unit that is known says that it is something else
        bare = re.sub(r"[\[(<{][^\])>}]*[/%][^\])>}]*[\])>}]|[\[(<{].{0,2}[\])>}]", " ", bare)
    words = _words(bare)
    if len(re.findall(r"[^\W\d_]{2,}", _CUT.sub(r"\1 \2", bare))) > _FEW:
        words = [word for word in words if len(word) > 1]  # among many words a letter is no symbol
    return Stated(frozenset(words), text, unit, _odd_part(bare) if bare != text else "")


_STEMS = tuple(word for words in WORDS.values() for word in words if len(word) > 4)  # which languages bend


def words_unknown(name: str) -> list[str]:
    """The words of a name that no list has, where others are in one: they say of what it is, `laptop_current`."""
    bare, unit, _ = _split(spoken(name).strip())
    words = _parts(bare)
    unknown = [word for word in words if not any(map(_is_listed, _uncompounded(word))) and unit_of(word) is None]
    unknown = [word for word in unknown if not any(map(word.startswith, _STEMS))]  # mesurée
    some_known = len(unknown) < len(words) or _is_listed(unit.lower())  # as `rpm` is
    return [word for word in unknown if len(word) > _FEW] if some_known else []


def unit_in_prose(text: str) -> str:
    """The unit with which a remark ends, or which it has before its words: `A (measured)`; empty for none."""
    bracketed = re.search(r"[\[(]([^\])]*)[\])]\s*$", text)
    if bracketed is not None and (spelt := bracketed[1].replace(",", ".")) and unit_of(spelt) is not None:
        return spelt
    last = re.split(r"[,;:(\[]|\bin\b", text)[-1].strip(" .)]")
    first = re.split(r"[\s(\[]", text.strip())[0]
    return next((word for word in (last, first) if word and unit_of(word) is not None and word not in {"a", "d"}), "")


def _split(name: str) -> tuple[str, str, Unit | None]:
    """Name, unit as written, unit."""
    for match in (*reversed([*_IN_BRACKETS.finditer(name)]), _SPOKEN.match(name)):
        if match and match["unit"] and (unit := unit_of(match["unit"])) is not None:
            rest = "" if match.re is _SPOKEN else name[match.end() :]
            before = match["name"] if match.re is _SPOKEN else name[: match.start()]
            return f"{before} {rest}".strip() or name, match["unit"], unit
    whole = "_" not in name and (len(plain_spelling(name)) > 1 or name == "A")
    if whole and (unit := unit_of(name)) is not None:  # rad s^-1, of which s^-1 is one too
        return name, name, unit
    for cut in re.finditer(r"[\s_.\-]", name):  # the longest tail that is a unit: speed_rad_s, t ms
        tail = name[cut.end() :]
        for spelt in (tail.replace("_", "/"), tail, tail.replace("per", "/").replace("_", "")):
            unit = unit_of(spelt) if not spelt[:1].isdigit() or spelt == tail else None
            known = len(plain_spelling(spelt)) > 1 or spelt in {"s", "A", "V", "N"}
            if unit is not None and spelt != "arms" and (known or _is_degree(name[: cut.start()], spelt)):
                return name[: cut.start()], spelt, unit
    symbol, _, tail = name.partition("/")  # as a table of physics has it: t/ms, I/mA
    opened = any(bracket in symbol for bracket in "[({<")  # of `I [V/A]`, which is none of A
    if tail and not opened and unit_of(name) is None and (unit := unit_of(tail)) is not None:
        return symbol, tail, unit
    first = re.match(r"^(ms|us|millis|micros)[_ ](.+)$", name)
    if first and (unit := unit_of(first[1])) is not None:
        return f"{first[2]} time", first[1], unit
    camel = re.match(r"^(.*[a-z])(RPM|Rpm|MA|mA|Ms|Us|Deg|Rad|DegC|Nm|Volts?|Amps?|RadS|DegS|Rps|Dps)$", name)
    if camel and (unit := unit_of({"MA": "mA", "RadS": "rad/s", "DegS": "deg/s"}.get(camel[2], camel[2]))) is not None:
        return camel[1], camel[2], unit
    rate = re.match(r"^(.*[a-z])([A-Z][a-z]+)Per([A-Z][a-z]+)$", name)  # VelocityRadPerSec
    if rate and (unit := unit_of(f"{rate[2]}/{rate[3]}")) is not None:
        return rate[1], f"{rate[2]}/{rate[3]}", unit
    glued = re.match(r"^(.*[^\x00-\x7f])([A-Za-z/%]+)$", name)  # Chinese and the like: no blank before the unit
    if glued and (unit := unit_of(glued[2])) is not None:
        return glued[1], glued[2], unit
    return name, "", None


def _is_degree(name: str, letter: str) -> bool:
    """Whether a letter behind a name is a temperature's unit: T_C, t_case_C, Tcase_K, temp_F; not T_F of a friction."""
    words = set(_words(name))
    of_t = ("t" in words and (letter != "F" or len(words) > 1)) or re.search(r"(?<![A-Za-z])T[a-z]{2,}$", name)
    spelt = bool(words & WORDS["temperature"])
    return (letter in {"C", "K", "F"} and bool(of_t or spelt)) or (letter == "c" and spelt)


def _words(text: str) -> list[str]:
    """The words of a name, in small letters without accents; camel case and digits are cut."""
    text = _plain(text)
    whole = re.sub(r"[^A-Za-z0-9]+", "_", text).strip("_").lower()
    parts = [part for word in _parts(text) for part in _uncompounded(word)]
    return [*parts, whole, *("".join(pair) for pair in itertools.pairwise(parts))]


def _parts(text: str) -> list[str]:
    """What stands between digits, marks and changes of case, in small letters."""
    text = re.sub(r"([A-Z]+)([A-Z][a-z])", r"\1 \2", _CUT.sub(r"\1 \2", _plain(text)))
    return [word.lower() for word in re.split(r"[^A-Za-z]+", text) if word]


def _plain(text: str) -> str:
    """A text in Latin letters without accents."""
    text = unicodedata.normalize("NFKD", _in_letters(_ELISION.sub("", text)))
    return "".join(sign for sign in text if not unicodedata.combining(sign))


def _in_letters(text: str) -> str:
    """A text with the signs of other scripts as the words that they stand for, as far as these are known."""
    text = re.sub(r"[А-Яа-яЁё]+", lambda match: match[0].lower(), text)
    for signs, word in _LONGEST_FIRST:
        text = text.replace(signs, word)
    return text


def _uncompounded(word: str) -> list[str]:
    """A German compound with its parts behind it: netzteilstrom, netzteil, strom."""
    end = next((end for end in _ENDS if word.endswith(end) and len(word) > len(end) + 1), None)
    if end is None:
        return [word]
    return [word, *_uncompounded(word.removesuffix(end)), end]


def _odd_part(name: str) -> str:
    """The first part of a compound that is in no list, which says of what it is: a heater, a load, a friction."""
    text = _in_letters(name)
    parts = [match[0] for match in _COMPOUND.finditer(text)]
    for word in re.findall(r"[a-z]+", _CUT.sub(r"\1 \2", text).lower()):
        whole, *heads = _uncompounded(word)
        if heads and not _is_listed(whole):
            parts += [head for head in heads if head not in _ENDS and not _is_listed(head)]
    return next(iter(parts), "")


def _is_listed(word: str) -> bool:
    """Whether a list has a word, or has it without what German joins it with: drehzahls, momenten."""
    return any({word, word.removesuffix("s"), word.removesuffix("en")} & words for words in WORDS.values())


def role_of(stated: Stated) -> Role:
    """What a column is, by its unit first and then by its words; "other" where neither says."""
    if stated.has("neither") or (stated.unit is None and _is_changing(stated)):
        return "other"
    role = _by_words(stated) if stated.unit is None else _BY_QUANTITY.get(stated.unit.quantity, "other")
    if role == "other" and stated.unit is not None and _by_words(stated) == "direction":  # `Dir [-]`
        return "direction"
    if stated.unit is None and stated.any_of("derivative"):
        role = "speed" if role == "angle" else "other"
    if role == "time" and stated.unit is not None:  # a slip, a delay and a time constant may be in seconds too
        axis = {"x", "data", "x_data", "xdata"}  # of a plot; dSPACE's X.Data
        alone = stated.words <= {plain_spelling(stated.unit_text), stated.unit_text.lower(), *axis}
        return "time" if alone or stated.says_time or stated.any_of("tick", "ticks", "systick") else "other"
    if role == "current" and stated.has("direct") and not stated.any_of("q", "iq"):
        return "other"  # it magnetises, and turns nothing
    if role == "voltage" and stated.has("bus"):
        return "bus_voltage"
    if role == "current" and may_be_a_term(stated) and stated.has("controller"):  # pid_i, vel_i, I Term
        return "term"
    return _WANTED.get(role, role) if stated.has("set") else role


def may_be_a_term(stated: Stated) -> bool:
    """Whether only a letter says that a column is a current: what a controller has integrated has the same one."""
    by_letter = stated.words & WORDS["current"] == {"i"} and stated.unit is None
    return by_letter and not stated.has("torque_axis", "machine", "supply", "phase")


def _is_changing(stated: Stated) -> bool:
    """Whether the words are of an acceleration, or of how fast a speed or a current changes."""
    return bool(stated.words & _ACCELERATIONS) or (stated.any_of("dot") and not stated.words & _RATES)


_BY_QUANTITY: dict[str, Role] = {
    "time": "time", "speed": "speed", "linear_speed": "speed", "angle": "angle", "length": "angle",
    "current": "current", "torque": "torque", "force": "force", "voltage": "voltage", "temperature": "temperature",
    "pressure": "pressure", "share": "share",
}  # fmt: skip
_WANTED: dict[str, Role] = {"speed": "speed_set", "current": "current_set", "angle": "other"}
_IN_ORDER: tuple[Role, ...] = ("share", "torque", "force", "current", "speed", "voltage")


def _by_words(stated: Stated) -> Role:
    """What the words say, those first that never describe anything else."""
    for role in ("temperature", "pressure"):
        if stated.has(role):
            return role
    if stated.words & _WHICH_WAY or (stated.has("direction") and not stated.has("speed", "current")):
        return "direction"
    if stated.has("direct") and not stated.any_of("q"):
        return "other"
    for role in _IN_ORDER:
        if stated.has(role):
            return role
    if stated.any_of("vbat", "vbus", "vin", "ubat", "vdd"):
        return "bus_voltage"
    if stated.says_time:
        return "time"
    return next((role for role in ("angle", "segment", "count") if stated.has(role)), "other")
