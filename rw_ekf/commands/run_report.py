"""What is reported at the end of a run: warnings, lines for a person, the document of `run --json`, the exit status."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from rw_ekf.console import shown_path
from rw_ekf.records import RunState

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from rw_ekf.live.run_outcome import RunOutcome

SAFE_STATUS = 5


def exit_status(outcome: RunOutcome) -> int:
    """What a run's exit says: a lost line (1) comes before a safety stop (5), which a line that is lost brings on."""
    no_sample = outcome.statistics.samples == 0 and outcome.stopped_by is None
    if outcome.lost or no_sample or not outcome.zero_confirmed:
        return 1
    if outcome.halted is not None or outcome.state.state is RunState.SAFE:
        return SAFE_STATUS
    return 1 if outcome.unwritten else 0


def _remarks_of_run(outcome: RunOutcome) -> list[str]:
    """Sentences for the document that a person has already read on standard error, as they came."""
    unconfirmed = "the wheel did not confirm zero current at the end; `rw-ekf stop --config F` tries again"
    return [*([] if outcome.zero_confirmed else [unconfirmed]), *outcome.alarms]


def warnings_of(outcome: RunOutcome) -> list[str]:
    """Judge the last hour of the run; a run's own numbers never fail because of this."""
    from rw_ekf.errors import RwEkfError
    from rw_ekf.residual_judgement import consistency_now

    found = _remarks_of_run(outcome)
    if outcome.lost:
        found.append("the link to the wheel was lost to the end of the run")
    if outcome.link.reconnects > 0 and not outcome.lost:
        found.append(
            f"the link was lost and taken up again {outcome.link.reconnects} times; the log has a gap each time"
        )
    if outcome.unwritten:
        found.append(outcome.unwritten.text())
    found += [f"{ticks} ticks went nowhere from output.{name}" for name, ticks in outcome.unwritten.not_sent.items()]
    if outcome.state.state is RunState.SAFE:
        found.append(
            f"the run ended in SAFE, only zero was written since {outcome.state.since_utc}: {outcome.state.reason}"
        )
    found += outcome.findings
    if outcome.statistics.samples == 0:
        return [*found, "no sample came from the wheel"]
    refused = outcome.statistics.gate_finding(outcome.setup.constants.gate)
    if refused is not None:
        found.append(refused)
    log = shown_path(outcome.files.log)
    try:
        course = outcome.recent.course()
        judged, _ = consistency_now(course, outcome.setup, outcome.belief)
    except (RwEkfError, ArithmeticError, ValueError, LookupError) as error:
        return [*found, f"the run's residual could not be judged: {error}"]
    stretch = (
        "" if outcome.recent.is_whole else f" (Judged over the last {course.duration_s / 60.0:.3g} min of the run.)"
    )
    # A command that is named can be run from here, as it stands.
    return [*found, *(text.replace(" LOG", f" {log}") + stretch for text in judged.warnings())]


def report_text(outcome: RunOutcome, warnings: list[str], afterwards: Callable[[str], str] | None = None) -> str:
    """For a person, without what standard error already reported. afterwards: one more line, from the log's name."""
    from rw_ekf.documents import entry_text

    stated = _remarks_of_run(outcome)
    entry = _entry(outcome, warnings)
    entry |= {"log": shown_path(outcome.files.log), "warnings": [text for text in warnings if text not in stated]}
    lines = [entry_text(entry, outcome.statistics, outcome.belief, outcome.setup)]
    if outcome.alarms:
        lines.append(f"  alarms: {len(outcome.alarms)} lines above, as they came")
    if outcome.model is not None:
        lines.append(f"  model: {shown_path(outcome.model)}  (run, replay and diagnose take it: --model)")
    elif outcome.files.model.name in outcome.unwritten.other_files:
        lines.append("  model: none, because it could not be written")
    elif outcome.statistics.samples:
        lines.append("  model: none, because the run learned nothing that its configuration does not say")
    if afterwards is not None:
        lines.append(afterwards(shown_path(outcome.files.log)))
    return "\n".join(lines) + "\n"


def report_document(outcome: RunOutcome, warnings: list[str], more: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """For programs. more: keys beside a run's own."""
    from rw_ekf.documents import REPLAY_SCHEMA

    entry = _entry(outcome, warnings)
    link, timing = outcome.link, outcome.timing
    document: dict[str, Any] = {
        "schema": REPLAY_SCHEMA,
        "logs": [entry],
        "seconds": {"read": 0.0, "filter": outcome.statistics.duration_s, "write": 0.0},
        "link": {
            "requests": link.requests,
            "timeouts": link.timeouts,
            "stale": link.stale,
            "damaged": link.damaged,
            "reconnects": link.reconnects,
        },
        "reply": {"mean_ms": link.reply_ms, "jitter_ms": link.reply_jitter_ms, "max_ms": link.reply_ms_max},
        "loop": {
            "ticks": timing.ticks,
            "overruns": timing.overruns,
            "late_ms_p50": timing.percentile_ms(0.50),
            "late_ms_p99": timing.percentile_ms(0.99),
            "late_ms_max": timing.late_ms_max,
        },
        "stopped_by": outcome.stopped_by,
        "state": outcome.state._asdict(),
        "start": outcome.start,
        "model": None if outcome.model is None else str(outcome.model),
        "unwritten": {
            "log_rows": outcome.unwritten.log_rows,
            "estimate_rows": outcome.unwritten.estimate_rows,
            "state_files": outcome.unwritten.state_files,
            "other_files": outcome.unwritten.other_files,
            "not_sent": outcome.unwritten.not_sent,
        },
    }
    return document | dict(more or {})


def _entry(outcome: RunOutcome, warnings: list[str]) -> dict[str, Any]:
    from rw_ekf.documents import log_entry

    return log_entry(str(outcome.files.log), outcome.statistics, outcome.belief, outcome.setup, warnings)
