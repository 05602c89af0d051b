"""`rw-ekf simulate`, `run`, `status` and `stop` with a wheel on a CAN bus: processes of their own, over a real tty."""

from __future__ import annotations

import json
import time
from pathlib import Path

import pytest

from tests.live.bench import document_of, program, rw_ekf, wait_for, write_config

pytest.importorskip("cantools")


@pytest.mark.slow
def test_a_run_from_outside_with_faults_ends_with_zero(tmp_path: Path) -> None:
    """Lost and flipped lines, a second of silence: TRACKING, LOST with zero, TRACKING, and `stop` ends it."""
    link = tmp_path / "wheel"
    config = str(write_config(tmp_path, f"can:slcan:{link}", wheel={"protocol": "can-wheel"}))
    assert rw_ekf("check-config", config).returncode == 0
    faults = "flip/from:2%,drop:2%,silence@20s:1s"  # one silence alone: a stop within a second would end in it
    with program("simulate", "--config", config, "--link", str(link), "--seed", "3", "--fault", faults) as wheel:
        wait_for(link.is_symlink)
        begun_s = time.monotonic()
        with program("run", "--config", config, "--json") as daemon:

            def state() -> str | None:
                reported = rw_ekf("status", "--config", config, "--json")
                return json.loads(reported.stdout)["state"] if reported.returncode in (0, 3) else None

            wait_for(lambda: state() == "TRACKING", 60.0)
            time.sleep(max(begun_s + 22.0 - time.monotonic(), 2.0))
            wait_for(lambda: state() == "TRACKING", 60.0)
            wait_for(lambda: rw_ekf("stop", "--config", config).returncode == 0, 60.0)
            out, errors = daemon.communicate(timeout=60.0)
        assert daemon.returncode == 0, errors
        assert "by=SIGTERM" in errors
        assert "state=LOST" in errors
        document = document_of(out)
        assert document["link"]["damaged"] > 0
        assert document["link"]["timeouts"] > 0
        assert document["logs"][0]["rejected"] == 0
        wheel.terminate()
        assert wheel.wait(20.0) == 0
