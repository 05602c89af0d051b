/* Reset of a Cortex-M4 for qemu's mps2-an386: vectors, floating-point unit, memory, then newlib's own start. */
#include <stdint.h>

extern uint32_t stack_top, data_load, data_begin, data_end, bss_begin, bss_end;
extern int __wrap_main(void);
extern void initialise_monitor_handles(void);
extern void _exit(int status);

static void reset(void);
static void stop(void);

__attribute__((section(".vectors"), used)) static void *const vectors[16] = {
    &stack_top, (void *)reset, (void *)stop, (void *)stop, (void *)stop, (void *)stop, (void *)stop,
};

static void reset(void)
{
    *(volatile uint32_t *)0xE000ED88u |= 0xFu << 20;
    __asm volatile("dsb\n isb");
    for (uint32_t *to = &data_begin, *from = &data_load; to < &data_end; ++to, ++from) {
        *to = *from;
    }
    for (uint32_t *to = &bss_begin; to < &bss_end; ++to) {
        *to = 0;
    }
    initialise_monitor_handles();
    _exit(__wrap_main());
}

static void stop(void)
{
    _exit(99);
}
