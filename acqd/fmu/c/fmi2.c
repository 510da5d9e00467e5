/* FMI 2.0 for co-simulation. */
#include "fmi2_abi.h"
#include "instance.h"

#include <stdlib.h>
#include <string.h>

#define RESET_REFERENCE VARIABLES

typedef struct {
    state_t state;
    int has_stop;
    double stop;
    fmi2CallbackFunctions call;
    char *name;
} slave_t;

static fmi2Status complain(const slave_t *slave, const char *what)
{
    if (slave->call.logger)
        slave->call.logger(slave->call.componentEnvironment, slave->name, fmi2Error, "error", "%s", what);
    return fmi2Error;
}

FMI2_EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
FMI2_EXPORT const char *fmi2GetVersion(void) { return "2.0"; }

FMI2_EXPORT fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[])
{
    (void)c, (void)on, (void)n, (void)categories;
    return fmi2OK;
}

FMI2_EXPORT fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                                          const fmi2CallbackFunctions *call, fmi2Boolean visible, fmi2Boolean logging)
{
    (void)resources, (void)visible, (void)logging;
    const char *refused = type != fmi2CoSimulation ? "this FMU is for co-simulation only"
                          : !guid || strcmp(guid, MODEL_TOKEN) != 0 ? "guid: the model description is of another FMU"
                          : !name || !name[0] ? "an instance needs a name" : NULL;
    slave_t *slave = refused ? NULL : calloc(1, sizeof *slave);
    if (!slave) {
        if (call && call->logger)
            call->logger(call->componentEnvironment, name, fmi2Error, "error", "%s", refused ? refused : "no memory");
        return NULL;
    }
    if (call)
        slave->call = *call;
    slave->name = malloc(strlen(name) + 1);
    if (!slave->name) {
        free(slave);
        return NULL;
    }
    strcpy(slave->name, name);
    state_begin(&slave->state);
    return slave;
}

FMI2_EXPORT void fmi2FreeInstance(fmi2Component c)
{
    slave_t *slave = c;
    if (slave)
        free(slave->name);
    free(slave);
}

FMI2_EXPORT fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean has_tolerance, fmi2Real tolerance,
                                           fmi2Real start, fmi2Boolean has_stop, fmi2Real stop)
{
    slave_t *slave = c;
    (void)has_tolerance, (void)tolerance;
    if (slave->state.phase != INSTANTIATED)
        return complain(slave, "fmi2SetupExperiment: only before initialization");
    if (has_stop && stop < start)
        return complain(slave, "fmi2SetupExperiment: stops before it starts");
    slave->state.start = slave->state.time = start;
    slave->has_stop = has_stop, slave->stop = stop;
    return fmi2OK;
}

FMI2_EXPORT fmi2Status fmi2EnterInitializationMode(fmi2Component c)
{
    slave_t *slave = c;
    if (slave->state.phase != INSTANTIATED)
        return complain(slave, "fmi2EnterInitializationMode: only once");
    slave->state.phase = INITIALIZING;
    return fmi2OK;
}

FMI2_EXPORT fmi2Status fmi2ExitInitializationMode(fmi2Component c)
{
    slave_t *slave = c;
    if (slave->state.phase != INITIALIZING)
        return complain(slave, "fmi2ExitInitializationMode: not in initialization mode");
    state_start(&slave->state);
    slave->state.phase = STEPPING;
    return fmi2OK;
}

FMI2_EXPORT fmi2Status fmi2Terminate(fmi2Component c)
{
    slave_t *slave = c;
    if (slave->state.phase != STEPPING)
        return complain(slave, "fmi2Terminate: only while stepping");
    slave->state.phase = TERMINATED;
    return fmi2OK;
}

FMI2_EXPORT fmi2Status fmi2Reset(fmi2Component c)
{
    slave_t *slave = c;
    state_begin(&slave->state);
    slave->state.phase = INSTANTIATED;
    slave->has_stop = 0;
    return fmi2OK;
}

FMI2_EXPORT fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real value[])
{
    slave_t *slave = c;
    if (slave->state.phase == INITIALIZING)
        state_preview(&slave->state);
    for (size_t k = 0; k < n; k++) {
        if (vr[k] >= VARIABLES)
            return complain(slave, "fmi2GetReal: no such variable");
        value[k] = slave->state.value[vr[k]];
    }
    return fmi2OK;
}

FMI2_EXPORT fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real value[])
{
    slave_t *slave = c;
    for (size_t k = 0; k < n; k++) {
        if (vr[k] >= VARIABLES || vr[k] == POWER || vr[k] == ENERGY)
            return complain(slave, "fmi2SetReal: neither an input nor a parameter");
        if (slave->state.phase == TERMINATED || value[k] != value[k] || value[k] - value[k] != 0.0)
            return complain(slave, "fmi2SetReal: not a finite number, or after termination");
    }
    for (size_t k = 0; k < n; k++)
        slave->state.value[vr[k]] = value[k];
    return fmi2OK;
}

FMI2_EXPORT fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Boolean value[])
{
    const slave_t *slave = c;
    for (size_t k = 0; k < n; k++) {
        if (vr[k] != RESET_REFERENCE)
            return complain(slave, "fmi2GetBoolean: no such variable");
        value[k] = slave->state.reset != 0.0;
    }
    return fmi2OK;
}

FMI2_EXPORT fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Boolean value[])
{
    slave_t *slave = c;
    for (size_t k = 0; k < n; k++) {
        if (vr[k] != RESET_REFERENCE || slave->state.phase == TERMINATED)
            return complain(slave, "fmi2SetBoolean: no such input, or after termination");
        slave->state.reset = value[k] != 0;
    }
    return fmi2OK;
}

#define NONE_OF(function, type)                                                                                  \
    FMI2_EXPORT fmi2Status function(fmi2Component c, const fmi2ValueReference vr[], size_t n, type value[])      \
    {                                                                                                            \
        (void)vr, (void)value;                                                                                   \
        return n ? complain(c, #function ": there are no variables of this type") : fmi2OK;                      \
    }
NONE_OF(fmi2GetInteger, fmi2Integer)
NONE_OF(fmi2SetInteger, const fmi2Integer)
NONE_OF(fmi2GetString, fmi2String)
NONE_OF(fmi2SetString, const fmi2String)

FMI2_EXPORT fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real step, fmi2Boolean no_return)
{
    slave_t *slave = c;
    (void)no_return;
    if (slave->state.phase != STEPPING)
        return complain(slave, "fmi2DoStep: not initialized, or terminated");
    if (!(step >= 0.0) || !(time - slave->state.time < 1e-5 && slave->state.time - time < 1e-5))
        return complain(slave, "fmi2DoStep: a step must start where the last one ended, and go forward");
    if (!(step < LONGEST_STEP))
        return complain(slave, "fmi2DoStep: no step that has an end");
    if (slave->has_stop && time + step > slave->stop + 1e-6)
        return complain(slave, "fmi2DoStep: beyond the stop time");
    state_step(&slave->state, time, step);
    return fmi2OK;
}

FMI2_EXPORT fmi2Status fmi2CancelStep(fmi2Component c) { return complain(c, "fmi2CancelStep: steps are synchronous"); }

FMI2_EXPORT fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *kept)
{
    const slave_t *slave = c;
    return state_keep(&slave->state, kept) ? fmi2OK : complain(slave, "fmi2GetFMUstate: no memory");
}

FMI2_EXPORT fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate kept)
{
    slave_t *slave = c;
    if (!kept)
        return complain(slave, "fmi2SetFMUstate: no state");
    slave->state = *(const state_t *)kept;
    return fmi2OK;
}

FMI2_EXPORT fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *kept)
{
    (void)c;
    if (kept) {
        free(*kept);
        *kept = NULL;
    }
    return fmi2OK;
}

FMI2_EXPORT fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate kept, size_t *size)
{
    (void)c, (void)kept;
    *size = state_bytes();
    return fmi2OK;
}

FMI2_EXPORT fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate kept, fmi2Byte bytes[], size_t size)
{
    if (!kept || size < state_bytes())
        return complain(c, "fmi2SerializeFMUstate: no state, or too little room");
    state_write(kept, (unsigned char *)bytes);
    return fmi2OK;
}

FMI2_EXPORT fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *kept)
{
    void *copy = state_read((const unsigned char *)bytes, size);
    if (!copy)
        return complain(c, "fmi2DeSerializeFMUstate: the bytes are damaged, or of another model");
    *kept = copy;
    return fmi2OK;
}

FMI2_EXPORT fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknown[], size_t nu,
                                                    const fmi2ValueReference known[], size_t nk, const fmi2Real dv[],
                                                    fmi2Real out[])
{
    (void)unknown, (void)nu, (void)known, (void)nk, (void)dv, (void)out;
    return complain(c, "fmi2GetDirectionalDerivative: not provided");
}

FMI2_EXPORT fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                                                   const fmi2Integer order[], const fmi2Real value[])
{
    (void)vr, (void)n, (void)order, (void)value;
    return complain(c, "fmi2SetRealInputDerivatives: inputs hold within a step");
}

FMI2_EXPORT fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                                                    const fmi2Integer order[], fmi2Real value[])
{
    (void)vr, (void)n, (void)order, (void)value;
    return complain(c, "fmi2GetRealOutputDerivatives: not provided");
}

FMI2_EXPORT fmi2Status fmi2GetRealStatus(fmi2Component c, fmi2StatusKind kind, fmi2Real *value)
{
    if (kind != fmi2LastSuccessfulTime)
        return fmi2Discard;
    *value = ((slave_t *)c)->state.time;
    return fmi2OK;
}

FMI2_EXPORT fmi2Status fmi2GetBooleanStatus(fmi2Component c, fmi2StatusKind kind, fmi2Boolean *value)
{
    if (kind != fmi2Terminated)
        return fmi2Discard;
    *value = ((slave_t *)c)->state.phase == TERMINATED;
    return fmi2OK;
}

FMI2_EXPORT fmi2Status fmi2GetStatus(fmi2Component c, fmi2StatusKind kind, fmi2Status *value)
{
    (void)c, (void)kind, (void)value;
    return fmi2Discard;
}

FMI2_EXPORT fmi2Status fmi2GetIntegerStatus(fmi2Component c, fmi2StatusKind kind, fmi2Integer *value)
{
    (void)c, (void)kind, (void)value;
    return fmi2Discard;
}

FMI2_EXPORT fmi2Status fmi2GetStringStatus(fmi2Component c, fmi2StatusKind kind, fmi2String *value)
{
    (void)c, (void)kind, (void)value;
    return fmi2Discard;
}
