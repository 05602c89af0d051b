"""`rw-ekf fleet` and `rw-ekf simulate fleet` from the command line: documents, texts, statuses, the page, the files."""

from __future__ import annotations

import html.parser
import json
import re
import shutil
from pathlib import Path
from typing import Any

import pyarrow.dataset as ds
import pytest

import rw_ekf
from rw_ekf.cli import main
from rw_ekf.logs.atomic import atomic_path
from tests.contract import check_document

pytestmark = pytest.mark.xdist_group("fleet")


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A fleet of six wheels over seven days that was run; one log is torn."""
    here = tmp_path_factory.mktemp("commands") / "logs"
    assert (
        main(["simulate", "fleet", "--out", str(here), "--wheels", "6", "--days", "7", "--seed", "8", "--workers", "2"])
        == 0
    )
    torn = sorted((here / "wheel=W00002").iterdir())[3]
    torn.write_bytes(torn.read_bytes()[:1000])
    assert main(["fleet", "run", str(here), "--workers", "2"]) == 1
    return here


def document(capsys: pytest.CaptureFixture[str], *arguments: str, status: int = 0) -> dict[str, object]:
    capsys.readouterr()
    assert main([*arguments, "--json"]) == status
    found = json.loads(capsys.readouterr().out)
    assert isinstance(found, dict)
    return found


def test_the_documents_are_those_of_the_contract(fleet: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Of every action; and a failed log is told with status 1 each time."""
    built = document(capsys, "fleet", "build", str(fleet))
    run = document(capsys, "fleet", "run", str(fleet), "--workers", "1", status=1)
    trends = document(capsys, "fleet", "trends", str(fleet), "--limit", "coulomb=+50%")
    view = document(capsys, "fleet", "view", str(fleet / "fleet"))
    for found in (built, run, trends, view, json.loads((fleet / "truth.json").read_text())):
        if "truth" in found:
            found.pop("truth")
        check_document(found)
    assert (built["logs"], run["logs"], run["computed"], len(run["failed"])) == (run["logs"], built["logs"], 0, 1)  # type: ignore[arg-type]
    assert trends == json.loads((fleet / "fleet" / "trends.json").read_text())


def test_the_library_does_what_the_command_does(fleet: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The same document, and the text."""
    trends = rw_ekf.fleet.trends(fleet, limits=["coulomb=+50%"])
    assert json.loads(trends.to_json()) == document(capsys, "fleet", "trends", str(fleet), "--limit", "coulomb=+50%")
    assert main(["fleet", "trends", str(fleet), "--limit", "coulomb=+50%"]) == 0
    assert capsys.readouterr().out == trends.text() + "\n"
    assert "1 of its 7 logs failed" in trends.text()
    assert dir(rw_ekf.fleet) == [
        "Diagnoses", "FleetIndex", "FleetRun", "Trends", "build", "diagnose", "run", "simulate", "trends", "view",
    ]  # fmt: skip
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        getattr(rw_ekf.fleet, "nothing")  # noqa: B009


class _Page(html.parser.HTMLParser):
    """Anchors, links and what it would fetch; that tags close."""

    def __init__(self) -> None:
        super().__init__()
        self.ids: list[str] = []
        self.links: list[str] = []
        self.fetched: list[str] = []
        self.rows = 0

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        found = dict(attrs)
        self.ids += [found["id"] or ""] if "id" in found else []
        self.links += [found["href"] or ""] if tag == "a" else []
        self.fetched += [str(found[name]) for name in ("src", "href") if tag != "a" and name in found]
        self.rows += tag == "tr"


def test_the_page_stands_alone_and_leads_to_every_wheel(fleet: Path) -> None:
    """Nothing is fetched; each line of the table leads to its wheel; the failed log is on it; names are escaped."""
    rw_ekf.fleet.trends(fleet, limits=["coulomb=+50%"])
    page = rw_ekf.fleet.view(fleet, limits=["coulomb=+50%"])
    text = page.read_text(encoding="utf-8")
    found = _Page()
    found.feed(text)
    assert found.fetched == []
    assert found.rows == 7
    assert sorted(link.removeprefix("#") for link in found.links) == sorted(found.ids)
    assert "1 failed" in text
    assert "nan" not in re.sub(r"<style>.*?</style>", "", text, flags=re.DOTALL).lower().split()
    order = [wheel["wheel"] for wheel in json.loads((fleet / "fleet" / "trends.json").read_text())["wheels"]]
    assert sorted(order, key=text.index) == order


def test_pyarrow_and_duckdb_read_the_results(fleet: Path) -> None:
    """As docs/fleet.md shows: wheel and day are columns; also while a worker writes another."""
    duckdb = pytest.importorskip("duckdb")
    results = fleet / "fleet" / "results"
    part = next(results.glob("*/*/*.parquet"))
    with atomic_path(part.with_name("part-new.parquet")) as half:
        half.write_bytes(part.read_bytes()[:100])
        _are_read(duckdb, results)
    part.with_name("part-new.parquet").unlink()


def _are_read(duckdb: Any, results: Path) -> None:
    table = ds.dataset(results, partitioning="hive").to_table(columns=["wheel", "day", "coulomb", "status"])
    (rows,) = duckdb.sql(
        f"select count(*), count(coulomb) from read_parquet('{results}/*/*/*.parquet', hive_partitioning = true) "
        "where wheel = 'W00002'"
    ).fetchall()
    assert rows == (7, 6)
    assert table.filter(ds.field("wheel") == "W00002").num_rows == 7


def test_a_wheel_s_name_may_be_anything(fleet: Path, tmp_path: Path) -> None:
    """Blanks, slashes by their code, and markup: folders, documents and the page keep it."""
    name = "RW <i>1 100%25 %2F"
    here = tmp_path / "logs" / f"wheel={name}"
    shutil.copytree(fleet / "wheel=W00000", here)
    assert rw_ekf.fleet.run(tmp_path / "logs", workers=1).whole
    (wheel,) = rw_ekf.fleet.trends(tmp_path / "logs").document()["wheels"]
    assert wheel["wheel"] == "RW <i>1 100% /"
    assert "<i>1" not in rw_ekf.fleet.view(tmp_path / "logs").read_text()


def test_logs_of_the_daemon_s_kind_are_found_by_metadata(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A run with `.meta.yaml` beside it says itself whose it is and when it began; what says nothing is left out."""
    from rw_ekf.logs.metadata import RunMetadata, write_metadata
    from rw_ekf.records import WheelIdentity

    log = tmp_path / "run.csv"
    rw_ekf.simulate("P1", duration_s=60.0).save(log)
    write_metadata(
        log,
        RunMetadata(
            "2026-03-04T05:06:07.000000Z",
            identity=WheelIdentity(serial_number=9),
            configuration={"wheel": {"name": "y"}},
        ),
    )
    rw_ekf.simulate("P1", duration_s=60.0).save(tmp_path / "nobody.csv")
    built = rw_ekf.fleet.build(tmp_path)
    assert [(entry.wheel, entry.begins_utc) for entry in built.logs] == [("y-9", "2026-03-04T05:06:07.000000Z")]
    assert "nobody.csv: nothing says whose it is" in built.text()


@pytest.mark.parametrize(
    ("arguments", "stated"),
    [
        (["fleet", "run", "{}/nowhere"], "is no directory of logs"),
        (["fleet", "run", "{}"], "holds no log of which it is known"),
        (["fleet", "trends", "{}"], "has no results yet"),
        (["fleet", "view", "{}"], "has no results yet"),
        (["fleet", "run", "{}", "--limit", "coulomb=1"], "--limit is asked of"),
        (["fleet", "run", "{}", "--workers", "0"], "give 1 or more"),
        (["simulate", "fleet"], "--out DIR is missing"),
        (["simulate", "fleet", "--out", "{}/x", "--workers", "0"], "give 1 or more"),
        (["simulate", "fleet", "--out", "{}/x", "--wheels", "0"], "a fleet has 1 to"),
        (["simulate", "--config", "example"], "--link PATH is missing"),
        (["simulate", "--link", "{}/tty", "--out", "{}"], "leave it out, or say fleet"),
    ],
)
def test_bad_input_is_told_with_status_2(
    arguments: list[str], stated: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """One sentence, no traceback."""
    assert main([text.format(tmp_path) for text in arguments]) == 2
    assert stated in capsys.readouterr().err


def test_a_configuration_of_several_wheels_is_taken_with_the_name_of_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is advised where none is named is an option that there is, and its wheel's configuration is what is used."""
    taken: list[Any] = []

    def take(directory: str, out: str | None, **given: object) -> None:
        taken.append(given["configuration"])
        raise rw_ekf.Error("far enough")

    monkeypatch.setattr("rw_ekf.fleet.fleet_api.run", take)
    wanted = ["fleet", "run", str(tmp_path), "--config", "bus", "--scheduler", "none"]
    assert main(wanted) == 2
    assert "say which one is meant: --wheel NAME, of rw-x, rw-y" in capsys.readouterr().err
    main([*wanted, "--wheel", "rw-y"])
    assert [configuration.wheel.name for configuration in taken] == ["rw-y"]
