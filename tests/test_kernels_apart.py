"""What kernels are compiled for: arrays that share no memory (docs/decisions/0049)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

import rw_ekf
from rw_ekf.compiled import Kernel


def _arrays(value: Any) -> Iterator[np.ndarray[Any, Any]]:
    if isinstance(value, np.ndarray):
        if value.size:
            yield value
    elif isinstance(value, tuple | list):
        for part in value:
            yield from _arrays(part)


def test_what_is_compiled_as_apart_is_handed_arrays_that_are_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    """What a call of such a kernel writes shares no memory with anything else that it is handed.

    Looked at in all calls of a replay with states and smoothing, one with an effect, a fit and a diagnosis.
    """
    seen = Counter[str]()
    overlapping: list[str] = []
    original = Kernel.__call__

    def watched(kernel: Kernel, *args: Any) -> Any:
        if not kernel.apart:
            return original(kernel, *args)
        arrays = list(_arrays(args))
        before = [array.copy() for array in arrays]
        result = original(kernel, *args)
        seen[kernel.dispatcher.__name__] += 1
        for i, array in enumerate(arrays):
            if array.tobytes() != before[i].tobytes():
                others = (other for j, other in enumerate(arrays) if j != i)
                overlapping.extend(kernel.dispatcher.__name__ for other in others if np.shares_memory(array, other))
        return result

    monkeypatch.setattr(Kernel, "__call__", watched)
    log = rw_ekf.simulate("identification", effects=["actuator_lag"], seed=3)
    model = rw_ekf.diagnose(log).model
    rw_ekf.replay(log, smooth=True)
    rw_ekf.replay(log, model=model)
    rw_ekf.fit(log)
    assert set(seen) == {
        "_filter_pass", "_filter_pass_with_effects", "_one_step_pass", "_one_step_pass_with_effects",
    }  # fmt: skip
    assert overlapping == []
