/* One wheel of the simulation: what both versions of FMI have in common. `model.h` has the numbers of the model. */
#ifndef RW_INSTANCE_H
#define RW_INSTANCE_H

#include <stdbool.h>
#include <stddef.h>

#include "wheel.h"

enum rw_mode { RW_INSTANTIATED, RW_INITIALIZING, RW_STEPPING, RW_ENDED };

/* All that a copy of the state has. */
struct rw_kept {
    struct rw_plant wheel;
    struct rw_surroundings around;
    double inertia_kg_m2;
    double start_s;
    int mode;
};

/* NULL, or what is wrong, for a person. */
typedef const char *rw_fault;

void rw_instance_begin(struct rw_kept *kept);
rw_fault rw_instance_initialized(struct rw_kept *kept);
rw_fault rw_instance_get(struct rw_kept *kept, unsigned reference, double *value);
rw_fault rw_instance_set(struct rw_kept *kept, unsigned reference, double value);
/* A copy of all that is kept, at *state, which is made where there is none; and such a copy as bytes. */
rw_fault rw_instance_copy(const void *kept, size_t size, void **state);
rw_fault rw_instance_write(const void *state, void *bytes, size_t size);
rw_fault rw_instance_step(struct rw_kept *kept, double from_s, double duration_s);

#endif
