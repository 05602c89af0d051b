"""Bytes, ports and wheels, real and simulated: everything below a WheelSample.

    protocols -> register_protocol -> wire_map -> registers -> framing -> serial_link -> serial_wheel      on a line
              -> nsp_protocol, nsp                             the same registers as another family of wheels has them
              -> ascii_protocol, ascii_link                    lines of text: ascii_layout, ascii_codec, ascii_template
    plant, plant_effects -> plant_runner -> register_server -> pty_server           a simulated wheel behind one
                                         -> simulated_wheel                         the same plant without a line
                         -> plant_batch                                             the same plant, compiled
    replay_wheel                                                                    a record, as if it were a wheel

Imports nothing of rw_ekf but its records, units, errors and names of arrays. Installed as `rw_ekf.drivers`, so that a
lab's own folder of this name is in nobody's way; a checkout has the folder at its top, and `import drivers` gives the
same modules there.
"""

import importlib
import sys
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType


class _SameModules(MetaPathFinder, Loader):
    """Finds `drivers.x` as `rw_ekf.drivers.x`: one module under two names, not two."""

    _own: ModuleSpec | None

    def find_spec(self, fullname: str, path: object = None, target: object = None) -> ModuleSpec | None:
        return ModuleSpec(fullname, self) if fullname.startswith("drivers.") else None

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        module = importlib.import_module(f"rw_ekf.{spec.name}")
        self._own = module.__spec__
        return module

    def exec_module(self, module: ModuleType) -> None:
        module.__spec__ = self._own  # importing it by its other name has put that in its place


if __name__ == "drivers":
    sys.meta_path.insert(0, _SameModules())
    sys.modules[__name__] = importlib.import_module("rw_ekf.drivers")
