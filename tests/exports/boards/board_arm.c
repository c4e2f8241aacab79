/* Cortex-M in qemu: vectors, start, semihosting, and SysTick as the counter. */
#include "board.h"

extern unsigned int _data_from[], _data[], _data_end[], _bss[], _end[], _stack[];
void board_start(void);
void board_fault(void);

#define SYSTICK ((volatile unsigned int *)0xE000E010)

__attribute__((section(".vectors"), used)) static void *const vectors[16] = {
    _stack,      board_start, board_fault, board_fault, board_fault, board_fault,
    board_fault, board_fault, board_fault, board_fault, board_fault, board_fault,
    board_fault, board_fault, board_fault, board_fault,
};

static int host(int number, const void *argument)
{
    register int r0 __asm__("r0") = number;
    register const void *r1 __asm__("r1") = argument;
    __asm__ volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}

void board_say(const char *text)
{
    host(0x04, text);
}

void board_end(int status)
{
    const unsigned int block[2] = {0x20026, (unsigned int)status}; /* the program ended */
    board_tell("end", status);
    host(0x20, block);
    for (;;) {
    }
}

void board_fault(void)
{
    board_say("trap\n");
    board_end(99);
}

const unsigned long board_tick_size = TICK;

unsigned long board_ticks(void)
{
    return 0xFFFFFFUL - SYSTICK[2];
}

void board_start(void)
{
    unsigned int *to;
    const unsigned int *from = _data_from;
    for (to = _data; to < _data_end; to++) {
        *to = *from++;
    }
    for (to = _bss; to < _end; to++) {
        *to = 0;
    }
#ifdef __ARM_FP
    *(volatile unsigned int *)0xE000ED88 |= 0xFU << 20; /* the FPU on */
    __asm__ volatile("dsb\nisb");
#endif
    SYSTICK[1] = 0xFFFFFF;
    SYSTICK[2] = 0;
    SYSTICK[0] = 5;
    board_end(main());
}
