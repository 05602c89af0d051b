"""The report of a diagnosis: what it writes, that it needs no network, and that nothing odd breaks it."""

from __future__ import annotations

import base64
import copy
import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import uniform_filter1d

from rw_ekf.diagnosis.outcome import ModelTrace
from rw_ekf.diagnosis.report.binning import (
    binned_means,
    correlation_samples,
    running_means,
    thinned_line,
    window_sums,
)
from rw_ekf.diagnosis.report.diagnosis_page import write_report
from rw_ekf.diagnosis.report.text import diagnosis_text
from rw_ekf.diagnosis.report.words import Units, figure_pairs
from rw_ekf.diagnosis.result import Diagnosis
from rw_ekf.errors import PictureError
from rw_ekf.numbers import number_text
from tests.diagnosis.example import INERTIA_KG_M2, example, many_samples

pytestmark = pytest.mark.xdist_group("report")  # one report serves many tests

VOID = {"meta", "img", "br", "link", "input", "hr"}
ALL_FILES = {
    "augmented-model.yaml",
    "cause.png",
    "diagnosis.json",
    "evidence.svg",
    "report.html",
    "residual.png",
    "speed.png",
}


class Page(HTMLParser):
    """Checks that tags nest, and keeps what a reader sees."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[str] = []
        self.images: list[dict[str, str | None]] = []
        self.seen: list[str] = []
        self.feed(text)
        self.close()
        assert self.open == [], f"never closed: {self.open}"

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        if tag == "img":
            self.images.append(dict(attrs))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if "style" not in self.open:
            self.seen.append(data)

    @property
    def text(self) -> str:
        return re.sub(r"\s+", " ", " ".join(self.seen))


@pytest.fixture(scope="module")
def found() -> Diagnosis:
    return example(seed=1)


@pytest.fixture(scope="module")
def written(found: Diagnosis, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The directory of its report."""
    directory = tmp_path_factory.mktemp("report") / "new" / "dir"
    paths = write_report(directory, replace(found, inertia_kg_m2=INERTIA_KG_M2))
    assert {path.name for path in paths} == ALL_FILES
    return directory


def page_of(directory: Path) -> Page:
    return Page((directory / "report.html").read_text(encoding="utf-8"))


def report(diagnosis: Diagnosis, directory: Path, inertia: float | None = INERTIA_KG_M2, *, wheel: bool = True) -> Page:
    write_report(directory, replace(diagnosis, inertia_kg_m2=inertia, in_rpm=wheel))
    return page_of(directory)


def test_every_file_is_written_and_named(written: Path) -> None:
    """All files exist, whole, nothing else is left, and the list that comes back is what stands there."""
    assert {path.name for path in written.iterdir()} == ALL_FILES
    for path in written.iterdir():
        if path.suffix == ".png":
            content = path.read_bytes()
            assert content.startswith(b"\x89PNG\r\n")
            assert int.from_bytes(content[16:20], "big") >= 1200
            assert len(content) > 20_000


def test_pictures_that_cannot_be_drawn_cost_nothing_else(
    found: Diagnosis, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The document, the model and the page with the other pictures stand; one sentence names those that do not."""
    report(found, tmp_path)  # an earlier run's pictures do not stay for new ones

    def fails(*_: object) -> bytes:
        raise PictureError("no ink")

    monkeypatch.setattr("rw_ekf.diagnosis.report.diagnosis_page.speed_picture", fails)
    monkeypatch.setattr("rw_ekf.diagnosis.report.diagnosis_page.residual_picture", fails)
    with pytest.raises(PictureError, match=r"^speed\.png, residual\.png: no ink$"):
        report(found, tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == ALL_FILES - {"speed.png", "residual.png"}
    assert len(page_of(tmp_path).images) == 1


def test_the_page_stands_alone(written: Path) -> None:
    """No address, script, style sheet or font from outside; the pictures inside are the files beside it."""
    page = page_of(written)
    raw = (written / "report.html").read_text(encoding="utf-8")
    assert "http:" not in raw
    assert "https:" not in raw
    assert "url(" not in raw
    assert "@import" not in raw
    assert not {"script", "link", "iframe", "object"} & set(page.tags)
    assert len(page.images) == 3
    for image, name in zip(page.images, ("cause.png", "speed.png", "residual.png"), strict=True):
        source = image["src"] or ""
        assert image["alt"]
        kind, content = source.split(";base64,")
        assert kind == "data:image/png"
        assert base64.b64decode(content) == (written / name).read_bytes()


def test_verdict_and_figures_come_first(found: Diagnosis, written: Path) -> None:
    """Badge and one line with both free-run figures come before the statement; parameters and commands follow."""
    page = page_of(written)
    before, after = (found.document()[key]["free_run_rms_rpm"] for key in ("before", "after"))
    figures = f"{number_text(before)} → {number_text(after)}"
    headline = f"The model lacks viscous temperature: free-run error {figures}"
    order = [page.text.index(words) for words in ("Effect named", headline, "Viscous friction falls", "Evidence")]
    assert order == sorted(order)
    assert "viscous_temperature slope_1_K -0.0300 0.0005 1/K" in page.text
    assert f"--model {written}/augmented-model.yaml" in page.text
    assert "transport_delay and actuator_lag look the same in this log; what separates them" in page.text
    assert "needs angle_rad, which is not logged" in page.text


def test_names_from_outside_are_escaped(tmp_path: Path) -> None:
    """A log called <script> is shown as it is called and is no script; so is the document's own text."""
    name = '<script>alert("x")</script>&.csv'
    page = report(example(seed=1, name=name, statement="<b>bold</b> & <i>more"), tmp_path)
    assert "script" not in page.tags
    assert "b" not in page.tags
    assert name in page.text
    assert "<b>bold</b> & <i>more" in page.text


def test_nan_is_null_in_the_document(found: Diagnosis, written: Path) -> None:
    """The JSON is strict, NaN is null, and all else is the document unchanged."""

    def refuse(constant: str) -> None:
        raise AssertionError(constant)

    text = (written / "diagnosis.json").read_text(encoding="utf-8")
    document = json.loads(text, parse_constant=refuse)
    (cubic,) = (c for c in document["candidates"] if c["effect"] == "cubic_drag")
    assert cubic["heldout_gain_percent"] is None
    assert document["verdict"] == found.document()["verdict"]
    assert document["before"] == found.document()["before"]


@pytest.mark.parametrize("kind", ["adequate", "unexplained", "insufficient_excitation"])
def test_without_a_better_model_what_an_earlier_run_left_is_gone(kind: str, tmp_path: Path) -> None:
    """A stale augmented model (and picture) is removed; the page has the reason and advice, and no command for it."""
    for name in (*ALL_FILES, "shapes.png", "evidence.png"):
        (tmp_path / name).write_text("of an earlier run", encoding="utf-8")
    poor = example([], kind=kind, seed=2)
    page = report(poor, tmp_path)
    left = {"diagnosis.json", "report.html", "speed.png"}
    if kind != "insufficient_excitation":
        left |= {"residual.png", "evidence.svg"}
    assert {path.name for path in tmp_path.iterdir()} == left
    assert "augmented-model.yaml" not in page.text
    assert poor.document()["verdict"]["statement"].split(":")[0] in page.text
    assert "What to do next" in page.text
    assert (kind == "insufficient_excitation") == ("rw-ekf excite identification --config" in page.text)


def test_what_no_effect_explains_is_drawn_and_told(tmp_path: Path) -> None:
    """The curve is the first picture, its sentence the headline; the record that would help is a next step."""
    poor = example([], kind="unexplained", seed=2)
    shape = {
        "dependence": "time", "kind": "drag", "at_unit": "s", "unit": "mNm", "at": [0.0, 300.0, 600.0],
        "value": [0.0, 0.3, 0.0], "std": [0.02, 0.02, 0.02],
        "sentence": "about 0.30 +- 0.02 mNm more drag around 150 to 450 s after the log's start",
        "record": "a second log: `rw-ekf excite identification`",
    }  # fmt: skip
    shapes = [shape, {**shape, "dependence": "current", "at_unit": "mA", "sentence": "nothing"}]
    poor = replace(poor, content={**poor.content, "shapes": shapes})
    page = report(poor, tmp_path)
    assert (tmp_path / "shapes.png").exists()
    assert page.images[0]["src"] == "data:image/png;base64," + base64.b64encode(
        (tmp_path / "shapes.png").read_bytes()
    ).decode("ascii")
    assert "explains: about 0.30 ± 0.02 mNm more drag around 150 to 450 s" in page.text.replace("\xa0", " ")
    assert "On time would tell more: a second log: rw-ekf excite identification" in page.text
    assert "against current: nothing" in diagnosis_text(poor.document())


def test_times_since_the_log_s_start_stand_beside_its_own(found: Diagnosis, tmp_path: Path) -> None:
    """Onset and split of a log that begins at 1000 s say so; nothing does where it begins at zero."""
    document = copy.deepcopy(found.document())
    document["candidates"][0]["parameters"] = {"onset_s": {"value": 1230.0, "std": 0.5, "unit": "s"}}
    later = replace(found, log=replace(found.log, time_s=found.log.time_s + 1000.0), content=document)
    page = report(later, tmp_path)
    assert page.text.count("230.0 s after the log's start") == 2
    assert "it starts at 1000 s" in page.text
    assert "log's start" not in report(replace(found, content=document), tmp_path).text


def test_no_rpm_for_a_plant_that_is_no_wheel(found: Diagnosis, tmp_path: Path) -> None:
    """SI throughout, and the figures of the document converted back."""
    plant = replace(
        found, content={**found.document(), "verdict": {"kind": "effect", "effects": [], "statement": "Drag."}}
    )
    page = report(plant, tmp_path, None, wheel=False)
    assert "rpm" not in page.text.replace(str(tmp_path), "")
    (pair,) = (p for p in figure_pairs(found.document(), Units(False, None)) if p.key == "free_run_rms_rpm")
    assert pair.before == pytest.approx(found.document()["before"]["free_run_rms_rpm"] * np.pi / 30.0)
    assert "rpm" not in diagnosis_text(plant.document(), wheel_units=False)


def odd_records(found: Diagnosis) -> dict[str, Diagnosis]:
    log, n = found.log, len(found.log)
    nothing = ModelTrace(*(np.full(n, np.nan) for _ in range(4)))
    still = ModelTrace(*(np.zeros(n) for _ in range(4)))
    restarted = log.time_s.copy()
    restarted[n // 2 :] -= restarted[n // 2]
    return {
        "no speed": replace(found, log=replace(log, speed_rad_s=np.full(n, np.nan))),
        "no residual": replace(found, before=nothing, after=nothing),
        "no error": replace(found, before=still, after=still),
        "no current": replace(found, log=replace(log, current_A=np.zeros(n))),
        "constant temperature": replace(found, temperature_degC=np.full(n, 21.0)),
        "no temperature": replace(found, temperature_degC=np.full(n, np.nan)),
        "clock time": replace(found, log=replace(log, time_s=log.time_s + 1.7e9)),
        "time restarts": replace(
            found, log=replace(log, time_s=restarted, segment=(np.arange(n) >= n // 2).astype(np.int64))
        ),
        "nothing held out": replace(found, heldout=np.zeros(n, dtype=bool)),
        "one sample": many_samples(found, 1),
        "bare document": replace(found, content={"verdict": {"kind": "effect"}, "before": None, "after": None}),
    }


ODD = ("no speed", "no residual", "no error", "no current", "constant temperature", "no temperature", "clock time",
       "time restarts", "nothing held out", "one sample", "bare document")  # fmt: skip


@pytest.mark.parametrize("case", ODD)
def test_odd_records_still_make_a_page(case: str, found: Diagnosis, tmp_path: Path) -> None:
    """Missing speeds, dead channels, restarting time and bare documents: a whole page and no warning."""
    odd = odd_records(found)[case]
    page = report(odd, tmp_path)
    assert "Effect named" in page.text
    assert diagnosis_text(odd.document())
    assert set(odd_records(found)) == set(ODD)


@pytest.mark.slow
def test_a_million_samples_are_thinned(found: Diagnosis, tmp_path: Path) -> None:
    """The whole report of a 1e6-sample record at 1 Hz, split into thousands of stretches, is still a small file."""
    samples = 1_000_000
    long = many_samples(found, samples)
    long = replace(
        long,
        log=replace(long.log, time_s=np.arange(samples, dtype=float)),
        heldout=(np.arange(samples) // 40) % 2 == 1,
    )
    report(long, tmp_path)
    assert (tmp_path / "report.html").stat().st_size < 4_000_000


def test_a_thinned_line_keeps_its_spikes() -> None:
    """Of 200000 points few are left, in order, with every extreme among them and a long gap still a gap."""
    rng = np.random.default_rng(3)
    y = rng.standard_normal(200_000)
    y[123_456], y[77_777] = 50.0, -60.0
    y[10_000:30_000] = np.nan
    x, thin = thinned_line(np.arange(y.size, dtype=float), y)
    assert thin.size <= 3002
    assert (np.diff(x) >= 0.0).all()
    assert np.nanmax(thin) == 50.0
    assert np.nanmin(thin) == -60.0
    assert np.isnan(thin[(x > 10_200) & (x < 29_800)]).all()


def test_standard_errors_of_binned_means_are_honest() -> None:
    """On a smoothed noise without any dependence 2 standard errors cover the means in about 95 %; structure shows."""
    rng = np.random.default_rng(4)
    inside: list[bool] = []
    for _ in range(60):
        noise = np.convolve(rng.standard_normal(6008), np.ones(9) / 9.0, "valid")
        x = np.linspace(0.0, 1.0, noise.size)
        correlation = correlation_samples(noise, 400)
        found = binned_means(x, noise, np.ones(noise.size, bool), np.linspace(0.0, 1.0, 11), correlation)
        inside += list(np.abs(found.mean) < 2.0 * found.standard_error)
    assert 0.90 <= np.mean(inside) <= 0.99
    bent = binned_means(x, noise + np.sin(6.0 * x), np.ones(x.size, bool), np.linspace(0.0, 1.0, 11), correlation)
    assert bent.structure == pytest.approx(np.sqrt(np.mean(np.sin(6.0 * x) ** 2)), rel=0.05)
    assert found.structure < 0.05


@pytest.mark.parametrize("width", [1, 2, 5, 8, 300])
def test_sums_over_windows_are_those_of_the_library(width: int) -> None:
    """Against scipy's filter, whose import takes longer than a report has time for; a window may be longer than all."""
    y = np.random.default_rng(2).normal(size=120)
    theirs = width * uniform_filter1d(y, width, mode="constant")
    np.testing.assert_allclose(window_sums(y, width), theirs, atol=1e-12)


def test_running_means_stop_at_a_stretch() -> None:
    """A step between two stretches stays a step; what is missing does not pull the mean down."""
    y = np.r_[np.full(100, 5.0), np.full(100, -5.0)]
    y[20:25] = np.nan
    starts = np.zeros(200, bool)
    starts[100] = True
    means = running_means(y, starts, 50)
    # The edge of a stretch has fewer samples beneath its window, not other ones.
    np.testing.assert_allclose(means[:100], 5.0)
    np.testing.assert_allclose(means[100:], -5.0)


def test_the_terminal_has_the_verdict_first(found: Diagnosis) -> None:
    """Verdict, aligned figures, the effect, at most five others, one line of untestable ones, where the report is."""
    lines = diagnosis_text(found.document(), directory=Path("runs/d")).splitlines()
    assert lines[0] == "runs/2026-11-21T0512.csv: effect named"
    assert lines[1].strip() == found.document()["verdict"]["statement"]
    arrows = [line.index("->") for line in lines[2:] if " -> " in line and line.startswith("    ")]
    assert len(arrows) == 6
    assert len(set(arrows)) == 1
    assert "    viscous_temperature: slope_1_K -0.0300 +- 0.0005 1/K" in lines
    assert sum("  p " in line for line in lines) == 5
    assert "  not testable: torque_ripple (needs angle_rad, which is not logged)" in lines
    assert lines[-2] == "  report: runs/d/report.html"
    assert "\n".join(lines).isascii()


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.99996, "1.00"), (9.996, "10.0"), (999.7, "1000"), (12345.0, "12345"), (0.0145, "0.0145"), (None, "–"),
     (float("nan"), "–"), (0.0, "0"), (-3.14159, "-3.14"), (2.5e-7, "2.5e-07")],
)  # fmt: skip
def test_numbers_have_three_digits(value: float | None, text: str) -> None:
    """Three significant digits, trailing zeros kept, rounding carried over."""
    assert number_text(value) == text
