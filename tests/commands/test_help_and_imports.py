"""The command line answers at once: help, stop and check-config import nothing heavy; every verb shows an example."""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from rw_ekf.cli import VERBS, build_parser, main
from tests.commands.logs import profile_log
from tests.contract import check_document
from tests.live.bench import ROOT, served_wheel, write_config

HEAVY = ("numpy", "numba", "scipy", "filterpy", "pyarrow", "matplotlib", "rw_ekf.filter", "rw_ekf.diagnosis")
PROBE = """
import sys
from rw_ekf.cli import main
try:
    status = main(sys.argv[1:])
except SystemExit as left:
    status = left.code
print(",".join(name for name in {heavy!r} if name in sys.modules), file=sys.stderr)
sys.exit(status)
"""


def heavy_imports(*arguments: str, heavy: tuple[str, ...] = HEAVY) -> tuple[int, str]:
    """Exit status of a command, and which heavy modules it had imported at its end."""
    done = subprocess.run(
        [sys.executable, "-c", PROBE.format(heavy=heavy), *arguments],
        capture_output=True, text=True, cwd=ROOT, check=False,
    )  # fmt: skip
    return done.returncode, done.stderr.splitlines()[-1]


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_has_help_with_an_example_and_json(verb: str, capsys: pytest.CaptureFixture[str]) -> None:
    """`VERB --help` exits 0, shows `rw-ekf VERB` as an example, and names --json."""
    with pytest.raises(SystemExit) as left:
        main([verb, "--help"])
    assert left.value.code == 0
    text = capsys.readouterr().out
    assert f"rw-ekf {verb}" in text[text.index("example:") :]
    assert "--json" in text


@pytest.mark.parametrize("arguments", [(), ("nonsense",), ("replay",), ("run",), ("stop", "--nonsense")])
def test_wrong_usage_exits_2_with_a_sentence(arguments: tuple[str, ...], capsys: pytest.CaptureFixture[str]) -> None:
    """No verb, an unknown one, a missing argument, an unknown option: status 2, usage on standard error."""
    assert main(arguments) == 2
    out, errors = capsys.readouterr()
    assert out == ""
    assert "usage: rw-ekf" in errors


@pytest.mark.parametrize(("words", "meant"), [(("replya", "x"), "replay"), (("help", "stats"), "status")])
def test_a_verb_that_is_not_there_is_told_its_nearest(
    words: tuple[str, ...], meant: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """A slip of the pen in a verb, also behind `help`: what was meant."""
    assert main(words) == 2
    assert capsys.readouterr().err.endswith(f"did you mean '{meant}'?\n")


@pytest.mark.parametrize(
    ("words", "same"), [(["help"], ["--help"]), (["help", "fit"], ["fit", "--help"]), (["-V"], ["--version"])]
)
def test_other_ways_to_ask_say_the_same(words: list[str], same: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    """`help`, `help VERB` and -V print what the long options do, and end with 0."""
    stated = []
    for wanted in (words, same):
        with pytest.raises(SystemExit) as left:
            main(wanted)
        assert left.value.code == 0
        stated.append(capsys.readouterr().out)
    assert stated[0] == stated[1] != ""


def test_config_and_out_have_one_letter_wherever_they_are() -> None:
    """-c and -o are those two options in every verb that has them, and nothing else in any."""
    (verbs,) = [action for action in build_parser()._actions if isinstance(action, argparse._SubParsersAction)]
    for parser in verbs.choices.values():
        for action in parser._actions:
            for short, long in (("-c", "--config"), ("-o", "--out")):
                assert (short in action.option_strings) is (long in action.option_strings)


@pytest.mark.parametrize(
    ("text", "seconds"),
    [
        ("90", 90.0),
        ("90s", 90.0),
        ("10m", 600.0),
        ("1.5h", 5400.0),
        ("2min", 120.0),
        ("16ms", 0.016),
        ("1d", 86400.0),
        ("1h30m", 5400.0),
        ("1d12h", 129600.0),
        ("2min30.5s", 150.5),
    ],
)
def test_a_duration_has_a_unit_or_is_in_seconds(text: str, seconds: float) -> None:
    """The options of all verbs take the same spellings."""
    parser = build_parser()
    assert parser.parse_args(["run", "-c", "x", "--duration", text]).duration == pytest.approx(seconds)
    assert parser.parse_args(["spikes", "x", "--train", text]).train == pytest.approx(seconds)
    assert parser.parse_args(["flyby", "--avoid", text]).avoid == pytest.approx(seconds)


@pytest.mark.parametrize("option", [("run", "-c", "x.yaml", "--duration"), ("flyby", "--avoid")])
@pytest.mark.parametrize(
    "text", ["0", "-1", "nan", "inf", "1e999", "soon", "5 parsecs", "10M", "30m1h", "1.5h30m", "1h30", ""]
)
def test_a_duration_must_be_above_zero(option: tuple[str, ...], text: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Anything else is wrong usage, and what was found is named."""
    assert main([*option, text]) == 2
    assert f"argument {option[-1]}: {text!r} is no duration above zero" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "kind", "stated"),
    [
        (["nonsense"], "usage", "there is no verb"),
        (["replay"], "usage", "required: LOG"),
        (["check-config", "gone/x.yaml"], "file", "gone/x.yaml"),
        (["replay", "gone.csv"], "log", "gone.csv"),
        (["flyby", "--out", "x.jpg"], "input", "x.jpg"),
    ],
)
@pytest.mark.parametrize("option", ["--json", "--js"])
def test_an_error_is_a_document_where_one_was_asked_for(
    words: list[str], kind: str, stated: str, option: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """One document on standard output, its sentence on standard error too, and the exit status in it."""
    assert main([*words, option]) == 2
    out, errors = capsys.readouterr()
    document = json.loads(out)
    check_document(document)
    (message,) = document["error"]["messages"]
    assert (document["error"]["kind"], document["exit_status"]) == (kind, 2)
    assert stated in message
    assert errors.endswith(f"rw-ekf: error: {message}\n")


@pytest.mark.parametrize(
    ("error", "kind", "status"),
    [(KeyboardInterrupt(), "interrupted", 130), (MemoryError(), "memory", 1), (OSError(28, "No space"), "system", 1)],
)
def test_an_error_from_outside_is_a_document_too(
    error: BaseException, kind: str, status: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Ctrl-C, memory and the system's refusals, unless a document is there already."""
    for printed in ("", "{}\n"):

        def execute(args: argparse.Namespace, printed: str = printed) -> int:
            sys.stdout.write(printed)
            raise error

        monkeypatch.setattr("rw_ekf.commands.export.execute", execute)
        assert main(["export", "a.csv", "b.csv", "--json"]) == status
        document = json.loads(capsys.readouterr().out)
        assert document == {} if printed else document["error"]["kind"] == kind


def threads_for_linear_algebra(first: str, environment: dict[str, str]) -> str:
    """What a process sees that does this first: the variables, and its threads after a product."""
    probe = (
        f"{first}\nimport os, numpy; a = numpy.ones((500, 500)); a @ a; "
        "print(*(os.environ.get(f'{name}_NUM_THREADS') for name in ('OPENBLAS', 'OMP', 'MKL')), "
        "len(os.listdir('/proc/self/task')) if os.path.isdir('/proc/self/task') else 1)"
    )
    unset = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")}
    return subprocess.run(
        [sys.executable, "-c", probe], capture_output=True, text=True, cwd=ROOT, check=True, env=unset | environment
    ).stdout.strip()


def test_calls_that_overlap_in_threads_give_back_the_threads_they_found() -> None:
    """The one that began first ends first; what numpy had comes back when the last one ends, and not before."""
    code = (
        "import threading, scipy.linalg\n"
        "from rw_ekf.one_thread import one_thread\n"
        "from threadpoolctl import threadpool_info, threadpool_limits\n"
        "threadpool_limits(limits=2, user_api='blas')\n"
        "def threads(): return {p['num_threads'] for p in threadpool_info() if p['user_api'] == 'blas'}\n"
        "first, second = one_thread(), one_thread()\n"
        "def elsewhere(call):\n thread = threading.Thread(target=call)\n thread.start()\n thread.join()\n"
        "first.__enter__()\n"
        "elsewhere(second.__enter__)\n"
        "first.__exit__(None, None, None)\nassert threads() == {1}\n"
        "with one_thread(), one_thread(): assert threads() == {1}\n"
        "elsewhere(lambda: second.__exit__(None, None, None))\nassert threads() == {2}\n"
        "seen = []\n"
        "def call():\n with one_thread(): seen.append(threads())\n"
        "elsewhere(call)\nassert (seen, threads()) == ([{1}], {2})"
    )
    subprocess.run([sys.executable, "-c", code], check=True, cwd=ROOT)


def test_a_command_has_one_thread_for_linear_algebra() -> None:
    """A verb leaves one thread (decision 0005); what was set outside stays."""
    verb = "from rw_ekf.cli import main\ntry: main(['check-config', 'nothing'])\nexcept SystemExit: pass"
    assert threads_for_linear_algebra(verb, {}) == "1 1 1 1"
    assert threads_for_linear_algebra(verb, {"MKL_NUM_THREADS": "3"}) == "1 1 3 1"


def test_the_library_leaves_a_program_its_threads() -> None:
    """Importing it sets no variable; while it computes, the linear algebra has one thread, then as many as before."""
    assert threads_for_linear_algebra("import rw_ekf", {}).startswith("None None None ")
    probe = (
        "import numpy, rw_ekf\nfrom threadpoolctl import threadpool_info as info\n"
        "from rw_ekf.one_thread import one_thread\n"
        "def threads(): return [pool['num_threads'] for pool in info() if pool['user_api'] == 'blas']\n"
        "with one_thread():\n import scipy.linalg\n assert set(threads()) == {1}\n"  # whoever loads it, and when
        "before = threads()\nwith one_thread(): assert set(threads()) == {1}\nassert threads() == before"
    )
    subprocess.run([sys.executable, "-c", probe], cwd=ROOT, check=True, env=_without_threads())
    pool = (
        "from rw_ekf.worker_pool import workers\nimport os\n"
        "with workers(1) as pool: print(pool.submit(os.getenv, 'OPENBLAS_NUM_THREADS').result())\n"
        "print(os.getenv('OPENBLAS_NUM_THREADS'))"
    )
    done = subprocess.run(
        [sys.executable, "-c", pool], cwd=ROOT, check=True, capture_output=True, text=True, env=_without_threads()
    )
    assert done.stdout.split() == ["1", "None"]  # of a process of its own, and of the program's


def _without_threads() -> dict[str, str]:
    return {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")}


def test_help_and_check_config_import_nothing_heavy(tmp_path: Path) -> None:
    """Neither the help of all and of each verb, nor a check, loads numpy or anything like it."""
    config = write_config(tmp_path, "/dev/ttyUSB0")
    for arguments in (("--help",), ("run", "--help"), ("replay", "--help"), ("check-config", str(config))):
        assert heavy_imports(*arguments) == (0, ""), arguments


def test_stop_imports_nothing_heavy(tmp_path: Path) -> None:
    """`stop` on a wheel loads no heavy module, and nothing of the filter; `tools.measure.startup` has the times."""
    with served_wheel(tmp_path) as bench:
        assert heavy_imports("stop", "--config", str(bench.config())) == (0, "")


def test_a_run_needs_nothing_of_pictures_and_tables(tmp_path: Path) -> None:
    """A board for which matplotlib, Pillow and arrow have no wheel drives the reaction wheel, and logs what it did."""
    with served_wheel(tmp_path) as bench:
        status, loaded = heavy_imports(
            "run", "--config", str(bench.config()), "--duration", "3", heavy=("matplotlib", "PIL", "pyarrow")
        )
    assert (status, loaded) == (0, "")
    (log,) = (tmp_path / "runs").glob("*_wheel.csv")
    assert len(log.read_text().splitlines()) > 10


def test_a_replay_without_a_file_of_settings_loads_no_checker_of_them(tmp_path: Path) -> None:
    """Of a log of ten minutes that was a tenth of its time, and 8 MB."""
    log = profile_log(tmp_path / "log.csv", samples=300)
    assert heavy_imports("replay", str(log), heavy=("pydantic", "matplotlib", "rw_ekf.diagnosis")) == (0, "")


def test_a_manual_page_has_every_verb_and_troff_takes_it(capsys: pytest.CaptureFixture[str]) -> None:
    """Its lines are the verbs' help; groff, where there is one, has nothing to say about it."""
    assert main(["help", "--man"]) == 0
    page = capsys.readouterr().out
    assert [line[4:] for line in page.splitlines() if line.startswith(".SS ")] == list(VERBS)
    if shutil.which("groff"):
        done = subprocess.run(
            ["groff", "-man", "-Tutf8", "-ww"], input=page, capture_output=True, text=True, check=True
        )
        assert done.stderr == ""
        assert "--duration T" in done.stdout.replace("\u2010", "-")


def test_a_shell_is_told_how_to_complete(capsys: pytest.CaptureFixture[str]) -> None:
    """bash takes the script; a shell that there is none for is refused with those that there are."""
    assert main(["help", "--completion", "bash"]) == 0
    script = capsys.readouterr().out
    subprocess.run(["bash", "-n"], input=script, text=True, check=True)
    assert "--duration" in script
    assert main(["help", "--completion", "fish"]) == 2
    assert "bash, zsh, tcsh" in capsys.readouterr().err


@pytest.mark.parametrize("place", [0, 3])
def test_verbose_says_what_is_done_on_standard_error(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], place: int
) -> None:
    """-v before the verb or behind it: what is read, what will be written, how long it took; without it nothing."""
    log, out = tmp_path / "a.csv", tmp_path / "b.csv"
    log.write_text("time_s,speed_rpm,current_A\n" + "".join(f"{0.1 * i:.1f},{i},0.1\n" for i in range(20)))
    words = ["export", str(log), str(out)]
    assert main([*words[:place], "-v", *words[place:]]) == 0
    printed, stated = capsys.readouterr()
    assert [f"will write {out}" in stated, f"has read {log}: 20 rows" in stated, "export took" in stated] == [True] * 3
    assert main(words) == 0
    assert capsys.readouterr() == (printed, "")
