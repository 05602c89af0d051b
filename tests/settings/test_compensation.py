"""The compensation section: absent it changes nothing, and what does not fit is found with its place."""

from __future__ import annotations

from pathlib import Path

import pytest

from rw_ekf.control.compensation.schemes import SCHEMES, WheelSheet
from rw_ekf.model.friction import GAUSS, Stribeck
from rw_ekf.model.state import CK13_STATISTICAL
from rw_ekf.settings.schema import RUN_SCHEMES
from tests.settings.test_load import LEAST, findings, load

SOCKET = LEAST + "command: {profile: zero}\n"


def test_without_the_section_nothing_is_compensated(tmp_path: Path) -> None:
    """Absent, empty and null are the same: no scheme, and no torque is taken."""
    assert load(tmp_path, LEAST).compensation.scheme is None
    assert load(tmp_path, LEAST + "compensation:\n") == load(tmp_path, LEAST)
    assert load(tmp_path, LEAST + "compensation: {scheme: null}\n") == load(tmp_path, LEAST)
    assert not load(tmp_path, LEAST).takes_torques
    assert load(tmp_path, SOCKET + "compensation: {scheme: dmc}\n").takes_torques
    assert not load(tmp_path, LEAST + "compensation: {scheme: dmc, request: profile}\n").takes_torques


@pytest.mark.parametrize(
    ("text", "place", "words"),
    [
        (SOCKET + "compensation: {scheme: dcm}", "4:24", "compensation.scheme must be one of"),
        (SOCKET + "compensation: {scheme: dcm}", "4:24", "did you mean 'dmc'?"),
        (SOCKET + "compensation: {scheme: speed_mode}", "4:24", "compensation.scheme must be one of"),
        (SOCKET + "compensation: {schema: dmc}", "4:16", "unknown key compensation.schema; did you mean 'scheme'?"),
        (SOCKET + "compensation: {scheme: dmc, request: sockets}", "4:38", "did you mean 'socket'?"),
        (SOCKET + "compensation: {scheme: dmc, fade_s: 0}", "4:37", "compensation.fade_s must be above 0"),
        (SOCKET + "compensation: {scheme: dmc, limit_A: 0.7}", "4:38", "limits.current_A 0.6 A (wheel.yaml:2:21)"),
        (SOCKET + "compensation: {scheme: dmc, stale_s: 0.1}", "4:38", "must exceed one loop period, 0.1 s"),
        (LEAST + "compensation: {scheme: dmc}", "3:24", "is socket, but command.profile is sine: set it to zero"),
        (LEAST + "compensation: {scheme: dmc, request: log}", "3:24", "compensation.request is log, but"),
        (
            LEAST + "command: {profile: log, log: map.yaml}\ncompensation: {scheme: dmc, request: profile}",
            "3:20",
            "set compensation.request to log",
        ),
        (LEAST + "command: {profile: none}\ncompensation: {scheme: dmc}", "4:24", "which never writes: drop one"),
        (
            LEAST + "compensation: {scheme: dmc, request: profile, socket: here.sock}",
            "3:55",
            "compensation.socket is given but compensation.request is profile: drop the socket",
        ),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_found_with_its_place(tmp_path: Path, text: str, place: str, words: str) -> None:
    """One finding, file:line:column, what was found and what to do."""
    (found,) = findings(tmp_path, text + "\n")
    assert found.startswith(f"wheel.yaml:{place}: ")
    assert words in found.replace(f"{tmp_path}/", "")


def test_every_scheme_that_a_run_takes_works_at_the_loop_s_rate() -> None:
    """Of the registry, none with a loop inside the wheel and none with parameters that only the bench has."""
    sheet = WheelSheet(CK13_STATISTICAL, Stribeck(0.42, GAUSS))
    for entry in (SCHEMES[name] for name in RUN_SCHEMES):
        assert entry.inner_rate_hz is None
        assert entry.parameters_from in ("none", "estimator")
        assert entry.make(sheet) is not entry.make(sheet)
