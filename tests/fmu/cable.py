"""A second FMU, written independently of acqd: a supply cable whose resistance rises as its conductor warms up.

V = V_source - R P / (3 V_source); R = R20 (1 + 0.0039 T); C dT/dt = 3 R I^2 - T / R_thermal, explicit Euler.
"""

import subprocess
import zipfile

SOURCE_V, R20, CAPACITY, THERMAL = 230.0, 0.8, 40.0, 2.0
IDENTIFIER = "cable"
C = """
#include <stdlib.h>
typedef struct { double power, volts, kelvin; } cable;
typedef unsigned int reference;
enum { SOURCE_V = 230 };
static void load(cable *c) { c->volts = SOURCE_V - 0.8 * (1 + 0.0039 * c->kelvin) * c->power / (3.0 * SOURCE_V); }
const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }
void *fmi2Instantiate(const char *n, int t, const char *g, const char *r, const void *f, int v, int l)
{
    cable *c = calloc(1, sizeof *c);
    if (c) c->volts = SOURCE_V;
    return c;
}
void fmi2FreeInstance(void *c) { free(c); }
int fmi2SetupExperiment(void *c, int d, double t, double s, int e, double f) { return 0; }
int fmi2EnterInitializationMode(void *c) { return 0; }
int fmi2ExitInitializationMode(void *c) { return 0; }
int fmi2SetReal(void *c, const reference r[], size_t n, const double x[])
{
    for (size_t k = 0; k < n; k++) if (r[k] == 0) ((cable *)c)->power = x[k];
    return 0;
}
int fmi2GetReal(void *c, const reference r[], size_t n, double x[])
{
    const double *values = c;
    for (size_t k = 0; k < n; k++) x[k] = values[r[k]];
    return 0;
}
int fmi2DoStep(void *p, double t, double h, int set)
{
    cable *c = p;
    const double amperes = c->power / (3.0 * SOURCE_V);
    load(c);
    c->kelvin += h / 40.0 * (3 * 0.8 * (1 + 0.0039 * c->kelvin) * amperes * amperes - c->kelvin / 2.0);
    return 0;
}
#define NOT(name) int name(void) { return 3; }
int fmi2SetDebugLogging(void *c, int l, size_t n, const char *const s[]) { return 0; }
int fmi2Terminate(void *c) { return 0; }
int fmi2Reset(void *c) { return 0; }
NOT(fmi2GetInteger) NOT(fmi2GetBoolean) NOT(fmi2GetString) NOT(fmi2SetInteger) NOT(fmi2SetBoolean) NOT(fmi2SetString)
NOT(fmi2GetFMUstate) NOT(fmi2SetFMUstate) NOT(fmi2FreeFMUstate) NOT(fmi2SerializedFMUstateSize)
NOT(fmi2SerializeFMUstate) NOT(fmi2DeSerializeFMUstate) NOT(fmi2GetDirectionalDerivative)
NOT(fmi2SetRealInputDerivatives) NOT(fmi2GetRealOutputDerivatives) NOT(fmi2CancelStep)
NOT(fmi2GetStatus) NOT(fmi2GetRealStatus) NOT(fmi2GetIntegerStatus) NOT(fmi2GetBooleanStatus) NOT(fmi2GetStringStatus)
"""
DESCRIPTION = f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="{IDENTIFIER}" guid="{{cable-1}}" numberOfEventIndicators="0">
  <CoSimulation modelIdentifier="{IDENTIFIER}" canHandleVariableCommunicationStepSize="true"/>
  <ModelVariables>
    <ScalarVariable name="power" valueReference="0" causality="input" variability="continuous">
      <Real start="0"/></ScalarVariable>
    <ScalarVariable name="volts" valueReference="1" causality="output" variability="continuous" initial="exact">
      <Real start="230"/></ScalarVariable>
    <ScalarVariable name="kelvin" valueReference="2" causality="output" variability="continuous" initial="exact">
      <Real start="0"/></ScalarVariable>
  </ModelVariables>
  <ModelStructure><Outputs><Unknown index="2"/><Unknown index="3"/></Outputs></ModelStructure>
</fmiModelDescription>
"""


def write_cable(compiler, folder):
    """The file cable.fmu in `folder`."""
    (folder / "cable.c").write_text(C)
    library = folder / "cable.so"
    subprocess.run([compiler, "-O1", "-fPIC", "-shared", "-o", library, folder / "cable.c"], check=True)
    with zipfile.ZipFile(folder / "cable.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", DESCRIPTION)
        archive.write(library, f"binaries/linux64/{IDENTIFIER}.so")
    return folder / "cable.fmu"


def volts_by_hand(power, step_s):
    """Voltage [T] V after each step, of power [T] W at its start."""
    kelvin, volts = 0.0, []
    for each in power:
        resistance, amperes = R20 * (1 + 0.0039 * kelvin), each / (3 * SOURCE_V)
        volts.append(SOURCE_V - resistance * amperes)
        kelvin += step_s / CAPACITY * (3 * resistance * amperes**2 - kelvin / THERMAL)
    return volts
