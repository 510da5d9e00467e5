"""An exported FMU and another one in a loop, as an SSP system: the arm draws power through a cable."""

import ctypes
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest

from acqd.compiling import system_compiler
from acqd.fmu.package import export_fmu
from acqd.models.augmented import Term
from acqd.models.bundle.bundle import save_bundle
from acqd.models.bundle.restore import open_model
from tests.builders import AXES, STEP, grey_bundle
from tests.fmu.cable import SOURCE_V, volts_by_hand, write_cable
from tests.fmu.importer import recording

simulation = pytest.importorskip("fmpy.ssp.simulation")
ROWS = 200
INPUTS = [*(f"q{k + 1}" for k in range(AXES)), "brake"]
NAMESPACES = (
    'xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription" '
    'xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon"'
)


def connectors(**kinds):
    made = (f'<ssd:Connector name="{name}" kind="{kind}"><ssc:Real/></ssd:Connector>' for name, kind in kinds.items())
    return f"<ssd:Connectors>{''.join(made)}</ssd:Connectors>"


def component(name, **kinds):
    head = f'<ssd:Component name="{name}" type="application/x-fmu-sharedlibrary" source="resources/{name}.fmu">'
    return f"{head}{connectors(**kinds)}</ssd:Component>"


def connection(start, start_connector, end, end_connector):
    begin = f'startElement="{start}" ' if start else ""
    return (
        f'<ssd:Connection {begin}startConnector="{start_connector}" endElement="{end}" endConnector="{end_connector}"/>'
    )


@pytest.fixture(scope="module")
def parts(tmp_path_factory):
    """A grey box whose power follows the voltage, and the folder with its FMU and the cable's."""
    folder = tmp_path_factory.mktemp("system")
    bundle = grey_bundle()
    exponent = {"exponent": {"value": 1.5, "unit": "-", "ci95": None}}
    term = Term("line_voltage", "all loads", {"nominal_V": SOURCE_V}, (0,), np.array([1.5]), exponent)
    bundle.metadata["effects"] = [term.as_json()]
    save_bundle(folder / "bundle", bundle)
    export_fmu(folder / "bundle", folder / "arm.fmu", "2.0", ["linux64"], lambda _: None)
    write_cable(system_compiler(), folder)
    return open_model(folder / "bundle")[1], folder


def system(folder, *, outside):
    """The file of the system; `outside`: angles and brakes are inputs of the whole system."""
    inputs = dict.fromkeys(INPUTS, "input")
    joints = "".join(connection("", name, "arm", name) for name in INPUTS) if outside else ""
    text = (
        f'<ssd:SystemStructureDescription {NAMESPACES} version="1.0" name="cell"><ssd:System name="cell">'
        f"{connectors(**inputs) if outside else ''}<ssd:Elements>"
        f"{component('arm', **inputs, Vrms='input', power='output')}"
        f"{component('cable', power='input', volts='output')}</ssd:Elements><ssd:Connections>"
        f"{joints}{connection('arm', 'power', 'cable', 'power')}{connection('cable', 'volts', 'arm', 'Vrms')}"
        "</ssd:Connections></ssd:System></ssd:SystemStructureDescription>"
    )
    path = folder / f"cell-{outside}.ssp"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("SystemStructure.ssd", text)
        for name in ("arm", "cable"):
            archive.write(folder / f"{name}.fmu", f"resources/{name}.fmu")
    return str(path)


def by_hand(model, inputs, before, first_W, first_V):
    """Power of the arm and voltage of the cable [T] after every step, by the bundle in Python.

    Every step takes what the other one returned after the step before: `first_W` and `first_V` in the first step. The
    FMU returns W `before` until a row is complete. Since a row depends on earlier powers only, repeated substitution
    ends at the one solution.
    """
    rows, after = len(inputs), np.full(len(inputs), SOURCE_V)
    columns = {"brake": inputs[:, AXES]}
    for _ in range(rows):
        columns["Vrms"] = np.array([first_V, *after[:-1]])
        power = model.sequence(inputs[:, :AXES], np.column_stack([columns[name] for name in model.signals]))
        output = np.concatenate([before, power[: rows - model.radius]])
        again = np.array(volts_by_hand([first_W, *output[:-1]], STEP))
        if np.array_equal(again, after):
            return output, after
        after = again
    raise AssertionError("the substitution does not end")


def motion():
    """Angles and brake, row by row."""
    q, signals = recording(ROWS)
    return np.column_stack([q, signals["brake"]])


def test_fmpy_couples_an_exported_fmu_with_a_cable_as_the_bundle_does_by_hand(parts):
    model, folder = parts
    table = motion()
    row = {name: lambda t, k=k: table[round(t / STEP), k] for k, name in enumerate(INPUTS)}
    result = simulation.simulate_ssp(
        system(folder, outside=True), stop_time=(ROWS - 0.5) * STEP, step_size=STEP, input=row
    )
    # fmpy hands values on after a step, and all values start at 0: those from outside come one step late
    late = np.vstack([np.zeros(len(INPUTS)), table[:-1]])
    power, volts = by_hand(model, late, result["arm.power"][: model.radius], 0.0, 0.0)
    np.testing.assert_allclose(result["arm.power"], power, rtol=0, atol=1e-6)
    np.testing.assert_allclose(result["cable.volts"], volts, rtol=0, atol=1e-9)
    columns = {"brake": late[:, AXES], "Vrms": np.full(ROWS, SOURCE_V)}
    alone = model.sequence(late[:, :AXES], np.column_stack([columns[name] for name in model.signals]))
    assert np.abs(power[model.radius :] - alone[: -model.radius])[5:].max() > 0.1  # the cable matters


def test_ecos_couples_them_too(parts):
    for library in (Path(sys.prefix) / "lib").glob("libtbb.so.12"):  # from the wheel of tbb
        ctypes.CDLL(str(library), mode=ctypes.RTLD_GLOBAL)
    ecospy = pytest.importorskip("ecospy", reason="needs acqd[fmu-check]", exc_type=(ImportError, OSError))
    model, folder = parts
    table, found = motion(), []
    with ecospy.EcosSimulation(ssp_path=system(folder, outside=False), step_size=STEP) as running:
        running.init()
        first_W = running.get_real("arm::power")
        for line in table.tolist():
            for name, value in zip(INPUTS, line, strict=True):
                running.set_real(f"arm::{name}", value)
            running.step()
            found.append((running.get_real("arm::power"), running.get_real("cable::volts")))
        running.terminate()
    powers, after = np.array(found).T
    power, volts = by_hand(model, table, powers[: model.radius], first_W, SOURCE_V)
    np.testing.assert_allclose(powers, power, rtol=0, atol=1e-6)
    np.testing.assert_allclose(after, volts, rtol=0, atol=1e-9)
