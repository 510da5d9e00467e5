/* FMI 3.0 for co-simulation. */
#include "fmi3_abi.h"
#include "instance.h"

#include <stdlib.h>
#include <string.h>

#define RESET_REFERENCE VARIABLES
#define TIME_REFERENCE (VARIABLES + 1)

typedef struct {
    state_t state;
    int has_stop;
    double stop;
    fmi3LogMessageCallback log;
    fmi3InstanceEnvironment environment;
} unit_t;

static fmi3Status complain(const unit_t *unit, const char *what)
{
    if (unit->log)
        unit->log(unit->environment, fmi3Error, "error", what);
    return fmi3Error;
}

FMI3_EXPORT const char *fmi3GetVersion(void) { return "3.0"; }

FMI3_EXPORT fmi3Status fmi3SetDebugLogging(fmi3Instance c, fmi3Boolean on, size_t n, const fmi3String categories[])
{
    (void)c, (void)on, (void)n, (void)categories;
    return fmi3OK;
}

FMI3_EXPORT fmi3Instance fmi3InstantiateCoSimulation(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible, fmi3Boolean logging,
    fmi3Boolean event_mode, fmi3Boolean early_return, const fmi3ValueReference required[], size_t n,
    fmi3InstanceEnvironment environment, fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update)
{
    (void)resources, (void)visible, (void)logging, (void)early_return, (void)required, (void)update;
    const char *refused = !token || strcmp(token, MODEL_TOKEN) != 0 ? "token: the model description is of another FMU"
                          : !name || !name[0] ? "an instance needs a name"
                          : event_mode ? "there is no event mode"
                          : n ? "there is no intermediate update" : NULL;
    unit_t *unit = refused ? NULL : calloc(1, sizeof *unit);
    if (!unit) {
        if (log)
            log(environment, fmi3Error, "error", refused ? refused : "no memory");
        return NULL;
    }
    unit->log = log, unit->environment = environment;
    state_begin(&unit->state);
    return unit;
}

FMI3_EXPORT fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources,
                                                      fmi3Boolean visible, fmi3Boolean logging,
                                                      fmi3InstanceEnvironment environment, fmi3LogMessageCallback log)
{
    (void)name, (void)token, (void)resources, (void)visible, (void)logging;
    if (log)
        log(environment, fmi3Error, "error", "this FMU is for co-simulation only");
    return NULL;
}

FMI3_EXPORT fmi3Instance fmi3InstantiateScheduledExecution(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible, fmi3Boolean logging,
    fmi3InstanceEnvironment environment, fmi3LogMessageCallback log, void (*clock)(fmi3InstanceEnvironment),
    void (*lock)(void), void (*unlock)(void))
{
    (void)clock, (void)lock, (void)unlock;
    return fmi3InstantiateModelExchange(name, token, resources, visible, logging, environment, log);
}

FMI3_EXPORT void fmi3FreeInstance(fmi3Instance c) { free(c); }

FMI3_EXPORT fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean has_tolerance, fmi3Float64 tolerance,
                                                   fmi3Float64 start, fmi3Boolean has_stop, fmi3Float64 stop)
{
    unit_t *unit = c;
    (void)has_tolerance, (void)tolerance;
    if (unit->state.phase != INSTANTIATED)
        return complain(unit, "fmi3EnterInitializationMode: only once");
    if (has_stop && stop < start)
        return complain(unit, "fmi3EnterInitializationMode: stops before it starts");
    unit->state.start = unit->state.time = start;
    unit->has_stop = has_stop, unit->stop = stop;
    unit->state.phase = INITIALIZING;
    return fmi3OK;
}

FMI3_EXPORT fmi3Status fmi3ExitInitializationMode(fmi3Instance c)
{
    unit_t *unit = c;
    if (unit->state.phase != INITIALIZING)
        return complain(unit, "fmi3ExitInitializationMode: not in initialization mode");
    state_start(&unit->state);
    unit->state.phase = STEPPING;
    return fmi3OK;
}

FMI3_EXPORT fmi3Status fmi3Terminate(fmi3Instance c)
{
    unit_t *unit = c;
    if (unit->state.phase != STEPPING)
        return complain(unit, "fmi3Terminate: only while stepping");
    unit->state.phase = TERMINATED;
    return fmi3OK;
}

FMI3_EXPORT fmi3Status fmi3Reset(fmi3Instance c)
{
    unit_t *unit = c;
    state_begin(&unit->state);
    unit->state.phase = INSTANTIATED;
    unit->has_stop = 0;
    return fmi3OK;
}

FMI3_EXPORT fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Float64 value[],
                                      size_t values)
{
    unit_t *unit = c;
    if (n != values)
        return complain(unit, "fmi3GetFloat64: all variables are scalar");
    if (unit->state.phase == INITIALIZING)
        state_preview(&unit->state);
    for (size_t k = 0; k < n; k++) {
        if (vr[k] >= VARIABLES && vr[k] != TIME_REFERENCE)
            return complain(unit, "fmi3GetFloat64: no such variable");
        value[k] = vr[k] == TIME_REFERENCE ? unit->state.time : unit->state.value[vr[k]];
    }
    return fmi3OK;
}

FMI3_EXPORT fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t n,
                                      const fmi3Float64 value[], size_t values)
{
    unit_t *unit = c;
    if (n != values)
        return complain(unit, "fmi3SetFloat64: all variables are scalar");
    for (size_t k = 0; k < n; k++) {
        if (vr[k] >= VARIABLES || vr[k] == POWER || vr[k] == ENERGY)
            return complain(unit, "fmi3SetFloat64: neither an input nor a parameter");
        if (unit->state.phase == TERMINATED || value[k] != value[k] || value[k] - value[k] != 0.0)
            return complain(unit, "fmi3SetFloat64: not a finite number, or after termination");
    }
    for (size_t k = 0; k < n; k++)
        unit->state.value[vr[k]] = value[k];
    return fmi3OK;
}

FMI3_EXPORT fmi3Status fmi3GetBoolean(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Boolean value[],
                                      size_t values)
{
    const unit_t *unit = c;
    for (size_t k = 0; k < n; k++) {
        if (vr[k] != RESET_REFERENCE || n != values)
            return complain(unit, "fmi3GetBoolean: no such variable");
        value[k] = unit->state.reset != 0.0;
    }
    return fmi3OK;
}

FMI3_EXPORT fmi3Status fmi3SetBoolean(fmi3Instance c, const fmi3ValueReference vr[], size_t n,
                                      const fmi3Boolean value[], size_t values)
{
    unit_t *unit = c;
    for (size_t k = 0; k < n; k++) {
        if (vr[k] != RESET_REFERENCE || n != values || unit->state.phase == TERMINATED)
            return complain(unit, "fmi3SetBoolean: no such input, or after termination");
        unit->state.reset = value[k] ? 1.0 : 0.0;
    }
    return fmi3OK;
}

FMI3_EXPORT fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 time, fmi3Float64 step, fmi3Boolean no_set_before,
                                  fmi3Boolean *event, fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *last)
{
    unit_t *unit = c;
    (void)no_set_before;
    if (unit->state.phase != STEPPING)
        return complain(unit, "fmi3DoStep: not initialized, or terminated");
    if (!(step > 0.0) || !(time - unit->state.time < 1e-5 && unit->state.time - time < 1e-5))
        return complain(unit, "fmi3DoStep: a step must start where the last one ended, and go forward");
    if (!(step < LONGEST_STEP))
        return complain(unit, "fmi3DoStep: no step that has an end");
    if (unit->has_stop && time + step > unit->stop + 1e-6)
        return complain(unit, "fmi3DoStep: beyond the stop time");
    state_step(&unit->state, time, step);
    *event = *terminate = *early = false;
    *last = time + step;
    return fmi3OK;
}

FMI3_EXPORT fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState *kept)
{
    const unit_t *unit = c;
    return state_keep(&unit->state, kept) ? fmi3OK : complain(unit, "fmi3GetFMUState: no memory");
}

FMI3_EXPORT fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState kept)
{
    unit_t *unit = c;
    if (!kept)
        return complain(unit, "fmi3SetFMUState: no state");
    unit->state = *(const state_t *)kept;
    return fmi3OK;
}

FMI3_EXPORT fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState *kept)
{
    (void)c;
    if (kept) {
        free(*kept);
        *kept = NULL;
    }
    return fmi3OK;
}

FMI3_EXPORT fmi3Status fmi3SerializedFMUStateSize(fmi3Instance c, fmi3FMUState kept, size_t *size)
{
    (void)c, (void)kept;
    *size = state_bytes();
    return fmi3OK;
}

FMI3_EXPORT fmi3Status fmi3SerializeFMUState(fmi3Instance c, fmi3FMUState kept, fmi3Byte bytes[], size_t size)
{
    if (!kept || size < state_bytes())
        return complain(c, "fmi3SerializeFMUState: no state, or too little room");
    state_write(kept, bytes);
    return fmi3OK;
}

FMI3_EXPORT fmi3Status fmi3DeserializeFMUState(fmi3Instance c, const fmi3Byte bytes[], size_t size, fmi3FMUState *kept)
{
    void *copy = state_read(bytes, size);
    if (!copy)
        return complain(c, "fmi3DeserializeFMUState: the bytes are damaged, or of another model");
    *kept = copy;
    return fmi3OK;
}

/* What this FMU has no variables or modes for. */
#define TYPED(name, type)                                                                                              \
    FMI3_EXPORT fmi3Status fmi3Get##name(fmi3Instance c, const fmi3ValueReference vr[], size_t n, type value[],        \
                                         size_t values)                                                                \
    {                                                                                                                  \
        (void)vr, (void)value, (void)values;                                                                           \
        return n ? complain(c, "fmi3Get" #name ": there are no variables of this type") : fmi3OK;                      \
    }                                                                                                                  \
    FMI3_EXPORT fmi3Status fmi3Set##name(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const type value[],  \
                                         size_t values)                                                                \
    {                                                                                                                  \
        (void)vr, (void)value, (void)values;                                                                           \
        return n ? complain(c, "fmi3Set" #name ": there are no variables of this type") : fmi3OK;                      \
    }
TYPED(Float32, fmi3Float32)
TYPED(Int8, fmi3Int8)
TYPED(UInt8, fmi3UInt8)
TYPED(Int16, fmi3Int16)
TYPED(UInt16, fmi3UInt16)
TYPED(Int32, fmi3Int32)
TYPED(UInt32, fmi3UInt32)
TYPED(Int64, fmi3Int64)
TYPED(UInt64, fmi3UInt64)
TYPED(String, fmi3String)

#define ABSENT(name, arguments)                                                                                        \
    FMI3_EXPORT fmi3Status name arguments { return complain(c, #name ": not provided"); }
#if defined __GNUC__
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif
ABSENT(fmi3GetBinary, (fmi3Instance c, const fmi3ValueReference a[], size_t n, size_t s[], fmi3Binary v[], size_t m))
ABSENT(fmi3SetBinary,
       (fmi3Instance c, const fmi3ValueReference a[], size_t n, const size_t s[], const fmi3Binary v[], size_t m))
ABSENT(fmi3GetClock, (fmi3Instance c, const fmi3ValueReference a[], size_t n, fmi3Clock v[]))
ABSENT(fmi3SetClock, (fmi3Instance c, const fmi3ValueReference a[], size_t n, const fmi3Clock v[]))
ABSENT(fmi3EnterEventMode, (fmi3Instance c))
ABSENT(fmi3EnterStepMode, (fmi3Instance c))
ABSENT(fmi3EnterConfigurationMode, (fmi3Instance c))
ABSENT(fmi3ExitConfigurationMode, (fmi3Instance c))
ABSENT(fmi3EnterContinuousTimeMode, (fmi3Instance c))
ABSENT(fmi3GetNumberOfVariableDependencies, (fmi3Instance c, fmi3ValueReference v, size_t *n))
ABSENT(fmi3GetVariableDependencies, (fmi3Instance c, fmi3ValueReference d, size_t e[], fmi3ValueReference i[],
                                     size_t f[], fmi3DependencyKind k[], size_t n))
ABSENT(fmi3GetDirectionalDerivative,
       (fmi3Instance c, const fmi3ValueReference u[], size_t nu, const fmi3ValueReference k[], size_t nk,
        const fmi3Float64 s[], size_t ns, fmi3Float64 o[], size_t no))
ABSENT(fmi3GetAdjointDerivative,
       (fmi3Instance c, const fmi3ValueReference u[], size_t nu, const fmi3ValueReference k[], size_t nk,
        const fmi3Float64 s[], size_t ns, fmi3Float64 o[], size_t no))
ABSENT(fmi3GetOutputDerivatives,
       (fmi3Instance c, const fmi3ValueReference v[], size_t n, const fmi3Int32 o[], fmi3Float64 d[], size_t m))
ABSENT(fmi3GetIntervalDecimal,
       (fmi3Instance c, const fmi3ValueReference v[], size_t n, fmi3Float64 i[], fmi3IntervalQualifier q[]))
ABSENT(fmi3GetIntervalFraction, (fmi3Instance c, const fmi3ValueReference v[], size_t n, fmi3UInt64 a[],
                                 fmi3UInt64 b[], fmi3IntervalQualifier q[]))
ABSENT(fmi3GetShiftDecimal, (fmi3Instance c, const fmi3ValueReference v[], size_t n, fmi3Float64 s[]))
ABSENT(fmi3GetShiftFraction, (fmi3Instance c, const fmi3ValueReference v[], size_t n, fmi3UInt64 a[], fmi3UInt64 b[]))
ABSENT(fmi3SetIntervalDecimal, (fmi3Instance c, const fmi3ValueReference v[], size_t n, const fmi3Float64 i[]))
ABSENT(fmi3SetIntervalFraction,
       (fmi3Instance c, const fmi3ValueReference v[], size_t n, const fmi3UInt64 a[], const fmi3UInt64 b[]))
ABSENT(fmi3SetShiftDecimal, (fmi3Instance c, const fmi3ValueReference v[], size_t n, const fmi3Float64 s[]))
ABSENT(fmi3SetShiftFraction,
       (fmi3Instance c, const fmi3ValueReference v[], size_t n, const fmi3UInt64 a[], const fmi3UInt64 b[]))
ABSENT(fmi3EvaluateDiscreteStates, (fmi3Instance c))
ABSENT(fmi3UpdateDiscreteStates, (fmi3Instance c, fmi3Boolean *a, fmi3Boolean *b, fmi3Boolean *d, fmi3Boolean *e,
                                  fmi3Boolean *f, fmi3Float64 *t))
ABSENT(fmi3CompletedIntegratorStep, (fmi3Instance c, fmi3Boolean a, fmi3Boolean *b, fmi3Boolean *d))
ABSENT(fmi3SetTime, (fmi3Instance c, fmi3Float64 t))
ABSENT(fmi3SetContinuousStates, (fmi3Instance c, const fmi3Float64 s[], size_t n))
ABSENT(fmi3GetContinuousStateDerivatives, (fmi3Instance c, fmi3Float64 s[], size_t n))
ABSENT(fmi3GetEventIndicators, (fmi3Instance c, fmi3Float64 s[], size_t n))
ABSENT(fmi3GetContinuousStates, (fmi3Instance c, fmi3Float64 s[], size_t n))
ABSENT(fmi3GetNominalsOfContinuousStates, (fmi3Instance c, fmi3Float64 s[], size_t n))
ABSENT(fmi3GetNumberOfEventIndicators, (fmi3Instance c, size_t *n))
ABSENT(fmi3GetNumberOfContinuousStates, (fmi3Instance c, size_t *n))
ABSENT(fmi3ActivateModelPartition, (fmi3Instance c, fmi3ValueReference v, fmi3Float64 t))
