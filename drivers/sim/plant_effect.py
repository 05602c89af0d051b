"""What an effect of a simulated wheel is: numbers that it enters into the plant's parameters."""

from __future__ import annotations

from typing import ClassVar, Protocol

from drivers.sim.plant_parameters import PlantParameters


class PlantEffect(Protocol):
    """One effect with its numbers."""

    id: ClassVar[str]
    in_catalogue: ClassVar[bool]

    def applied_to(self, parameters: PlantParameters) -> PlantParameters:
        """The same wheel with the effect."""
        ...


class Catalogued:
    """An effect that the estimator's catalogue knows too."""

    in_catalogue: ClassVar[bool] = True


class PlantOnly:
    """An effect that the estimator's catalogue does not know: what a diagnosis must call unexplained."""

    in_catalogue: ClassVar[bool] = False
