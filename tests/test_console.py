"""What reaches a terminal: text from outside only as text."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from rw_ekf import console
from rw_ekf.console import logger, printable
from tests.live.bench import ROOT, rw_ekf, write_config

EVIL = "\x1b]0;owned\x07\x1b[2J\x9b31m\u202ednatsrednu\r"
ACTS = {chr(code) for code in (*range(0x20), *range(0x7F, 0xA0), *range(0x202A, 0x202F))} - {"\n", "\t"}


def acts(text: str) -> set[str]:
    """Characters in a text that a terminal would act on."""
    return ACTS & set(text)


def test_text_from_outside_is_shown_and_not_acted_on() -> None:
    """Controls of both tables, and what turns the direction of reading, as in JSON; letters of any script stay."""
    assert acts(printable(EVIL)) == set()
    assert json.loads(f'"{printable(EVIL)}"') == EVIL
    assert printable("Prüfstand 東京\tΩ\n") == "Prüfstand 東京\tΩ\n"
    assert printable(b"\xf6".decode(errors="surrogateescape")) == "\\udcf6"


def test_no_verb_lets_a_name_act_on_the_terminal(tmp_path: Path) -> None:
    """Such a name as a log, its columns, a port, a model, a configuration, an argument: no control comes out."""
    log = tmp_path / f"{EVIL}.csv"
    rows = "".join(f"{0.1 * i:.1f},{100 + i % 7},0.1,0\n" for i in range(200))
    log.write_text(f'time_s,speed_rpm,current_A,"{EVIL.strip()}"\n{rows}', encoding="utf-8", newline="\n")
    config = write_config(tmp_path, f"/nowhere/{EVIL}")
    for wanted in (
        ("replay", str(log)),
        ("export", str(log), str(tmp_path / f"{EVIL}out.csv")),
        ("replay", str(log), "--columns", EVIL),
        ("replay", str(log), "--model", EVIL),
        ("run", "--config", str(config)),
        ("status", "--config", str(config)),
        ("stop", "--config", str(config)),
        ("check-config", EVIL),
        ("spikes", str(tmp_path / EVIL)),
        (EVIL,),
    ):
        done = rw_ekf(*wanted)
        assert done.stdout + done.stderr
        assert acts(done.stdout + done.stderr) == set(), wanted
        assert "Traceback" not in done.stderr


def test_a_document_stays_what_it_is(tmp_path: Path) -> None:
    """`replay --json` of a log of such a name: the document holds the name as it is."""
    log = tmp_path / f"{EVIL}\x7f.csv"
    rows = "".join(f"{0.1 * i:.1f},{100 + i % 7},0.1\n" for i in range(200))
    log.write_text(f"time_s,speed_rpm,current_A\n{rows}", encoding="utf-8")
    done = rw_ekf("replay", str(log), "--json")
    assert json.loads(done.stdout)["logs"][0]["log"] == str(log)
    assert acts(done.stdout) == set()


def test_an_event_s_text_is_only_text(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """A reason from a device, in a line for people."""
    monkeypatch.setattr(console, "STATUS", console.Status())  # another test may have left a line that would be cleared
    logger().warning("link_lost", reason=EVIL)
    assert acts(capsys.readouterr().err) == set()


def test_a_library_s_complaint_is_only_text() -> None:
    """A warning from elsewhere, printed by Python itself while a verb runs."""
    probe = (
        "import sys, warnings; from rw_ekf.console import printable_streams\n"
        f"with printable_streams(): warnings.warn({EVIL!r}); print({EVIL!r})"
    )
    done = subprocess.run([sys.executable, "-c", probe], capture_output=True, text=True, cwd=ROOT, check=True)
    assert "owned" in done.stderr
    assert acts(done.stdout + done.stderr) == set()
