/* The wheel behind the functions of FMI 3.0 for co-simulation. */
#include <stdlib.h>
#include <string.h>

#ifdef RW_FMI_HEADERS
#include "fmi3Functions.h"
#else
#include "fmi3_types.h"
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
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
};

static fmi3Status ended(fmi3Instance instance, rw_fault fault)
{
    const struct instance *of = instance;
    if (fault == NULL) {
        return fmi3OK;
    }
    if (of->log != NULL) {
        of->log(of->environment, fmi3Error, "logStatusError", fault);
    }
    return fmi3Error;
}

EXPORT const char *fmi3GetVersion(void)
{
    return "3.0";
}

EXPORT fmi3Status fmi3SetDebugLogging(fmi3Instance c, fmi3Boolean on, size_t n, const fmi3String categories[])
{
    (void)c;
    (void)on;
    (void)n;
    (void)categories;
    return fmi3OK; /* errors are told in any case, and there is nothing else to tell */
}

EXPORT fmi3Instance fmi3InstantiateCoSimulation(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible, fmi3Boolean logging,
    fmi3Boolean has_events, fmi3Boolean may_return, const fmi3ValueReference intermediate[], size_t intermediates,
    fmi3InstanceEnvironment environment, fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update)
{
    struct instance *found;
    (void)name;
    (void)resources;
    (void)visible;
    (void)logging;
    (void)has_events;
    (void)may_return;
    (void)intermediate;
    (void)intermediates;
    (void)update;
    if (token == NULL || strcmp(token, RW_TOKEN) != 0) {
        if (log != NULL) {
            log(environment, fmi3Error, "logStatusError", "the instantiation token is that of another model");
        }
        return NULL;
    }
    found = calloc(1, sizeof *found);
    if (found == NULL) {
        return NULL;
    }
    found->environment = environment;
    found->log = log;
    rw_instance_begin(&found->kept);
    return found;
}

EXPORT fmi3Instance fmi3InstantiateModelExchange(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible, fmi3Boolean logging,
    fmi3InstanceEnvironment environment, fmi3LogMessageCallback log)
{
    (void)name;
    (void)token;
    (void)resources;
    (void)visible;
    (void)logging;
    if (log != NULL) {
        log(environment, fmi3Error, "logStatusError", "this FMU is for co-simulation");
    }
    return NULL;
}

EXPORT fmi3Instance fmi3InstantiateScheduledExecution(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible, fmi3Boolean logging,
    fmi3InstanceEnvironment environment, fmi3LogMessageCallback log, fmi3ClockUpdateCallback update,
    fmi3LockPreemptionCallback lock, fmi3UnlockPreemptionCallback unlock)
{
    (void)update;
    (void)lock;
    (void)unlock;
    return fmi3InstantiateModelExchange(name, token, resources, visible, logging, environment, log);
}

EXPORT void fmi3FreeInstance(fmi3Instance c)
{
    free(c);
}

EXPORT fmi3Status fmi3EnterInitializationMode(
    fmi3Instance c, fmi3Boolean has_tolerance, fmi3Float64 tolerance, fmi3Float64 start_s, fmi3Boolean has_stop,
    fmi3Float64 stop_s)
{
    struct instance *of = c;
    (void)has_tolerance;
    (void)tolerance;
    (void)has_stop;
    (void)stop_s;
    of->kept.start_s = start_s;
    of->kept.mode = RW_INITIALIZING;
    return fmi3OK;
}

EXPORT fmi3Status fmi3ExitInitializationMode(fmi3Instance c)
{
    struct instance *of = c;
    return ended(c, rw_instance_initialized(&of->kept));
}

EXPORT fmi3Status fmi3Terminate(fmi3Instance c)
{
    struct instance *of = c;
    of->kept.mode = RW_ENDED;
    return fmi3OK;
}

EXPORT fmi3Status fmi3Reset(fmi3Instance c)
{
    struct instance *of = c;
    rw_instance_begin(&of->kept);
    return fmi3OK;
}

EXPORT fmi3Status fmi3GetFloat64(
    fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Float64 values[], size_t count)
{
    struct instance *of = c;
    rw_fault fault = n == count ? NULL : "every variable of this FMU has one value";
    for (size_t i = 0; i < n && fault == NULL; ++i) {
        fault = rw_instance_get(&of->kept, vr[i], &values[i]);
    }
    return ended(c, fault);
}

EXPORT fmi3Status fmi3SetFloat64(
    fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3Float64 values[], size_t count)
{
    struct instance *of = c;
    rw_fault fault = n == count ? NULL : "every variable of this FMU has one value";
    for (size_t i = 0; i < n && fault == NULL; ++i) {
        fault = rw_instance_set(&of->kept, vr[i], values[i]);
    }
    return ended(c, fault);
}

static fmi3Status none_of(fmi3Instance c, size_t n)
{
    return ended(c, n == 0 ? NULL : "all variables of this FMU are of type Float64");
}

#define OTHER(type)                                                                                          \
    EXPORT fmi3Status fmi3Get##type(                                                                         \
        fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3##type values[], size_t count)          \
    {                                                                                                        \
        (void)vr;                                                                                            \
        (void)values;                                                                                        \
        (void)count;                                                                                         \
        return none_of(c, n);                                                                                \
    }                                                                                                        \
    EXPORT fmi3Status fmi3Set##type(                                                                         \
        fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3##type values[], size_t count)    \
    {                                                                                                        \
        (void)vr;                                                                                            \
        (void)values;                                                                                        \
        (void)count;                                                                                         \
        return none_of(c, n);                                                                                \
    }

OTHER(Float32)
OTHER(Int8)
OTHER(UInt8)
OTHER(Int16)
OTHER(UInt16)
OTHER(Int32)
OTHER(UInt32)
OTHER(Int64)
OTHER(UInt64)
OTHER(Boolean)
OTHER(String)

EXPORT fmi3Status fmi3GetBinary(
    fmi3Instance c, const fmi3ValueReference vr[], size_t n, size_t sizes[], fmi3Binary values[], size_t count)
{
    (void)vr;
    (void)sizes;
    (void)values;
    (void)count;
    return none_of(c, n);
}

EXPORT fmi3Status fmi3SetBinary(
    fmi3Instance c, const fmi3ValueReference vr[], size_t n, const size_t sizes[], const fmi3Binary values[],
    size_t count)
{
    (void)vr;
    (void)sizes;
    (void)values;
    (void)count;
    return none_of(c, n);
}

#define NO_VALUES(name, of_type)                                                                             \
    EXPORT fmi3Status fmi3##name(                                                                            \
        fmi3Instance c, const fmi3ValueReference vr[], size_t n, of_type values[])                           \
    {                                                                                                        \
        (void)vr;                                                                                            \
        (void)values;                                                                                        \
        return none_of(c, n);                                                                                \
    }

NO_VALUES(GetClock, fmi3Clock)
NO_VALUES(SetClock, const fmi3Clock)
NO_VALUES(SetIntervalDecimal, const fmi3Float64)
NO_VALUES(GetShiftDecimal, fmi3Float64)
NO_VALUES(SetShiftDecimal, const fmi3Float64)

#define NO_PAIRS(name, of_type, of_other)                                                                    \
    EXPORT fmi3Status fmi3##name(                                                                            \
        fmi3Instance c, const fmi3ValueReference vr[], size_t n, of_type values[], of_other others[])        \
    {                                                                                                        \
        (void)vr;                                                                                            \
        (void)values;                                                                                        \
        (void)others;                                                                                        \
        return none_of(c, n);                                                                                \
    }

NO_PAIRS(GetIntervalDecimal, fmi3Float64, fmi3IntervalQualifier)
NO_PAIRS(SetIntervalFraction, const fmi3UInt64, const fmi3UInt64)
NO_PAIRS(GetShiftFraction, fmi3UInt64, fmi3UInt64)
NO_PAIRS(SetShiftFraction, const fmi3UInt64, const fmi3UInt64)

EXPORT fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState *state)
{
    struct instance *of = c;
    return ended(of, rw_instance_copy(&of->kept, sizeof of->kept, state));
}

EXPORT fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState state)
{
    struct instance *of = c;
    memcpy(&of->kept, state, sizeof of->kept);
    return fmi3OK;
}

EXPORT fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState *state)
{
    (void)c;
    free(*state);
    *state = NULL;
    return fmi3OK;
}

EXPORT fmi3Status fmi3SerializedFMUStateSize(fmi3Instance c, fmi3FMUState state, size_t *size)
{
    (void)c;
    (void)state;
    *size = sizeof(struct rw_kept);
    return fmi3OK;
}

EXPORT fmi3Status fmi3SerializeFMUState(fmi3Instance c, fmi3FMUState state, fmi3Byte bytes[], size_t size)
{
    return ended(c, rw_instance_write(state, bytes, size));
}

EXPORT fmi3Status fmi3DeserializeFMUState(
    fmi3Instance c, const fmi3Byte bytes[], size_t size, fmi3FMUState *state)
{
    return ended(c, rw_instance_copy(bytes, size, state));
}

EXPORT fmi3Status fmi3DoStep(
    fmi3Instance c, fmi3Float64 from_s, fmi3Float64 duration_s, fmi3Boolean keep, fmi3Boolean *has_event,
    fmi3Boolean *terminates, fmi3Boolean *is_early, fmi3Float64 *until_s)
{
    struct instance *of = c;
    rw_fault fault = rw_instance_step(&of->kept, from_s, duration_s);
    (void)keep;
    *has_event = false;
    *terminates = false;
    *is_early = false;
    *until_s = fault == NULL ? from_s + duration_s : of->kept.wheel.now[0];
    return ended(c, fault);
}

/* What this FMU has none of: derivatives, clocks, events, changes of structure. */
static fmi3Status not_here(fmi3Instance c)
{
    return ended(c, "this FMU has neither derivatives nor clocks, events or structural parameters");
}

EXPORT fmi3Status fmi3GetNumberOfVariableDependencies(fmi3Instance c, fmi3ValueReference vr, size_t *count)
{
    (void)vr;
    (void)count;
    return not_here(c);
}

EXPORT fmi3Status fmi3GetVariableDependencies(
    fmi3Instance c, fmi3ValueReference vr, size_t dependent[], fmi3ValueReference independents[],
    size_t independent[], fmi3DependencyKind kinds[], size_t count)
{
    (void)vr;
    (void)dependent;
    (void)independents;
    (void)independent;
    (void)kinds;
    (void)count;
    return not_here(c);
}

#define DERIVATIVE(which)                                                                                    \
    EXPORT fmi3Status fmi3Get##which##Derivative(                                                            \
        fmi3Instance c, const fmi3ValueReference unknowns[], size_t n, const fmi3ValueReference knowns[],    \
        size_t m, const fmi3Float64 seed[], size_t seeds, fmi3Float64 found[], size_t founds)                \
    {                                                                                                        \
        (void)unknowns;                                                                                      \
        (void)n;                                                                                             \
        (void)knowns;                                                                                        \
        (void)m;                                                                                             \
        (void)seed;                                                                                          \
        (void)seeds;                                                                                         \
        (void)found;                                                                                         \
        (void)founds;                                                                                        \
        return not_here(c);                                                                                  \
    }

DERIVATIVE(Directional)
DERIVATIVE(Adjoint)

#define NOTHING(name)                          \
    EXPORT fmi3Status fmi3##name(fmi3Instance c) \
    {                                          \
        return not_here(c);                    \
    }

NOTHING(EnterConfigurationMode)
NOTHING(ExitConfigurationMode)
NOTHING(EnterEventMode)
NOTHING(EvaluateDiscreteStates)
NOTHING(EnterContinuousTimeMode)
NOTHING(EnterStepMode)

EXPORT fmi3Status fmi3GetIntervalFraction(
    fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3UInt64 counters[], fmi3UInt64 resolutions[],
    fmi3IntervalQualifier qualifiers[])
{
    (void)vr;
    (void)counters;
    (void)resolutions;
    (void)qualifiers;
    return none_of(c, n);
}

EXPORT fmi3Status fmi3UpdateDiscreteStates(
    fmi3Instance c, fmi3Boolean *again, fmi3Boolean *terminates, fmi3Boolean *nominals, fmi3Boolean *values,
    fmi3Boolean *has_next, fmi3Float64 *next_s)
{
    (void)again;
    (void)terminates;
    (void)nominals;
    (void)values;
    (void)has_next;
    (void)next_s;
    return not_here(c);
}

EXPORT fmi3Status fmi3CompletedIntegratorStep(
    fmi3Instance c, fmi3Boolean keep, fmi3Boolean *has_event, fmi3Boolean *terminates)
{
    (void)keep;
    (void)has_event;
    (void)terminates;
    return not_here(c);
}

EXPORT fmi3Status fmi3SetTime(fmi3Instance c, fmi3Float64 time_s)
{
    (void)time_s;
    return not_here(c);
}

EXPORT fmi3Status fmi3SetContinuousStates(fmi3Instance c, const fmi3Float64 states[], size_t n)
{
    (void)states;
    (void)n;
    return not_here(c);
}

#define STATES(name)                                                                    \
    EXPORT fmi3Status fmi3Get##name(fmi3Instance c, fmi3Float64 values[], size_t n)     \
    {                                                                                   \
        (void)values;                                                                   \
        (void)n;                                                                        \
        return not_here(c);                                                             \
    }

STATES(ContinuousStateDerivatives)
STATES(EventIndicators)
STATES(ContinuousStates)
STATES(NominalsOfContinuousStates)

#define COUNT(name)                                                        \
    EXPORT fmi3Status fmi3GetNumberOf##name(fmi3Instance c, size_t *count) \
    {                                                                      \
        (void)c;                                                           \
        *count = 0;                                                        \
        return fmi3OK;                                                     \
    }

COUNT(EventIndicators)
COUNT(ContinuousStates)

EXPORT fmi3Status fmi3GetOutputDerivatives(
    fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3Int32 orders[], fmi3Float64 values[],
    size_t count)
{
    (void)vr;
    (void)n;
    (void)orders;
    (void)values;
    (void)count;
    return not_here(c);
}

EXPORT fmi3Status fmi3ActivateModelPartition(fmi3Instance c, fmi3ValueReference clock, fmi3Float64 time_s)
{
    (void)clock;
    (void)time_s;
    return not_here(c);
}
