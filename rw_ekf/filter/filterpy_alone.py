"""filterpy's extended Kalman filter, imported without two parts of SciPy that it never calls for this filter.

filterpy imports all of itself at once, with it `scipy.stats` and `scipy.ndimage`: .35 s of CPU and 35 MB in every
daemon, for densities and shifts of grids that a Kalman filter uses only where its `log_likelihood` is used.
For as long as filterpy is imported, names of these two stand for what is loaded when one of them is first used.
"""

from __future__ import annotations

import sys
from importlib import import_module
from types import ModuleType
from typing import Any

# What filterpy 2.0 takes from each by name (filterpy.stats.stats, filterpy.discrete_bayes).
_LATER = {"scipy.stats": ("norm", "multivariate_normal"), "scipy.ndimage": ("convolve", "shift")}
_STANDING_IN: set[str] = set()


class _Later:
    """One object of a module, which is loaded when the object is first used."""

    def __init__(self, module: str, name: str) -> None:
        self._place = module, name

    def __getattr__(self, name: str) -> Any:
        module, own = self._place
        if module in _STANDING_IN:  # filterpy tests, while it is imported, whether logpdf knows a keyword: it does
            return lambda *arguments, **keywords: None
        return getattr(getattr(import_module(module), own), name)

    def __call__(self, *arguments: Any, **keywords: Any) -> Any:
        module, own = self._place
        return getattr(import_module(module), own)(*arguments, **keywords)


def _stand_in(module: str) -> ModuleType:
    standing = ModuleType(module)
    for name in _LATER[module]:
        setattr(standing, name, _Later(module, name))
    return standing


_absent = [module for module in _LATER if module not in sys.modules]
_STANDING_IN.update(_absent)
sys.modules.update({module: _stand_in(module) for module in _absent})
try:
    from filterpy.kalman import ExtendedKalmanFilter
finally:
    for _module in _absent:
        del sys.modules[_module]
    _STANDING_IN.clear()

__all__ = ["ExtendedKalmanFilter"]
