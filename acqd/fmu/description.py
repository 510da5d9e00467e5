"""modelDescription.xml of FMI 2.0 (section 2.2) and FMI 3.0 (section 2.4)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal
from xml.etree import ElementTree as ET

from acqd.fmu.variables import Variable

Version = Literal["2.0", "3.0"]
IDENTIFIER = "acqd_model"
_UNITS: dict[str, dict[str, str]] = {
    "rad": {"rad": "1"},
    "rad/s": {"rad": "1", "s": "-1"},
    "W": {"kg": "1", "m": "2", "s": "-3"},
    "kWh": {"kg": "1", "m": "2", "s": "-2", "factor": "3.6e6"},
    "V": {"kg": "1", "m": "2", "s": "-3", "A": "-1"},
    "Nm": {"kg": "1", "m": "2", "s": "-2"},
    "Nm s/rad": {"kg": "1", "m": "2", "s": "-1", "rad": "-1"},
    "W/Nm^2": {"kg": "-1", "m": "-2", "s": "1"},
    "N": {"kg": "1", "m": "1", "s": "-2"},
    "kg": {"kg": "1"},
    "s": {"s": "1"},
    "1": {},
}


@dataclass(frozen=True, slots=True)
class Described:
    """Contents of modelDescription.xml other than variables."""

    name: str
    description: str
    token: str
    tool: str
    made: str
    """UTC, RFC 3339."""
    step_s: float
    sources: Sequence[str]


def description(version: Version, what: Described, variables: Sequence[Variable]) -> bytes:
    """modelDescription.xml of a version of FMI."""
    root = _two(what, variables) if version == "2.0" else _three(what, variables)
    ET.indent(root)
    return bytes(ET.tostring(root, encoding="utf-8", xml_declaration=True))


def _root(version: Version, what: Described, token: str) -> ET.Element:
    return ET.Element(
        "fmiModelDescription",
        {
            "fmiVersion": version, "modelName": what.name, token: what.token, "description": what.description,
            "generationTool": what.tool, "generationDateAndTime": what.made, "variableNamingConvention": "structured",
        },
    )  # fmt: skip


def _units(root: ET.Element, variables: Sequence[Variable]) -> None:
    units = ET.SubElement(root, "UnitDefinitions")
    for name in dict.fromkeys(unit_of(variable) for variable in variables):
        ET.SubElement(ET.SubElement(units, "Unit", name=name), "BaseUnit", _UNITS[name])


def unit_of(variable: Variable) -> str:
    """The unit of a variable, or "1" if its unit is not defined in the file."""
    return variable.unit if variable.unit in _UNITS else "1"


def _experiment(root: ET.Element, what: Described) -> None:
    ET.SubElement(root, "DefaultExperiment", startTime="0.0", stopTime="60.0", stepSize=repr(what.step_s))


def _two(what: Described, variables: Sequence[Variable]) -> ET.Element:
    root = _root("2.0", what, "guid")
    slave = ET.SubElement(
        root, "CoSimulation",
        modelIdentifier=IDENTIFIER, canHandleVariableCommunicationStepSize="true", canGetAndSetFMUstate="true",
        canSerializeFMUstate="true", canNotUseMemoryManagementFunctions="true",
    )  # fmt: skip
    files = ET.SubElement(slave, "SourceFiles")
    for name in what.sources:
        ET.SubElement(files, "File", name=name)
    _units(root, variables)
    categories = ET.SubElement(root, "LogCategories")
    ET.SubElement(categories, "Category", name="error")
    _experiment(root, what)
    listed = ET.SubElement(root, "ModelVariables")
    for reference, variable in enumerate(variables):
        scalar = ET.SubElement(
            listed, "ScalarVariable",
            {"name": variable.name, "valueReference": str(reference), "description": variable.description}
            | _roles(variable),
        )  # fmt: skip
        real = {"unit": unit_of(variable)}
        if variable.causality != "output":
            real["start"] = repr(variable.start)
        ET.SubElement(scalar, "Real", real)
    scalar = ET.SubElement(
        listed, "ScalarVariable",
        {"name": "reset", "valueReference": str(len(variables)), "description": _RESET, "causality": "input",
         "variability": "discrete"},
    )  # fmt: skip
    ET.SubElement(scalar, "Boolean", start="false")
    structure = ET.SubElement(root, "ModelStructure")
    for kind in ("Outputs", "InitialUnknowns"):
        element = ET.SubElement(structure, kind)
        for number, variable in enumerate(variables, start=1):
            if variable.causality == "output":
                ET.SubElement(element, "Unknown", index=str(number))
    return root


def _three(what: Described, variables: Sequence[Variable]) -> ET.Element:
    root = _root("3.0", what, "instantiationToken")
    ET.SubElement(
        root, "CoSimulation",
        modelIdentifier=IDENTIFIER, canHandleVariableCommunicationStepSize="true", canGetAndSetFMUState="true",
        canSerializeFMUState="true",
    )  # fmt: skip
    _units(root, variables)
    categories = ET.SubElement(root, "LogCategories")
    ET.SubElement(categories, "Category", name="error")
    _experiment(root, what)
    listed = ET.SubElement(root, "ModelVariables")
    ET.SubElement(
        listed, "Float64",
        name="time", valueReference=str(len(variables) + 1), causality="independent", variability="continuous",
        description="simulation time [s]",
    )  # fmt: skip
    for reference, variable in enumerate(variables):
        attributes = {"name": variable.name, "valueReference": str(reference), "description": variable.description}
        attributes |= _roles(variable) | {"unit": unit_of(variable)}
        if variable.causality != "output":
            attributes["start"] = repr(variable.start)
        ET.SubElement(listed, "Float64", attributes)
    ET.SubElement(
        listed, "Boolean",
        name="reset", valueReference=str(len(variables)), causality="input", variability="discrete", start="false",
        description=_RESET,
    )  # fmt: skip
    structure = ET.SubElement(root, "ModelStructure")
    for kind in ("Output", "InitialUnknown"):
        for reference, variable in enumerate(variables):
            if variable.causality == "output":
                ET.SubElement(structure, kind, valueReference=str(reference))
    return root


_RESET = "true: the next row is the first row, and energy counts from zero"


def _roles(variable: Variable) -> dict[str, str]:
    if variable.causality == "parameter":
        return {"causality": "parameter", "variability": "tunable"}
    if variable.causality == "output":
        return {"causality": "output", "variability": "continuous", "initial": "calculated"}
    return {"causality": "input", "variability": "continuous"}


def build_description(sources: Sequence[str]) -> bytes:
    """buildDescription.xml of FMI 3.0 (section 2.5): how an importer compiles the sources itself."""
    root = ET.Element("fmiBuildDescription", fmiVersion="3.0")
    configuration = ET.SubElement(root, "BuildConfiguration", modelIdentifier=IDENTIFIER)
    files = ET.SubElement(configuration, "SourceFileSet", language="C99")
    for name in sources:
        ET.SubElement(files, "SourceFile", name=name)
    ET.SubElement(configuration, "Library", name="m")
    ET.indent(root)
    return bytes(ET.tostring(root, encoding="utf-8", xml_declaration=True))
