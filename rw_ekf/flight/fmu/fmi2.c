/* The wheel behind the functions of FMI 2.0 for co-simulation. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#ifdef RW_FMI_HEADERS
#include "fmi2Functions.h"
#else
#include "fmi2_types.h"
#endif
#include "instance.h"
#include "model.h"

#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#elif defined(__GNUC__)
#define EXPORT __attribute__((visibility("default")))
#else
#define EXPORT
#endif

struct instance {
    struct rw_kept kept;
    const fmi2CallbackFunctions *functions;
    char *name;
};

static void tell(const fmi2CallbackFunctions *functions, const char *name, rw_fault fault)
{
    if (functions != NULL && functions->logger != NULL) {
        functions->logger(functions->componentEnvironment, name, fmi2Error, "logStatusError", "%s", fault);
    }
}

static fmi2Status ended(const struct instance *of, rw_fault fault)
{
    if (fault == NULL) {
        return fmi2OK;
    }
    tell(of->functions, of->name, fault);
    return fmi2Error;
}

EXPORT const char *fmi2GetTypesPlatform(void)
{
    return "default";
}

EXPORT const char *fmi2GetVersion(void)
{
    return "2.0";
}

EXPORT fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[])
{
    (void)c;
    (void)on;
    (void)n;
    (void)categories;
    return fmi2OK; /* errors are told in any case, and there is nothing else to tell */
}

EXPORT fmi2Component fmi2Instantiate(
    fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources, const fmi2CallbackFunctions *functions,
    fmi2Boolean visible, fmi2Boolean logging)
{
    struct instance *found;
    (void)resources;
    (void)visible;
    (void)logging;
    if (type != fmi2CoSimulation) {
        tell(functions, name, "this FMU is for co-simulation");
        return NULL;
    }
    if (guid == NULL || strcmp(guid, RW_TOKEN) != 0) {
        tell(functions, name, "the GUID is that of another model");
        return NULL;
    }
    found = calloc(1, sizeof *found);
    if (found == NULL) {
        return NULL;
    }
    found->functions = functions;
    found->name = calloc(1, (name == NULL ? 0 : strlen(name)) + 1);
    if (found->name == NULL) {
        free(found);
        return NULL;
    }
    if (name != NULL) {
        strcpy(found->name, name);
    }
    rw_instance_begin(&found->kept);
    return found;
}

EXPORT void fmi2FreeInstance(fmi2Component c)
{
    struct instance *of = c;
    if (of != NULL) {
        free(of->name);
        free(of);
    }
}

EXPORT fmi2Status fmi2SetupExperiment(
    fmi2Component c, fmi2Boolean has_tolerance, fmi2Real tolerance, fmi2Real start_s, fmi2Boolean has_stop,
    fmi2Real stop_s)
{
    struct instance *of = c;
    (void)has_tolerance;
    (void)tolerance;
    (void)has_stop;
    (void)stop_s;
    of->kept.start_s = start_s;
    return fmi2OK;
}

EXPORT fmi2Status fmi2EnterInitializationMode(fmi2Component c)
{
    struct instance *of = c;
    of->kept.mode = RW_INITIALIZING;
    return fmi2OK;
}

EXPORT fmi2Status fmi2ExitInitializationMode(fmi2Component c)
{
    struct instance *of = c;
    return ended(of, rw_instance_initialized(&of->kept));
}

EXPORT fmi2Status fmi2Terminate(fmi2Component c)
{
    struct instance *of = c;
    of->kept.mode = RW_ENDED;
    return fmi2OK;
}

EXPORT fmi2Status fmi2Reset(fmi2Component c)
{
    struct instance *of = c;
    rw_instance_begin(&of->kept);
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real value[])
{
    struct instance *of = c;
    rw_fault fault = NULL;
    for (size_t i = 0; i < n && fault == NULL; ++i) {
        fault = rw_instance_get(&of->kept, vr[i], &value[i]);
    }
    return ended(of, fault);
}

EXPORT fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real value[])
{
    struct instance *of = c;
    rw_fault fault = NULL;
    for (size_t i = 0; i < n && fault == NULL; ++i) {
        fault = rw_instance_set(&of->kept, vr[i], value[i]);
    }
    return ended(of, fault);
}

static fmi2Status none_of(fmi2Component c, size_t n)
{
    return ended(c, n == 0 ? NULL : "all variables of this FMU are reals");
}

#define OTHER(type)                                                                                          \
    EXPORT fmi2Status fmi2Get##type(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2##type value[]) \
    {                                                                                                        \
        (void)vr;                                                                                            \
        (void)value;                                                                                         \
        return none_of(c, n);                                                                                \
    }                                                                                                        \
    EXPORT fmi2Status fmi2Set##type(                                                                         \
        fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2##type value[])                  \
    {                                                                                                        \
        (void)vr;                                                                                            \
        (void)value;                                                                                         \
        return none_of(c, n);                                                                                \
    }

OTHER(Integer)
OTHER(Boolean)
OTHER(String)

EXPORT fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    struct instance *of = c;
    return ended(of, rw_instance_copy(&of->kept, sizeof of->kept, state));
}

EXPORT fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state)
{
    struct instance *of = c;
    memcpy(&of->kept, state, sizeof of->kept);
    return fmi2OK;
}

EXPORT fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    (void)c;
    free(*state);
    *state = NULL;
    return fmi2OK;
}

EXPORT fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size)
{
    (void)c;
    (void)state;
    *size = sizeof(struct rw_kept);
    return fmi2OK;
}

EXPORT fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size)
{
    return ended(c, rw_instance_write(state, bytes, size));
}

EXPORT fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state)
{
    return ended(c, rw_instance_copy(bytes, size, state));
}

EXPORT fmi2Status fmi2GetDirectionalDerivative(
    fmi2Component c, const fmi2ValueReference unknown[], size_t unknowns, const fmi2ValueReference known[],
    size_t knowns, const fmi2Real of_known[], fmi2Real of_unknown[])
{
    (void)unknown;
    (void)unknowns;
    (void)known;
    (void)knowns;
    (void)of_known;
    (void)of_unknown;
    return ended(c, "this FMU has no derivatives to give");
}

EXPORT fmi2Status fmi2SetRealInputDerivatives(
    fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Integer order[], const fmi2Real value[])
{
    (void)vr;
    (void)n;
    (void)order;
    (void)value;
    return ended(c, "the current is constant within a step");
}

EXPORT fmi2Status fmi2GetRealOutputDerivatives(
    fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Integer order[], fmi2Real value[])
{
    (void)vr;
    (void)n;
    (void)order;
    (void)value;
    return ended(c, "this FMU has no derivatives to give");
}

EXPORT fmi2Status fmi2DoStep(fmi2Component c, fmi2Real from_s, fmi2Real duration_s, fmi2Boolean keep)
{
    struct instance *of = c;
    (void)keep;
    return ended(of, rw_instance_step(&of->kept, from_s, duration_s));
}

EXPORT fmi2Status fmi2CancelStep(fmi2Component c)
{
    return ended(c, "a step is over when it returns");
}

#define NO_STATUS(type, of_type)                                                                             \
    EXPORT fmi2Status fmi2Get##type(fmi2Component c, const fmi2StatusKind kind, of_type *value)              \
    {                                                                                                        \
        (void)c;                                                                                             \
        (void)kind;                                                                                          \
        (void)value;                                                                                         \
        return fmi2Discard;                                                                                  \
    }

NO_STATUS(Status, fmi2Status)
NO_STATUS(IntegerStatus, fmi2Integer)
NO_STATUS(BooleanStatus, fmi2Boolean)
NO_STATUS(StringStatus, fmi2String)

EXPORT fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value)
{
    struct instance *of = c;
    if (kind != fmi2LastSuccessfulTime) {
        return fmi2Discard;
    }
    return ended(of, rw_instance_get(&of->kept, RW_TIME, value));
}
