"""The first run's models put to the second run as they are: nothing of the second run enters them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from rw_ekf.diagnosis.checks.heldout import performance
from rw_ekf.diagnosis.log_diagnosis import richer_part
from rw_ekf.diagnosis.prepare.preparation import model_of_setup, prepare
from rw_ekf.diagnosis.prepare.source import source_of
from rw_ekf.logs.reader import read_log
from rw_ekf.wheel.model_file import read_model


def frozen_figures(log: str, model_file: Path) -> dict[str, Any]:
    """Figures of docs/contract.md#diagnosis over the whole log, cut into the blocks that a diagnosis makes.

    Parameters and effects are those of the model file, neither fitted nor filtered further; a block's free run starts
    from its first filtered speed.
    """
    model = read_model(model_file)
    prepared = richer_part(prepare(source_of([read_log(log)]), None, model, "blocks"))
    everything = replace(prepared.split, heldout=np.ones(prepared.split.block.size, dtype=np.bool_))
    fit = replace(prepared.base, model=model_of_setup(prepared.setup, model.parameters))
    return performance(replace(prepared, split=everything), fit).figures
