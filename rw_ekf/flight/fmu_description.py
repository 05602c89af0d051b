"""modelDescription.xml of FMI 2.0 and 3.0: the variables of the wheel, their units, and what depends on what."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import dataclass
from typing import Literal

from rw_ekf.flight.plant_model import PlantModel
from rw_ekf.model.effect import REFERENCE_DEGC
from rw_ekf.model.state import STATE_UNITS
from rw_ekf.version import __version__

Version = Literal[2, 3]
# Value references, as `model.h` hands them to the C; parameters follow STATE in the order of the state.
TIME, CURRENT, TEMPERATURE, COLUMN, SPEED, ANGLE, FRICTION, TORQUE, INERTIA, STATE = 0, 1, 2, 3, 10, 11, 12, 13, 20, 100

# Exponents of the base units; what is missing here is a unit by its name alone.
_BASES: dict[str, dict[str, str]] = {
    "A": {"A": "1"},
    "s": {"s": "1"},
    "1/s": {"s": "-1"},
    "rad": {"rad": "1"},
    "rad/s": {"rad": "1", "s": "-1"},
    "rad/s^2": {"rad": "1", "s": "-2"},
    "rad/s^2/A": {"rad": "1", "s": "-2", "A": "-1"},
    "kg.m2": {"kg": "1", "m": "2"},
    "N.m": {"kg": "1", "m": "2", "s": "-2"},
    "degC": {"K": "1", "offset": "273.15"},
}
_OWN_NAMES = (
    "time", "current_A", "temperature_degC", "speed_rad_s", "angle_rad", "friction_rad_s2", "friction_torque_N_m",
    "inertia_kg_m2",
)  # fmt: skip
_PARAMETER_WORDS = {
    "motor_gain": "acceleration per ampere",
    "viscous": "viscous friction per inertia",
    "coulomb": "Coulomb friction per inertia",
    "static": "break-away friction per inertia",
}


@dataclass(frozen=True)
class Variable:
    """One variable of the FMU."""

    name: str
    reference: int
    causality: str
    unit: str
    words: str
    start: float | None  # None: calculated

    @property
    def is_fixed(self) -> bool:
        """Whether it stays over a simulation."""
        return self.causality == "parameter"

    @property
    def initial(self) -> str | None:
        """As FMI has it; an input has none."""
        if self.causality == "input":
            return None
        return "calculated" if self.start is None else "exact"


def variables_of(model: PlantModel) -> list[Variable]:
    """All variables, in order."""
    found = [Variable("current_A", CURRENT, "input", "A", "commanded current, constant within a step", 0.0)]
    if model.has_temperature:
        words = "temperature that effects are functions of"
        found.append(Variable("temperature_degC", TEMPERATURE, "input", "degC", words, REFERENCE_DEGC))
    taken = {*_OWN_NAMES, *model.state_names}
    for slot, column in enumerate(model.columns):
        name = f"column_{slot + 1}_{column.name}" if column.name in taken else column.name
        taken.add(name)
        words = "column of the log that a learned law is a function of, in its unit"
        found.append(Variable(name, COLUMN + slot, "input", "", words, column.start))
    found += [
        Variable("speed_rad_s", SPEED, "output", "rad/s", "speed of the wheel; its start can be set", 0.0),
        Variable("angle_rad", ANGLE, "output", "rad", "angle turned; its start can be set", 0.0),
        Variable(
            "friction_rad_s2", FRICTION, "output", "rad/s^2", "friction per inertia, above zero against a forward turn",
            None,
        ),
    ]  # fmt: skip
    if model.inertia_kg_m2 is not None:
        words = "friction torque, above zero against a forward turn"
        found.append(Variable("friction_torque_N_m", TORQUE, "output", "N.m", words, None))
        words = "of the wheel: turns the friction into a torque, and nothing else"
        found.append(Variable("inertia_kg_m2", INERTIA, "parameter", "kg.m2", words, model.inertia_kg_m2))
    units = [STATE_UNITS[name] for name in _PARAMETER_WORDS]
    units += [term.effect.coefficient.unit for term in model.effects.state_terms for _ in term.values]
    for at, (name, unit) in enumerate(zip(model.state_names, units, strict=True), start=1):
        words = _PARAMETER_WORDS.get(name, "coefficient of the effect (docs/effects.md)")
        found.append(Variable(name, STATE + at, "parameter", unit, words, float(model.x[at])))
    return found


def description(model: PlantModel, identifier: str, token: str, version: Version, sources: tuple[str, ...]) -> str:
    """modelDescription.xml. identifier: name of the library; token: that the library expects; sources: its C."""
    root = ET.Element("fmiModelDescription", fmiVersion=f"{version}.0", modelName=identifier)
    root.set("guid" if version == 2 else "instantiationToken", token)
    effects = ", ".join(model.effects.ids) or "none"
    root.set("description", f"Reaction wheel of the model {model.name}; effects: {effects}")
    root.set("generationTool", f"rw_ekf {__version__}")
    root.set("variableNamingConvention", "flat")
    simulated = ET.SubElement(root, "CoSimulation", modelIdentifier=identifier)
    simulated.set("canHandleVariableCommunicationStepSize", "true")
    if version == 2:
        simulated.set("canNotUseMemoryManagementFunctions", "true")
    state = "FMUstate" if version == 2 else "FMUState"
    simulated.set(f"canGetAndSet{state}", "true")
    simulated.set(f"canSerialize{state}", "true")
    if version == 2:
        files = ET.SubElement(simulated, "SourceFiles")
        for name in sources:
            ET.SubElement(files, "File", name=name)
    variables = variables_of(model)
    _units(root, variables)
    categories = ET.SubElement(root, "LogCategories")
    ET.SubElement(categories, "Category", name="logStatusError")
    ET.SubElement(root, "DefaultExperiment", startTime="0.0", stepSize=repr(model.period_s))
    (_variables_2 if version == 2 else _variables_3)(root, variables)
    ET.indent(root)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{ET.tostring(root, encoding="unicode")}\n'


def _units(root: ET.Element, variables: list[Variable]) -> None:
    units = ET.SubElement(root, "UnitDefinitions")
    for name in dict.fromkeys(variable.unit for variable in variables if variable.unit):
        unit = ET.SubElement(units, "Unit", name=name)
        if name in _BASES:
            ET.SubElement(unit, "BaseUnit", _BASES[name])


def _described(element: ET.Element, of: Variable) -> None:
    element.set("name", of.name)
    element.set("valueReference", str(of.reference))
    element.set("description", of.words)
    element.set("causality", of.causality)
    element.set("variability", "fixed" if of.is_fixed else "continuous")
    if of.initial is not None:
        element.set("initial", of.initial)


def _valued(element: ET.Element, of: Variable) -> None:
    if of.unit:
        element.set("unit", of.unit)
    if of.start is not None:
        element.set("start", repr(of.start))


def _variables_2(root: ET.Element, variables: list[Variable]) -> None:
    listed = ET.SubElement(root, "ModelVariables")
    for variable in variables:
        element = ET.SubElement(listed, "ScalarVariable")
        _described(element, variable)
        _valued(ET.SubElement(element, "Real"), variable)
    structure = ET.SubElement(root, "ModelStructure")
    outputs, unknown = ET.SubElement(structure, "Outputs"), ET.SubElement(structure, "InitialUnknowns")
    for index, variable in enumerate(variables, start=1):
        if variable.causality == "output":
            ET.SubElement(outputs, "Unknown", index=str(index))
        if variable.initial == "calculated":
            ET.SubElement(unknown, "Unknown", index=str(index))


def _variables_3(root: ET.Element, variables: list[Variable]) -> None:
    listed = ET.SubElement(root, "ModelVariables")
    time = ET.SubElement(listed, "Float64", name="time", valueReference=str(TIME), causality="independent")
    time.set("variability", "continuous")
    time.set("unit", "s")
    units = root.find("UnitDefinitions")
    if units is not None and units.find("Unit[@name='s']") is None:
        ET.SubElement(ET.SubElement(units, "Unit", name="s"), "BaseUnit", _BASES["s"])
    structure = ET.SubElement(root, "ModelStructure")
    for variable in variables:
        element = ET.SubElement(listed, "Float64")
        _described(element, variable)
        _valued(element, variable)
        if variable.causality == "output":
            ET.SubElement(structure, "Output", valueReference=str(variable.reference))
    for variable in variables:
        if variable.initial == "calculated":
            ET.SubElement(structure, "InitialUnknown", valueReference=str(variable.reference))


def build_description(identifier: str, sources: tuple[str, ...]) -> str:
    """sources/buildDescription.xml of FMI 3.0."""
    root = ET.Element("fmiBuildDescription", fmiVersion="3.0")
    configuration = ET.SubElement(root, "BuildConfiguration", modelIdentifier=identifier)
    files = ET.SubElement(configuration, "SourceFileSet", language="C99")
    for name in sources:
        ET.SubElement(files, "SourceFile", name=name)
    ET.indent(root)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{ET.tostring(root, encoding="unicode")}\n'
