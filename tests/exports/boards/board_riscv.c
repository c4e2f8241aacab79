/* A 32-bit RISC-V in qemu: start, semihosting, and the counter of instructions. */
#include "board.h"

extern unsigned int _data_from[], _data[], _data_end[], _bss[], _end[], _stack[];
void board_start(void);
void board_fault(void);

__attribute__((naked, section(".vectors"), used)) void board_reset(void)
{
    __asm__ volatile(".option arch, +zicsr\nla sp, _stack\nla t0, board_fault\ncsrw mtvec, t0\nj board_start");
}

static int host(int number, const void *argument)
{
    register int a0 __asm__("a0") = number;
    register const void *a1 __asm__("a1") = argument;
    __asm__ volatile(".option push\n.option norvc\n.balign 16\nslli zero, zero, 0x1f\nebreak\n"
                     "srai zero, zero, 7\n.option pop"
                     : "+r"(a0)
                     : "r"(a1)
                     : "memory");
    return a0;
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

__attribute__((aligned(4))) void board_fault(void)
{
    board_say("trap\n");
    board_end(99);
}

const unsigned long board_tick_size = 1;

unsigned long board_ticks(void)
{
    unsigned long count;
    __asm__ volatile(".option arch, +zicsr\ncsrr %0, minstret" : "=r"(count));
    return count;
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
    board_end(main());
}
