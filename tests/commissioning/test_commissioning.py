"""Whole commissionings of simulated wheels over the real driver, on a virtual clock: ended, broken off, resumed."""

from __future__ import annotations

import signal
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import pytest

from rw_ekf.clock import VirtualClock
from rw_ekf.commissioning.dialogue import RefusedError, Stopped
from rw_ekf.commissioning.progress import STEPS, Progress
from rw_ekf.commissioning.step_context import Options
from rw_ekf.commissioning.step_order import commission
from rw_ekf.drivers.sim.virtual_line import VirtualCable
from rw_ekf.errors import BadInputError, ConfigError, DriverError
from rw_ekf.live.stop_signal import StopSignal
from rw_ekf.settings.load import load_configuration
from tests.contract import check_document
from tests.injecting import put_faults
from tests.live.bench import wire_map_of
from tools.measure.commission import Draw, Rig, carry_out, draw_wheel, options_of, rig_of, turned_backward

USUAL = Draw(
    0, "sunspace-wheel", gain=12.0, viscous=0.003, coulomb=0.5, static=0.6, scale=1.0, turned=(("speed", "read"),),
    noise_rpm=0.5, baud=57600, delay_s=0.0, has_tachometer=True,
)  # fmt: skip


def rig(draw: Draw, directory: Path, clock: VirtualClock, stop: StopSignal) -> Rig:
    """A commissioning of a drawn wheel in this directory."""
    return rig_of(draw, directory, clock, options_of(draw, directory), stop)


@dataclass
class BrokenOff:
    """A commissioning that signals ended in each of its steps, and that came to its end; what was so behind each."""

    out: Path
    made: Rig
    currents_A: list[float]  # in force, and written last
    steps: list[set[str]]  # done


@pytest.fixture(scope="module")
def broken_off(tmp_path_factory: pytest.TempPathFactory) -> BrokenOff:
    """Made once for the tests of it, which share a process."""
    directory = tmp_path_factory.mktemp("broken-off")
    lasts_s, currents_A = 11.0, []
    steps: list[set[str]] = []
    for _ in range(60):
        clock = VirtualClock()
        with StopSignal() as stop:
            made = rig(USUAL, directory, clock, stop)
            if not (steps[1:] and "delay" in steps[-2]):  # else one has struck the identification: ten minutes long
                clock.at(lasts_s, lambda stop=stop: stop.request("SIGTERM"))  # type: ignore[misc]
            try:
                commission(made.work)
                break
            except Stopped:
                lasts_s *= 1.3  # longer than any step, in the end
            currents_A += [made.plant.current_A, made.watched.last_A]
        steps.append({step for step in STEPS if Progress.of(directory / "out")[step] is not None})
    return BrokenOff(directory / "out", made, currents_A, steps)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("number", "family"), [(0, "sunspace-wheel"), (1, "nsp-wheel"), (9, "ascii-wheel"), (10, "odrive-ascii-wheel")]
)
def test_a_wheel_of_unknown_sign_and_scale_is_commissioned(number: int, family: str) -> None:
    """Registers, NSP, text, ODrive: a scale wrong by 60/2 pi, two or ten, signs turned; the model is the wheel's."""
    draw = draw_wheel(number, seed=3)
    assert draw.family == family
    assert draw.scale != 1.0
    assert draw.turned
    reported = carry_out(draw)
    assert (reported.verdict, reported.reason) == ("right", "")
    assert reported.wheel_minutes < 15.0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("family", "scale", "turned"),
    [
        ("can-wheel", 2.0, (("speed", "read"),)),
        ("vesc-wheel", 2.0, (("current_command", "write"),)),
    ],
)
def test_a_wheel_whose_telemetry_bears_commands_out_is_commissioned_through_a_mended_map(
    family: str, scale: float, turned: tuple[tuple[str, str], ...]
) -> None:
    """A scale twice what it should be, a sign of the speed or the command: the model is the true wheel's."""
    reported = carry_out(replace(USUAL, family=family, scale=scale, turned=turned))
    assert reported.verdict == "right", reported.reason


def test_a_search_leaves_out_the_maps_whose_library_is_not_installed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without cantools one line says what is left out, all other maps are tried; a CAN map that is named is refused."""
    monkeypatch.setitem(sys.modules, "cantools", None)
    monkeypatch.setitem(sys.modules, "cantools.database", None)
    with StopSignal() as stop:
        made = rig(USUAL, tmp_path, VirtualClock(), stop)
        stated: list[str] = []
        made.work.dialogue.say = lambda step, text: stated.append(text)  # type: ignore[method-assign]
        made.work.options = Options(str(tmp_path / "nowhere"))
        with pytest.raises(RefusedError, match="no port could be used"):
            commission(made.work)
        left_out, tried = stated
        assert left_out.startswith("can-wheel is left out: what reads a map of the family can is not installed (canto")
        assert "through ascii-wheel, nsp-wheel, " in tried
        assert "can-wheel" not in tried
        made.work.options = Options(str(tmp_path / "nowhere"), "can-wheel")
        with pytest.raises(ConfigError, match=r'not installed \(cantools\): pip install "rw-ekf\[can\]"'):
            commission(made.work)


def test_a_wheel_whose_clock_goes_twenty_times_as_fast_is_refused_for_its_clock(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As one that is served with --speed-factor 20: every reading came, and the line is not to blame."""
    now_s, next_in_s = VirtualCable.now_s, VirtualCable.next_in_s
    monkeypatch.setattr(VirtualCable, "now_s", lambda cable: 20.0 * now_s(cable))
    monkeypatch.setattr(VirtualCable, "next_in_s", lambda cable: next_in_s(cable) / 20.0)
    with StopSignal() as stop, pytest.raises(RefusedError, match=r"the wheel's clock went on by .*, 20 times as fast"):
        commission(rig(USUAL, tmp_path, VirtualClock(), stop).work)


@pytest.mark.slow
@pytest.mark.parametrize("access", ["write", "read"])
def test_a_command_that_telemetry_tells_the_opposite_of_has_its_sign_mended(tmp_path: Path, access: str) -> None:
    """The sign of what is written, or of the command as it is told: none counts as taken through the map given.

    The wheel is moved through a copy by which they are, and the right one of both is turned. All that follows is of the
    mended map alone, and the delay, the first that is measured through it, is that of a wheel without one.
    """
    draw = replace(USUAL, family="can-wheel", turned=(("current_command", access),))
    with StopSignal() as stop:
        made = rig(draw, tmp_path, VirtualClock(), stop)
        say = made.work.dialogue.say

        def say_and_stop(step: str, text: str) -> None:
            say(step, text)
            if step == "delay":
                stop.request("SIGTERM")

        made.work.dialogue.say = say_and_stop  # type: ignore[method-assign]
        with pytest.raises(Stopped):
            commission(made.work)
    assert turned_backward(made.work, draw) is None
    mended, true = wire_map_of(made.work.progress["sign"]["protocol"]), wire_map_of("can-wheel")
    for found, register in zip(mended.registers, true.registers, strict=True):
        assert [field.scale for field in found.fields] == pytest.approx([field.scale for field in register.fields])
    assert made.work.progress["delay"] is not None
    assert made.plant.current_A == made.watched.last_A == 0.0


@pytest.mark.parametrize("family", ["ascii-wheel", "odrive-ascii-wheel"])
def test_a_slow_line_of_text_is_waited_for(tmp_path: Path, family: str) -> None:
    """At 9600 baud: one reply of more than 40 ms with its bytes, or five for a sample, so that the loop has 2 Hz."""
    clock = VirtualClock()
    with StopSignal() as stop:
        made = rig(replace(USUAL, family=family, baud=9600), tmp_path, clock, stop)
        clock.at(60.0, lambda: stop.request("SIGTERM"))
        with pytest.raises(Stopped):
            commission(made.work)
    assert made.work.progress["still"] is not None


@pytest.mark.slow
@pytest.mark.xdist_group("commissioning")
def test_what_is_written_is_in_the_contract_and_can_be_run(broken_off: BrokenOff) -> None:
    """The document has the contract's keys, wheel.yaml loads with the mended map and the model, the page holds all."""
    document = broken_off.made.work.progress.document()
    check_document(document)
    assert document["done"]
    configuration = load_configuration(broken_off.out / "wheel.yaml")
    assert configuration.wheel.protocol == document["sign"]["protocol"]
    assert Path(configuration.filter.model or "").is_file()
    page = (broken_off.out / "report.html").read_text(encoding="utf-8")
    assert "data:image/png" in page
    assert 'src="http' not in page
    assert document["model"]["verdict"]["name"] in page


def test_nothing_but_reads_reaches_a_wheel_before_somebody_agreed(tmp_path: Path) -> None:
    """Nobody agrees: the wheel got no write at all, and the reason is said; without limits it says which to give."""
    with StopSignal() as stop:
        made = rig(replace(USUAL, yes=False), tmp_path, VirtualClock(), stop)
        with pytest.raises(BadInputError, match="--yes"):
            commission(made.work)
        assert made.watched.writes == 0
        made.work.progress.forget_from("limits")
        made.work.options = made.work.options._replace(current_limit_A=None)
        with pytest.raises(BadInputError, match="--current-limit: give the limits"):
            commission(made.work)
        assert made.watched.writes == 0


def test_a_boot_loader_is_not_told_to_start_before_somebody_agreed(tmp_path: Path) -> None:
    """An NSP wheel that has just been powered: without --yes no INIT reaches it; with it the wheel is found."""
    draw = replace(USUAL, family="nsp-wheel", yes=False)
    with StopSignal() as stop:
        made = rig(draw, tmp_path, VirtualClock(), stop)
        with pytest.raises(RefusedError, match="boot loader answers"):
            commission(made.work)
        assert not made.server.started  # type: ignore[attr-defined]
        made.work.options = made.work.options._replace(yes=True, current_limit_A=None)
        with pytest.raises(BadInputError, match="--current-limit"):
            commission(made.work)
        assert made.work.progress["find"]["started"]
        assert made.watched.writes == 0


@pytest.mark.slow
@pytest.mark.xdist_group("commissioning")
def test_a_signal_at_any_time_leaves_zero_and_the_next_call_goes_on(broken_off: BrokenOff) -> None:
    """After 11 s a signal, then ever later: zero in force each time, nothing found is lost, it comes to its end.

    The last strikes the identification, of which nothing is kept.
    """
    assert set(broken_off.currents_A) == {0.0}
    done: set[str] = set()
    for now in broken_off.steps:
        assert done <= now
        done = now
    assert {"find", "limits", "still", "sign", "delay"} <= done
    assert broken_off.made.work.progress["done"]


@pytest.mark.parametrize("at_s", [60.0, 90.0])
def test_a_wheel_that_dies_is_said_in_a_sentence(tmp_path: Path, at_s: float) -> None:
    """Its line is pulled at rest or in the first move, or it falls silent: a DriverError, what was found is kept."""
    for fault in ("hangup", "drop:1"):
        with StopSignal() as stop:
            directory = tmp_path / fault[:4]
            directory.mkdir()
            made = rig(USUAL, directory, VirtualClock(), stop)
            put_faults(made.server, f"{fault}@{at_s:g}s")
            with pytest.raises(DriverError, match=r"stopped answering|did not confirm zero|failed|there is no port"):
                commission(made.work)
            assert made.work.progress["find"] is not None
            assert load_configuration(directory / "out" / "wheel.yaml").wheel.port == made.work.progress["find"]["port"]


def test_a_short_silence_after_which_nobody_says_who_it_is_is_waited_for(tmp_path: Path) -> None:
    """Readings stay away for .7 s and the serial number for 1.2 s: it goes on; where it stays unknown that is said."""
    for unknown_s, ends in ((1.2, Stopped), (60.0, RefusedError)):
        clock, directory = VirtualClock(), tmp_path / str(unknown_s)
        directory.mkdir()
        with StopSignal() as stop:
            made = rig(USUAL, directory, clock, stop)
            put_faults(made.server, f"silence@20s:0.7s,silence/identity@20s:{unknown_s}s")
            clock.at(80.0, lambda stop=stop: stop.request("SIGTERM"))  # type: ignore[misc]
            with pytest.raises(
                ends, match=None if ends is Stopped else "does not say at once which wheel it is: start again"
            ):
                commission(made.work)
        assert made.plant.current_A == 0.0


def test_limits_that_do_not_move_the_wheel_are_refused_with_what_it_takes(tmp_path: Path) -> None:
    """A current limit below break-away: refused, and zero in force."""
    with StopSignal() as stop:
        made = rig(USUAL, tmp_path, VirtualClock(), stop)
        made.work.options = made.work.options._replace(current_limit_A=0.04)
        with pytest.raises(RefusedError, match="did not move the wheel"):
            commission(made.work)
        assert made.plant.current_A == 0.0


def test_another_wheel_needs_another_directory(tmp_path: Path) -> None:
    """What was found of one port is not gone on with at another, nor with another wheel behind the same."""
    with StopSignal() as stop:
        made = rig(replace(USUAL, yes=False), tmp_path, VirtualClock(), stop)
        with pytest.raises(BadInputError, match="--yes"):
            commission(made.work)
        made.work.options = made.work.options._replace(port="/dev/other")
        with pytest.raises(BadInputError, match="name another --out"):
            commission(made.work)
        again = rig(replace(USUAL, number=7), tmp_path, VirtualClock(), stop)
        with pytest.raises(RefusedError, match="another wheel answers: serial number 8"):
            commission(again.work)


def test_without_a_tachometer_and_a_word_nothing_moves(tmp_path: Path) -> None:
    """The scale cannot be known: refused before any write, with the option that says it."""
    with StopSignal() as stop:
        made = rig(replace(USUAL, has_tachometer=False), tmp_path, VirtualClock(), stop)
        with pytest.raises(BadInputError, match="--speed-ratio"):
            commission(made.work)
        assert made.watched.writes == 0


def test_no_port_says_what_was_tried(tmp_path: Path) -> None:
    """Nobody answers: ports, maps and bauds stand in the message."""
    with StopSignal() as stop:
        made = rig(replace(USUAL, turned=()), tmp_path, VirtualClock(), stop)
        put_faults(made.server, "drop:1")
        with pytest.raises(RefusedError, match=r"no valid reply through .*nsp-wheel.* at the map's baud, 9600"):
            commission(made.work)


def test_a_limit_beyond_the_map_is_told_before_anybody_agrees(tmp_path: Path) -> None:
    """The largest number that the wire carries stands in the message; nothing is written."""
    with StopSignal() as stop:
        made = rig(replace(USUAL, turned=()), tmp_path, VirtualClock(), stop)
        made.work.options = made.work.options._replace(speed_limit_rpm=1.0e9)
        with pytest.raises(BadInputError, match=r"--speed-limit 1e\+09: the wire map carries no more than"):
            commission(made.work)
        assert made.work.progress["limits"] is None
        assert made.watched.writes == 0


@pytest.mark.slow
@pytest.mark.xdist_group("commissioning")
def test_a_signal_while_the_model_is_made_keeps_the_motion_and_the_next_call_makes_it(broken_off: BrokenOff) -> None:
    """SIGTERM at the first word of the diagnosis: Stopped, no current was written, then it comes to its end."""
    progress = broken_off.made.work.progress
    progress.forget_from("model")
    progress.keep("identification", progress["identification"])

    def strike(text: str) -> None:
        signal.raise_signal(signal.SIGTERM)

    with StopSignal() as stop:
        made = rig(USUAL, broken_off.out.parent, VirtualClock(), stop)
        with pytest.raises(Stopped):
            commission(made.work, advance=strike)
        assert made.watched.writes == 0
    kept = Progress.of(broken_off.out)
    assert kept["identification"] is not None
    assert kept["model"] is None
    with StopSignal() as stop:
        again = rig(USUAL, broken_off.out.parent, VirtualClock(), stop)
        commission(again.work)
    assert again.work.progress["done"]
    assert again.work.progress["model"] is not None
