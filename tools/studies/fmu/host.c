/* A minimal FMI 2.0 master, for step times without the overhead of a simulator and for runs under valgrind.

   host LIBRARY GUID RESOURCES FIRST_INPUT INPUTS SIGNALS OUTPUT STEPS

   Prints the median and the 99th percentile of the time of setReal, doStep and getReal in microseconds. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "fmi2_abi.h"

static void say(fmi2ComponentEnvironment e, fmi2String name, fmi2Status status, fmi2String kind, fmi2String text, ...)
{
    (void)e, (void)status, (void)kind;
    va_list rest;
    va_start(rest, text);
    fprintf(stderr, "%s: ", name ? name : "");
    vfprintf(stderr, text, rest);
    fputc('\n', stderr);
    va_end(rest);
}

static int compare(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return 1e6 * (double)t.tv_sec + 1e-3 * (double)t.tv_nsec;
}

#define LOAD(name, result, ...) result (*name)(__VA_ARGS__) = (result (*)(__VA_ARGS__))dlsym(library, #name)
#define MUST(call) do { if ((call) > fmi2Warning) { fprintf(stderr, "failed: " #call "\n"); return 1; } } while (0)

int main(int argc, char **argv)
{
    if (argc != 9)
        return 2;
    void *library = dlopen(argv[1], RTLD_NOW | RTLD_GLOBAL);
    if (!library) {
        fprintf(stderr, "%s\n", dlerror());
        return 1;
    }
    LOAD(fmi2Instantiate, fmi2Component, fmi2String, fmi2Type, fmi2String, fmi2String, const fmi2CallbackFunctions *,
         fmi2Boolean, fmi2Boolean);
    LOAD(fmi2SetupExperiment, fmi2Status, fmi2Component, fmi2Boolean, fmi2Real, fmi2Real, fmi2Boolean, fmi2Real);
    LOAD(fmi2EnterInitializationMode, fmi2Status, fmi2Component);
    LOAD(fmi2ExitInitializationMode, fmi2Status, fmi2Component);
    LOAD(fmi2SetReal, fmi2Status, fmi2Component, const fmi2ValueReference[], size_t, const fmi2Real[]);
    LOAD(fmi2GetReal, fmi2Status, fmi2Component, const fmi2ValueReference[], size_t, fmi2Real[]);
    LOAD(fmi2DoStep, fmi2Status, fmi2Component, fmi2Real, fmi2Real, fmi2Boolean);
    LOAD(fmi2GetFMUstate, fmi2Status, fmi2Component, fmi2FMUstate *);
    LOAD(fmi2SetFMUstate, fmi2Status, fmi2Component, fmi2FMUstate);
    LOAD(fmi2FreeFMUstate, fmi2Status, fmi2Component, fmi2FMUstate *);
    LOAD(fmi2Terminate, fmi2Status, fmi2Component);
    LOAD(fmi2FreeInstance, void, fmi2Component);
    const int first = atoi(argv[4]), inputs = atoi(argv[5]), signals = atoi(argv[6]), steps = atoi(argv[8]);
    const fmi2ValueReference output = (fmi2ValueReference)atoi(argv[7]);
    const fmi2CallbackFunctions call = {say, calloc, free, NULL, NULL};
    fmi2Component unit = fmi2Instantiate("host", fmi2CoSimulation, argv[2], argv[3], &call, 0, 0);
    if (!unit)
        return 1;
    fmi2ValueReference reference[64];
    double value[64], power = 0, sum = 0, *taken = malloc((size_t)steps * sizeof *taken);
    for (int k = 0; k < inputs + signals; k++)
        reference[k] = (fmi2ValueReference)(first + k);
    MUST(fmi2SetupExperiment(unit, 0, 0, 0, 0, 0));
    MUST(fmi2EnterInitializationMode(unit));
    MUST(fmi2ExitInitializationMode(unit));
    for (int step = 0; step < steps; step++) {
        for (int k = 0; k < inputs + signals; k++)
            value[k] = k < inputs ? 0.6 * sin(0.02 * step + k) : 1.0;
        const double started = now();
        MUST(fmi2SetReal(unit, reference, (size_t)(inputs + signals), value));
        MUST(fmi2DoStep(unit, 0.04 * step, 0.04, 1));
        MUST(fmi2GetReal(unit, &output, 1, &power));
        taken[step] = now() - started;
        sum += power;
        if (step == steps / 2 && fmi2GetFMUstate) { /* saving and restoring the state must change nothing */
            fmi2FMUstate kept = NULL;
            if (fmi2GetFMUstate(unit, &kept) == fmi2OK) {
                MUST(fmi2SetFMUstate(unit, kept));
                MUST(fmi2FreeFMUstate(unit, &kept));
            }
        }
    }
    MUST(fmi2Terminate(unit));
    fmi2FreeInstance(unit);
    qsort(taken, (size_t)steps, sizeof *taken, compare);
    printf("{\"median_us\": %.3f, \"p99_us\": %.3f, \"mean_W\": %.9g}\n", taken[steps / 2], taken[steps * 99 / 100],
           sum / steps);
    fflush(stdout); /* before dlclose, in which a library may crash */
    free(taken);
    dlclose(library);
    return 0;
}
