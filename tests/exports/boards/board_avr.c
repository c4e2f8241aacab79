/* An ATmega328P in simavr: serial port, and timer 1 as the counter of cycles. */
#include "board.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>

static volatile unsigned int overflows;

ISR(TIMER1_OVF_vect)
{
    overflows++;
}

void board_say(const char *text)
{
    for (; *text; text++) {
        while (!(UCSR0A & (1 << UDRE0))) {
        }
        UDR0 = (unsigned char)*text;
    }
}

void board_end(int status)
{
    volatile unsigned int wait = 0;
    board_tell("end", status);
    while (++wait) { /* until the last byte has gone */
    }
    cli();
    sleep_enable();
    sleep_cpu();
}

const unsigned long board_tick_size = 1;

unsigned long board_ticks(void)
{
    unsigned int high;
    unsigned int low;
    cli();
    low = TCNT1;
    high = overflows;
    if ((TIFR1 & (1 << TOV1)) && low < 0x8000U) {
        high++;
    }
    sei();
    return ((unsigned long)high << 16) | low;
}

__attribute__((constructor)) static void begin(void)
{
    UCSR0B = 1 << TXEN0;
    UBRR0 = 0;
    TCCR1B = 1;
    TIMSK1 = 1 << TOIE1;
    sei();
}


/* The library goes here when main returns. */
void exit(int status)
{
    board_end(status);
    for (;;) {
    }
}
