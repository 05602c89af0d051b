"""Whatever stands in a log or a configuration, the command line answers with a status and a sentence."""

from __future__ import annotations

import json
import random
from pathlib import Path

import pytest

from rw_ekf.cli import main
from tests.commands.documents import diagnosis_document, replay_document
from tests.commands.logs import profile_log
from tests.live.bench import document_of

CELLS = ["", "nan", "inf", "-inf", "1e400", "1e300", "-1e300", "1e-320", "abc", '"', "1,2", "0x10", "٣", "1_0", "-0.0"]
VALUES = [
    "null",
    "true",
    "[]",
    "{}",
    "-1",
    "0",
    "1e400",
    ".nan",
    ".inf",
    "''",
    "abc",
    "!!python/object:os.system x",
    "*a",
]
CONFIG = """\
wheel:
  port: /tmp/no-such-wheel
  inertia_kg_m2: 1.5e-3
  stribeck_speed_rpm: 4.0
limits:
  current_A: 0.6
  slew_A_per_s: 5.0
  speed_rpm: 4200
  temperature_degC: 60
  silence_s: 0.5
loop:
  rate_hz: 10.0
  reply_timeout_ms: 40
filter:
  speed_noise_rpm: 1.0
  model: null
command:
  profile: sine
  amplitude_A: 0.1
  period_s: 30
  bias_A: 0.0
output:
  directory: runs
"""


def mutated_log(text: str, rng: random.Random) -> bytes:
    """The log with one to four faults: cells, rows, bytes, the end."""
    rows = [row.split(",") for row in text.splitlines()]
    for _ in range(rng.randint(1, 4)):
        at, kind = rng.randrange(len(rows)), rng.randrange(7)
        if kind <= 2:
            rows[at][rng.randrange(len(rows[at]))] = rng.choice(CELLS)
        elif kind == 3:
            rows.insert(at, list(rng.choice(rows)))
        elif kind == 4:
            rows[at] = rows[at][: rng.randrange(3)] or [""]
        elif kind == 5:
            rows = rows[: max(at, 1)]
        else:
            rng.shuffle(rows[0])
    content = "\n".join(",".join(row) for row in rows).encode()
    if rng.random() < 0.25:
        where = rng.randrange(len(content))
        content = content[:where] + bytes(rng.randrange(256) for _ in range(3)) + content[where:]
    return content


def mutated_config(rng: random.Random) -> str:
    """The configuration with one or two values, keys or lines changed."""
    lines = CONFIG.splitlines()
    for _ in range(rng.randint(1, 2)):
        at, kind = rng.randrange(len(lines)), rng.randrange(6)
        key = lines[at].partition(":")[0]
        if kind <= 1:
            lines[at] = f"{key}: {rng.choice(VALUES)}"
        elif kind == 2:
            lines[at] = f"{key}: {10.0 ** rng.uniform(-4, 6):.6f}"
        elif kind == 3:
            lines.insert(rng.randrange(len(lines)), lines[at])
        elif kind == 4:
            lines[at] = lines[at][: rng.randrange(len(lines[at]) + 1)]
        elif len(lines) > 1:
            del lines[at]
    return "\n".join(lines) + "\n"


def status_of(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str]:
    """Exit status and standard output; on failure one or more sentences, with --json the same as a document."""
    status = main(arguments)
    out, errors = capsys.readouterr()
    assert status in (0, 1, 2)
    assert "Traceback" not in errors
    if status != 0:
        if "--json" in arguments:
            assert json.loads(out)["exit_status"] == status
        else:
            assert out == ""
        assert all(line.startswith(("rw-ekf: error: ", "rw-ekf: warning: ")) for line in errors.splitlines())
        assert "rw-ekf: error: " in errors
    return status, out


def test_sixty_spoilt_logs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Sixty logs with cells, rows and bytes spoilt: refused in a sentence, or replayed to a document of numbers."""
    text = profile_log(tmp_path / "good.csv", samples=120).read_text(encoding="utf-8")
    statuses = []
    for seed in range(60):
        log = tmp_path / "spoilt.csv"
        log.write_bytes(mutated_log(text, random.Random(seed)))
        status, out = status_of(capsys, "replay", str(log), "--json")
        if status == 0:
            replay_document(out)
        statuses.append(status)
    assert 5 < statuses.count(0) < 55  # the spoiling is neither harmless nor always deadly


@pytest.mark.slow
def test_fits_of_spoilt_logs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The same through `fit`, with and without the noise, and by single experiments."""
    text = profile_log(tmp_path / "good.csv", samples=120).read_text(encoding="utf-8")
    for seed in range(100, 130):
        log = tmp_path / "spoilt.csv"
        log.write_bytes(mutated_log(text, random.Random(seed)))
        for flags in ([], ["--noise"], ["--method", "deterministic"]):
            status, out = status_of(capsys, "fit", str(log), "--json", *flags)
            if status == 0:
                document_of(out)


@pytest.mark.slow
def test_diagnoses_of_spoilt_logs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The same through `diagnose`, with a report: a whole document, or a sentence."""
    text = profile_log(tmp_path / "good.csv", samples=240).read_text(encoding="utf-8")
    statuses = []
    for seed in range(200, 230):
        log = tmp_path / "spoilt.csv"
        log.write_bytes(mutated_log(text, random.Random(seed)))
        status, out = status_of(capsys, "diagnose", str(log), "--json", "--out", str(tmp_path / "out"))
        if status == 0:
            diagnosis_document(out)
        statuses.append(status)
    assert {0, 2} <= set(statuses)


def test_sixty_spoilt_configurations(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Sixty configurations spoilt: check-config says whether it is one; stop tries the port wherever it can be read."""
    statuses = []
    for seed in range(60):
        config = tmp_path / "spoilt.yaml"
        config.write_text(mutated_config(random.Random(seed)), encoding="utf-8")
        status, out = status_of(capsys, "check-config", str(config), "--json")
        if status == 0:
            document_of(out)
        statuses.append(status)
        # There is no such port: 1 where the line's keys can be read, whatever else is wrong.
        assert status_of(capsys, "stop", "--config", str(config))[0] in ({1} if status == 0 else {1, 2})
    assert set(statuses) == {0, 2}


@pytest.mark.parametrize("seed", range(8))
def test_numbers_of_any_size_end_in_numbers_or_a_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], seed: int
) -> None:
    """Speeds and currents of wild size throughout a log: a document of finite numbers, or status 1 or 2."""
    rng = random.Random(seed)
    scale, drive = 10.0 ** rng.uniform(-8, 12), 10.0 ** rng.uniform(-8, 12)
    rows = [f"{0.1 * i:.1f},{scale * rng.gauss(0, 1)!r},{drive * rng.gauss(0, 1)!r}" for i in range(150)]
    log = tmp_path / "wild.csv"
    log.write_text("time_s,speed_rad_s,current_command_A\n" + "\n".join(rows) + "\n", encoding="utf-8")
    status, out = status_of(capsys, "replay", str(log), "--json")
    if status == 0:
        replay_document(out)
    status, out = status_of(capsys, "diagnose", str(log), "--json")
    if status == 0:
        diagnosis_document(out)
