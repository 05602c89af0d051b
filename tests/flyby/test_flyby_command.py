"""`rw-ekf flyby`: the document, the tables, geometry files and what is refused."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from rw_ekf.cli import main
from rw_ekf.flyby.flyby_plan import TABLE_A1_RPM
from rw_ekf.flyby.settings import SECTIONS
from rw_ekf.settings.resources import config_resource
from tests.contract import check_document

PYRAMID = """\
wheels:
  inertia_kg_m2: [0.1, 0.1, 0.1, 0.2]
  axes: [[0.5774, 0.5774, 0.5774], [-0.5774, 0.5774, 0.5774], [-0.5774, -0.5774, 0.5774], [0.5774, -0.5774, 0.5774]]
spacecraft:
  inertia_kg_m2: [[900, 10, 0], [10, 800, 0], [0, 0, 700]]
  slew_axis: [1, 0, 0]
flyby: {body_radius_km: 250, altitude_km: 100, speed_km_s: 8.0, start_distance_km: 900}
"""


def flyby_document(capsys: pytest.CaptureFixture[str], *options: str) -> dict[str, Any]:
    """The document of a flyby, checked against the contract."""
    assert main(["flyby", *options, "--json"]) == 0
    document: dict[str, Any] = json.loads(capsys.readouterr().out)
    check_document(document)
    return document


def refused(capsys: pytest.CaptureFixture[str], *options: str) -> str:
    """What a refused call says; status 2, nothing on standard output."""
    assert main(["flyby", *options]) == 2
    out, errors = capsys.readouterr()
    assert out == ""
    assert "Traceback" not in errors
    return errors


def test_without_arguments_it_is_table_a1(capsys: pytest.CaptureFixture[str]) -> None:
    """Eight cases in the paper's order, a list of crossings for each wheel, and the tables say the same."""
    document = flyby_document(capsys)
    assert [tuple(case["rates_rpm"]) for case in document["cases"]] == list(TABLE_A1_RPM)
    assert [len(found) for found in document["cases"][0]["crossings_s"]] == [1, 0, 1]
    assert main(["flyby"]) == 0
    text = capsys.readouterr().out
    for case in document["cases"]:
        for found in case["crossings_s"]:
            assert all(f"{time_s:.1f}" in text for time_s in found)


def test_rates_that_begin_with_a_minus_are_rates(capsys: pytest.CaptureFixture[str]) -> None:
    """Several sets, the first and the last of them negative, as a person types them."""
    document = flyby_document(capsys, "--rates", "-300,600,-900", "300,600,900", "-.5,1e2,3")
    assert [case["rates_rpm"] for case in document["cases"]] == [[-300, 600, -900], [300, 600, 900], [-0.5, 100, 3]]


def test_four_wheels_and_rates_that_avoid_closest_approach(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A pyramid from a file: the scale and the null-space bias to choose are given, and what is chosen holds."""
    path = tmp_path / "pyramid.yaml"
    path.write_text(PYRAMID)
    options = ("--geometry", str(path), "--rates", "200,-300,100,50", "--avoid", "60")
    entry = flyby_document(capsys, *options)["cases"][0]
    scaled, biased = entry["avoid"]
    assert (scaled["present"], biased["present"]) == (1.0, 0.0)
    low, high = biased["allowed"][-1]
    assert low is not None
    assert high is None  # enough bias always helps
    assert main(["flyby", *options]) == 0
    text = capsys.readouterr().out
    assert "within 60 s of closest approach" in text
    assert "pseudo-inverse" in text


def test_a_picture_is_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """--out writes a PNG."""
    path = tmp_path / "flyby.png"
    assert main(["flyby", "--rates", "300,600,900", "--out", str(path)]) == 0
    capsys.readouterr()
    assert path.read_bytes().startswith(b"\x89PNG")


def spoilt(tmp_path: Path, old: str, new: str) -> str:
    """The shipped geometry with one thing changed, as a file."""
    text = config_resource("flyby-titan").read_text()
    assert old in text
    path = tmp_path / "geometry.yaml"
    path.write_text(text.replace(old, new))
    return str(path)


@pytest.mark.parametrize(
    ("old", "new", "stated"),
    [
        ("altitude_km", "altitude", r":18:3: unknown key flyby.altitude; did you mean 'altitude_km'"),
        ("spacecraft:", "spacecraftt:", r":12:1: unknown section spacecraftt; did you mean 'spacecraft'"),
        ("[0.0, 1.0, 0.0]", "[0.0, 2.0, 0.0]", r":14:14: spacecraft.slew_axis is no unit vector, its length is 2"),
        ("[0.0, 0.816496580927726,", "[0.0, 0.9,", r":8:7: wheels.axes.0 is no unit vector"),
        ("[0.0, 0.816496580927726, 0.5773502691896258]", "[-1.0, 0.0, 0.0]\n    - [0.0, 0.0]", "at least 3 entries"),
        (
            "[0.0, 0.816496580927726, 0.5773502691896258]",
            "[0.7071067811865476, 0.4082482904638631, -0.5773502691896258]",
            r":8:5: wheels.axes all lie in one plane",
        ),
        ("0.16 ", "[0.16, 0.2] ", r":6:18: wheels.inertia_kg_m2 has 2 entries for 3 axes"),
        ("0.16 ", "0 ", r":6:3: wheels.inertia_kg_m2.0 must be above 0"),
        ("[6400.0, 5300.0, 3500.0]", "[[1, 2, 3], [0, 4, 5], [0, 0, 6]]", "is not symmetric"),
        ("[6400.0, 5300.0, 3500.0]", "[6400.0, -1.0, 3500.0]", "is not positive"),
        ("start_angle_deg: 30.0", "start_distance_km: 7000.0\n  start_angle_deg: 30.0", "found both"),
        ("start_angle_deg: 30.0", "start_angle_deg: 120.0", "the angle only grows"),
        ("speed_km_s: 6.5", "speed_km_s: .inf", "is not a finite number"),
    ],
)
def test_a_geometry_that_is_none_is_refused_at_its_place(
    old: str, new: str, stated: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Unknown keys, axes that are no unit vectors or span no space, impossible inertias and windows: status 2."""
    errors = refused(capsys, "--geometry", spoilt(tmp_path, old, new), "--rates", "1,2,3")
    assert stated in errors
    assert "geometry.yaml:" in errors


@pytest.mark.parametrize(
    "options", [("--rates", "1,2"), ("--rates", "a,b,c"), ("--rates", "nan,1,2"), ("--avoid", "0")]
)
def test_rates_and_times_that_are_none_are_refused(
    options: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    """Too few rates, text, nan, no time: a sentence that names the option."""
    assert options[0] in refused(capsys, *options)


def test_a_geometry_of_one_s_own_wants_its_rates(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Table A1 belongs to Cassini's wheels."""
    assert "--rates: give the 3 wheel rates" in refused(capsys, "--geometry", spoilt(tmp_path, "30.0", "31.0"))


def test_every_key_of_a_geometry_is_documented() -> None:
    """docs/flyby.md has a row for each key of the schema."""
    page = (Path(__file__).parents[2] / "docs" / "flyby.md").read_text()
    for section, model in SECTIONS.items():
        for key in model.model_fields:
            assert f"| `{section}.{key}` |" in page
