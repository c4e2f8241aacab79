/* What a program asks of the board it runs on. */
#ifndef BOARD_H
#define BOARD_H

/* Text and a number, for the one who started the emulator. */
void board_say(const char *text);
void board_tell(const char *name, long number);

/* Counted since any moment: ticks of board_tick_size instructions (cycles on AVR). */
unsigned long board_ticks(void);
extern const unsigned long board_tick_size;

/* Fill the free stack; then how deep it was used since, bytes. */
void board_fill_stack(void);
long board_stack_depth(void);

/* The program, and its end. */
int main(void);
void board_end(int status);

#endif
