"""What a run leaves is read while it grows: whole rows, nothing twice, no spike lost, whatever a part has become."""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import pytest

from rw_ekf.errors import BadInputError
from rw_ekf.page.growing_table import GrowingTable, read_thinned
from rw_ekf.page.run_feed import RunFeed, believed_of, runs_in
from tests.page.runs import RunOnDisk


def test_a_line_that_is_still_being_written_is_taken_once_it_is_whole(tmp_path: Path) -> None:
    """Rows come once each, in order, whatever pieces they are written in."""
    path = tmp_path / "a.csv"
    path.write_text("time_s,b\n1,2\n3,")
    table = GrowingTable(path)
    assert table.rows() == {"time_s": [1.0], "b": [2.0]}
    assert table.rows() == {}
    with path.open("a") as stream:
        stream.write("4\n5,\n6,true\nx,nan\n")
    assert table.rows() == {"time_s": [3.0, 5.0, 6.0, None], "b": [4.0, None, 1.0, None]}
    path.write_text("time_s,b\n9,9\n")  # cut and begun again
    assert table.rows() == {"time_s": [9.0], "b": [9.0]}
    path.unlink()
    assert table.rows() == {}


def test_the_end_of_a_long_table_is_read_without_its_beginning(tmp_path: Path) -> None:
    """Its names are those of the first line, its first row a whole one."""
    path = tmp_path / "a.csv"
    path.write_text("time_s,b\n" + "".join(f"{i},{i * i}\n" for i in range(5000)))
    rows = GrowingTable(path, last_bytes=200).rows()
    assert rows["time_s"][-1] == 4999.0
    assert 5 < len(rows["time_s"]) < 40
    assert rows["b"][0] == rows["time_s"][0] ** 2  # type: ignore[operator]


def test_a_history_is_thinned_without_losing_its_spike(tmp_path: Path) -> None:
    """The one row of 2,000 that stands out is in 100 points, and a narrower span has all its rows."""
    run = RunOnDisk(tmp_path)
    run.add(2000)
    feed = RunFeed(run.log)
    thin = feed.history(points=100)["estimates"]
    assert len(thin["time_s"]) == 100
    assert max(value for value in thin["nis"] if value is not None) == 99.0
    near = feed.history((107.0, 108.0), points=100)["estimates"]
    assert near["time_s"] == pytest.approx(np.arange(107.0, 108.01, 0.1), abs=1e-3)
    assert read_thinned([tmp_path / "gone.csv"], ["time_s"], 9, (0.0, 1e9)) == {}


def test_parts_are_one_run_whatever_form_they_have(tmp_path: Path) -> None:
    """A first part that was compressed, and the second that grows: the history has both, the tail the new rows."""
    run = RunOnDisk(tmp_path)
    run.add(40)
    for path in (run.log, run.estimates):
        second = path.with_name(path.name.replace("wheel", "wheel.part002", 1))
        lines = path.read_text().splitlines(keepends=True)
        path.with_name(path.name + ".gz").write_bytes(gzip.compress("".join(lines[:21]).encode()))
        second.write_text("".join([lines[0], *lines[21:]]))
        path.unlink()
    feed = RunFeed(tmp_path / f"{run.name}.csv")
    reported = feed.history()
    assert len(reported["log"]["time_s"]) == len(reported["estimates"]["time_s"]) == 40
    tail = feed.tail()
    assert tail.look()["log"] == {}
    with (tmp_path / f"{run.name}.part002.csv").open("a") as log:
        log.write("104.0,1,2,3,0.05,0,21\n")
    assert tail.look()["log"]["time_s"] == [104.0]


def test_events_and_state_are_of_this_run(tmp_path: Path) -> None:
    """A state file that a later run publishes is none of an earlier one; events are told once."""
    old, run = RunOnDisk(tmp_path, "2026-01-01T00-00-00Z_wheel"), RunOnDisk(tmp_path)
    old.add(3)
    run.add(3)
    run.publish()
    run.tell(event="state", state="TRACKING", time_s=100.0)
    assert RunFeed(old.log).state() is None
    feed = RunFeed(run.log)
    state = feed.state()
    assert state is not None
    assert (state["run_state"], state["alive"]) == ("TRACKING", True)
    tail = feed.tail()
    run.tell(event="alarm", text="it rubs", time_s=100.2)
    assert [event["event"] for event in tail.look()["events"]] == ["alarm"]
    assert tail.look()["events"] == []
    assert [path.name for path in runs_in(tmp_path)] == [run.log.name, old.log.name]
    with pytest.raises(BadInputError, match="there is no run"):
        RunFeed(tmp_path / "other.csv")


def test_the_curve_is_the_models_friction(tmp_path: Path) -> None:
    """At 30 rad/s the torque is b w + c of the model, odd in the speed, with a sigma of the parameters'."""
    import rw_ekf

    run = RunOnDisk(tmp_path)
    run.add(3)
    fit = rw_ekf.fit(rw_ekf.simulate("identification", duration_s=120.0, seed=2))
    fit.model.save(tmp_path / f"{run.name}.model.yaml")
    curve = RunFeed(run.log).curve(30.0)
    assert curve is not None
    now = curve["now"]
    assert now["speed_rad_s"][-1] == pytest.approx(30.0)
    viscous, coulomb = (fit.model.numbers[name][0] for name in ("viscous", "coulomb"))
    assert now["friction_rad_s2"][-1] == pytest.approx(30.0 * viscous + coulomb, rel=1e-3)
    assert now["friction_rad_s2"][0] == pytest.approx(-now["friction_rad_s2"][-1], rel=1e-6)
    assert 0.0 < now["std_rad_s2"][-1] < 0.2 * now["friction_rad_s2"][-1]


def test_the_curve_of_what_is_believed_between_two_saves_of_the_model(tmp_path: Path) -> None:
    """Numbers of the estimates in place of the file's, the last that are whole; half the sigmas, half the band."""
    import rw_ekf

    run = RunOnDisk(tmp_path)
    run.add(25)
    feed = RunFeed(run.log)
    assert believed_of(feed.history()["estimates"]) == {
        "motor_gain": (15.0, 2.0), "viscous": (0.003, 0.001), "coulomb": (0.5, 0.1), "static": (0.6, 0.1),
    }  # fmt: skip
    model = rw_ekf.fit(rw_ekf.simulate("identification", duration_s=120.0, seed=2)).model
    model.save(tmp_path / f"{run.name}.model.yaml")
    believed = {name: (1.1 * value, 0.5 * std) for name, (value, std, _) in model.numbers.items()}
    saved, now = feed.curve(30.0), feed.curve(30.0, believed)
    assert saved is not None
    assert now is not None
    for name, factor in (("friction_rad_s2", 1.1), ("std_rad_s2", 0.5)):
        assert now["now"][name][-1] == pytest.approx(factor * saved["now"][name][-1], rel=0.02)


def test_the_last_minute_of_the_speed_has_no_holes(tmp_path: Path) -> None:
    """The estimates have the speed in every tenth row alone; the log has it in each."""
    run = RunOnDisk(tmp_path)
    run.add(100)
    recent = RunFeed(run.log).recent()
    assert len(recent["speed_rad_s"]) == 100
    assert None not in recent["speed_rad_s"]
    assert len(recent["innovation_rad_s"]) == 100
