/* Instructions and stack of rw_ekf_step over the recorded readings: `main` of the self-test runs behind it.
 *
 * With `-icount shift=0` qemu lets one instruction take 1 ns, and SysTick of the mps2-an386 counts at 25 MHz: 40
 * instructions a tick.
 */
#include "rw_ekf.h"

#include <stdint.h>
#include <stdio.h>

#define CONTROL (*(volatile uint32_t *)0xE000E010u)
#define RELOAD (*(volatile uint32_t *)0xE000E014u)
#define NOW (*(volatile uint32_t *)0xE000E018u)
#define PER_TICK 40u
#define PAINTED 4096u
#define PAINT 0xA5u

struct rw_taken __real_rw_ekf_step(struct rw_onboard *held, struct rw_reading reading);
struct rw_taken __wrap_rw_ekf_step(struct rw_onboard *held, struct rw_reading reading);
int __real_main(void);
int __wrap_main(void);

static uint64_t sum, most;
static unsigned readings;
static uint32_t deepest;

struct rw_taken __wrap_rw_ekf_step(struct rw_onboard *held, struct rw_reading reading)
{
    volatile uint8_t *const top = (uint8_t *)__builtin_frame_address(0) - 256;
    for (uint32_t i = 0; i < PAINTED; ++i) {
        top[-(int32_t)i] = PAINT;
    }
    const uint32_t before = NOW;
    const struct rw_taken taken = __real_rw_ekf_step(held, reading);
    const uint64_t instructions = (uint64_t)((before - NOW) & 0xFFFFFFu) * PER_TICK;
    uint32_t used = PAINTED;
    while (used > 0 && top[-(int32_t)(used - 1)] == PAINT) {
        --used;
    }
    deepest = used + 256 > deepest ? used + 256 : deepest;
    sum += instructions;
    most = instructions > most ? instructions : most;
    ++readings;
    return taken;
}

int __wrap_main(void)
{
    RELOAD = 0xFFFFFFu;
    NOW = 0;
    CONTROL = 5u;
    const int status = __real_main();
    printf("%u readings: %lu instructions on average, %lu at most; %lu bytes of stack at most; %u bytes of memory\n",
           readings, (unsigned long)(sum / readings), (unsigned long)most, (unsigned long)deepest,
           (unsigned)sizeof(struct rw_onboard));
    return status;
}
