/* One wheel of the simulation: its variables by their references, and its steps. */
#include "instance.h"

#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include "model.h"

#define PARTS_MOST 1.0e6 /* of one step: a day at 10 Hz; more is a slip of units, and would seem to hang */

void rw_instance_begin(struct rw_kept *kept)
{
    static const double columns[3] = RW_COLUMN_STARTS;
    rw_wheel_start(&kept->wheel);
    kept->around.current_A = 0.0;
    kept->around.temperature_degC = RW_TEMPERATURE_START;
    for (int i = 0; i < 3; ++i) {
        kept->around.columns.v[i] = columns[i];
    }
    kept->inertia_kg_m2 = RW_INERTIA_KG_M2;
    kept->start_s = 0.0;
    kept->mode = RW_INSTANTIATED;
}

rw_fault rw_instance_initialized(struct rw_kept *kept)
{
    if (!isfinite(kept->start_s)) {
        return "the start time is no finite number";
    }
    rw_wheel_begin(&kept->wheel, kept->start_s);
    kept->mode = RW_STEPPING;
    return NULL;
}

/* Where a variable that can be set is kept; NULL for any other. */
static double *place_of(struct rw_kept *kept, unsigned reference)
{
    if (reference == RW_CURRENT) {
        return &kept->around.current_A;
    }
    if (reference == RW_TEMPERATURE) {
        return &kept->around.temperature_degC;
    }
    if (reference >= RW_COLUMN && reference < RW_COLUMN + 3u) {
        return &kept->around.columns.v[reference - RW_COLUMN];
    }
    if (reference == RW_SPEED) {
        return &kept->wheel.x[0];
    }
    if (reference == RW_ANGLE) {
        return &kept->wheel.now[1];
    }
    if (reference == RW_INERTIA) {
        return &kept->inertia_kg_m2;
    }
    if (reference > RW_STATE && reference <= RW_STATE + RW_PARAMETERS) {
        return &kept->wheel.x[reference - RW_STATE];
    }
    return NULL;
}

rw_fault rw_instance_get(struct rw_kept *kept, unsigned reference, double *value)
{
    const double *place = place_of(kept, reference);
    if (place != NULL) {
        *value = *place;
    } else if (reference == RW_TIME) {
        *value = kept->mode == RW_STEPPING ? kept->wheel.now[0] : kept->start_s;
    } else if (reference == RW_FRICTION) {
        *value = rw_wheel_friction(&kept->wheel, kept->around);
    } else if (reference == RW_TORQUE) {
        *value = kept->inertia_kg_m2 * rw_wheel_friction(&kept->wheel, kept->around);
    } else {
        return "there is no variable of this value reference";
    }
    return NULL;
}

rw_fault rw_instance_set(struct rw_kept *kept, unsigned reference, double value)
{
    double *place = place_of(kept, reference);
    if (place == NULL) {
        return "there is no variable of this value reference that can be set";
    }
    if (!isfinite(value)) {
        return "a value that is no finite number was set";
    }
    if (kept->mode >= RW_STEPPING && reference >= RW_SPEED) {
        return "parameters and start values are set before the end of the initialization";
    }
    *place = value;
    return NULL;
}

rw_fault rw_instance_copy(const void *kept, size_t size, void **state)
{
    if (size != sizeof(struct rw_kept)) {
        return "these bytes are no state of this FMU";
    }
    if (*state == NULL) {
        *state = malloc(size);
    }
    if (*state == NULL) {
        return "there is no memory for a copy of the state";
    }
    memcpy(*state, kept, size);
    return NULL;
}

rw_fault rw_instance_write(const void *state, void *bytes, size_t size)
{
    if (size < sizeof(struct rw_kept)) {
        return "there is no room for the state";
    }
    memcpy(bytes, state, sizeof(struct rw_kept));
    return NULL;
}

rw_fault rw_instance_step(struct rw_kept *kept, double from_s, double duration_s)
{
    double parts;
    if (kept->mode != RW_STEPPING) {
        return "a step was asked for outside of a simulation";
    }
    if (!(isfinite(from_s) && isfinite(duration_s) && duration_s >= 0.0)) {
        return "a step needs a finite time, and a finite length that is not below zero";
    }
    /* The model's effects are taken as straight over a step: none is longer than the readings were apart. */
    parts = fmax(ceil(duration_s / RW_LONGEST_STEP_S - 1.0e-9), 1.0);
    if (parts > PARTS_MOST) {
        return "the step is longer than a million steps of the model";
    }
    for (int i = 0; i < (int)parts; ++i) {
        kept->wheel.now[0] = from_s + duration_s * (double)i / parts;
        if (!rw_wheel_turn(&kept->wheel, kept->around, duration_s / parts)) {
            return "the current changed more often within the model's delay than is remembered: take longer steps";
        }
    }
    kept->wheel.now[0] = from_s + duration_s;
    return isfinite(kept->wheel.x[0]) ? NULL : "the speed is no finite number any more";
}
