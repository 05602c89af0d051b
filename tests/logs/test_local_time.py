"""Dates without a zone as the clocks of a place have them: in UTC, over the hours that are left out and come twice."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any
from zoneinfo import ZoneInfo

import numpy as np
import pytest

import rw_ekf
from rw_ekf.logs.local_time import utc_of_local, zone_of

BERLIN = ZoneInfo("Europe/Berlin")
N = 100
SPEED = np.linspace(-3.0, 5.0, N)
CURRENT = np.where(np.arange(N) % 20 < 10, 0.2, -0.1)


def moments(begin: datetime, step_s: float = 0.5) -> list[datetime]:
    """N moments of a run that begins then."""
    return [begin + timedelta(seconds=step_s * row) for row in range(N)]


def written(path: Path, stamps: list[str]) -> Path:
    """A log with these stamps in its column of time."""
    rows = zip(stamps, SPEED, CURRENT, strict=True)
    path.write_text(
        "timestamp,speed_rad_s,current_A\n" + "".join(f"{stamp},{w:.4f},{i:.2f}\n" for stamp, w, i in rows),
        encoding="utf-8",
    )
    return path


def test_local_stamps_in_summer_time_become_utc(tmp_path: Path) -> None:
    """Two hours less in Berlin's July than the same stamps in UTC, and one in January; a zone of their own counts."""
    for begin, ahead_h in ((datetime(2026, 7, 1, 12), 2), (datetime(2026, 1, 1, 12), 1)):
        log = written(tmp_path / "log.csv", [one.isoformat(sep=" ", timespec="milliseconds") for one in moments(begin)])
        here, as_utc = rw_ekf.read(log, None, "Europe/Berlin"), rw_ekf.read(log)
        assert here.time_s[0] == (begin - timedelta(hours=ahead_h)).replace(tzinfo=UTC).timestamp()
        assert np.allclose(as_utc.time_s - here.time_s, 3600.0 * ahead_h, atol=1e-6)
        zoned = written(
            tmp_path / "zoned.csv", [f"{one.isoformat(timespec='milliseconds')}Z" for one in moments(begin)]
        )
        assert np.array_equal(rw_ekf.read(zoned, time_zone="Europe/Berlin").time_s, as_utc.time_s)


def test_tables_and_arrays_of_dates_are_taken_in_the_zone_too() -> None:
    """Arrow's timestamps without a zone and numpy's dates: as the text."""
    begin = datetime(2026, 7, 1, 12)
    dates = np.array(moments(begin), dtype="datetime64[ms]")
    wanted = (begin - timedelta(hours=2)).replace(tzinfo=UTC).timestamp()
    of_table = rw_ekf.read({"time_s": dates, "speed_rad_s": SPEED, "current_A": CURRENT}, time_zone="Europe/Berlin")
    of_arrays = rw_ekf.read(time_s=dates, speed_rad_s=SPEED, current_A=CURRENT, time_zone="Europe/Berlin")
    assert of_table.time_s[0] == of_arrays.time_s[0] == wanted


def test_a_run_over_the_end_of_summer_time_goes_on(tmp_path: Path) -> None:
    """Its clock falls back from 3:00 to 2:00: in UTC a row every half second, and none is skipped."""
    begin = datetime(2026, 10, 25, 0, 59, 40, tzinfo=UTC)
    local = [one.astimezone(BERLIN).replace(tzinfo=None) for one in moments(begin)]
    log = written(tmp_path / "log.csv", [one.isoformat(sep=" ", timespec="milliseconds") for one in local])
    found = rw_ekf.read(log, time_zone="Europe/Berlin")
    assert len(found) == N
    assert np.allclose(found.time_s, [one.timestamp() for one in moments(begin)], atol=1e-6)


def test_years_of_stamps_are_what_zoneinfo_makes_of_each() -> None:
    """A stamp each 10 min of two years, both changes of the clocks among them; what is missing stays so."""
    utc_s = datetime(2025, 1, 1, tzinfo=UTC).timestamp() + 600.0 * np.arange(105_000)
    wall_s = np.array([one + BERLIN.utcoffset(datetime.fromtimestamp(one, BERLIN)).total_seconds() for one in utc_s])  # type: ignore[union-attr]
    assert np.array_equal(utc_of_local(wall_s, BERLIN), utc_s)
    assert np.isnan(utc_of_local(np.array([np.nan]), BERLIN)).all()


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("Europe/Berln", "did you mean 'Europe/Berlin'"),
        ("Europe", "is no time zone of the IANA database"),
        ("../etc", "is no time zone"),
        ("", "is no time zone"),
        (2, "is no time zone"),
    ],
)
def test_a_zone_that_is_none_is_refused(name: object, words: str) -> None:
    """By its name, with the nearest one."""
    with pytest.raises(rw_ekf.Error, match=f"time_zone: {name!r} is no time zone.*{words}|{words}"):
        zone_of(name)  # type: ignore[arg-type]


def test_arrays_by_name_are_read_as_from_arrays_reads_them() -> None:
    """The same log; what does not go with them, and nothing at all, is an error of the package."""
    arrays: dict[str, Any] = {"speed_rad_s": SPEED, "current_A": CURRENT}
    time_s = 0.1 * np.arange(N)
    assert rw_ekf.read(time_s=time_s, **arrays).to_json() == rw_ekf.Log.from_arrays(time_s, **arrays).to_json()
    given: Any
    for given, words in (
        ({}, "read: a log is wanted: a path, a table, or arrays by name"),
        ({"source": "x.csv", "colums": "map.yaml"}, r"source and arrays by name \(colums\) do not go together"),
        ({"time_s": time_s, "wheel": 2}, "wheel and arrays by name"),
        (arrays, "time_s"),
    ):
        with pytest.raises(rw_ekf.Error, match=words):
            rw_ekf.read(**given)
