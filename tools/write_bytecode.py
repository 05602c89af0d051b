"""Import all of rw_ekf, so that bytecode lies beside what a runtime installation loads, and beside nothing else.

pip compiles every file of every package: 100 MB, of which a sixth is ever loaded. Where Python may write no bytecode
(PYTHONDONTWRITEBYTECODE), what is not compiled here is compiled at every start.
"""

from __future__ import annotations

import importlib
import pkgutil

import rw_ekf


def main() -> None:
    """Import every module but those that run something, and those of extras that are not installed."""
    for module in pkgutil.walk_packages(rw_ekf.__path__, "rw_ekf."):
        if module.name.endswith("__main__"):
            continue
        try:
            importlib.import_module(module.name)
        except ModuleNotFoundError as error:
            if error.name is None or error.name.startswith("rw_ekf"):
                raise
    importlib.import_module("matplotlib.pyplot")


if __name__ == "__main__":
    main()
