/* What all boards share: numbers as text, and how deep the stack was used. */
#include "board.h"

#define PATTERN 0xA5
#define SPARED 64 /* bytes of the caller and of these functions */

#ifdef __AVR__
#define STACK_END __heap_start
#else
#define STACK_END _end
#endif
extern unsigned char STACK_END[];

static unsigned char *from;

void board_tell(const char *name, long number)
{
    char text[12];
    int at = 11;
    unsigned long left = number < 0 ? 0UL - (unsigned long)number : (unsigned long)number;
    text[at] = 0;
    do {
        text[--at] = (char)('0' + left % 10);
        left /= 10;
    } while (left);
    if (number < 0) {
        text[--at] = '-';
    }
    board_say(name);
    board_say(" ");
    board_say(text + at);
    board_say("\n");
}

void board_fill_stack(void)
{
    unsigned char here;
    volatile unsigned char *at;
    from = &here - SPARED;
    for (at = STACK_END; at < from; at++) {
        *at = PATTERN;
    }
}

long board_stack_depth(void)
{
    const volatile unsigned char *at = STACK_END;
    while (at < from && *at == PATTERN) {
        at++;
    }
    return (long)(from - at) + SPARED;
}
