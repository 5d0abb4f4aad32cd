// SPDX-License-Identifier: Apache-2.0
// Pins of an ATmega328P board, in brackets as boards of the Nano and Uno format print them.
#pragma once

#include <avr/io.h>

// The wand. The compare units of timers 1 and 2 switch the LEDs, that of timer 0 dims them.
#define LED_1_DDR DDRB  // [D9] OC1A
#define LED_1_PORT PORTB
#define LED_1_PIN PINB
#define LED_1_BIT PB1
#define LED_2_DDR DDRB  // [D10] OC1B
#define LED_2_PORT PORTB
#define LED_2_PIN PINB
#define LED_2_BIT PB2
#define LED_3_DDR DDRD  // [D3] OC2B
#define LED_3_PORT PORTD
#define LED_3_PIN PIND
#define LED_3_BIT PD3
#define DIM_DDR DDRD  // [D6] OC0A
#define DIM_PORT PORTD
#define DIM_BIT PD6
#define BATTERY_ADC 0  // [A0] half the battery's voltage

// The trigger generator: one signal on two pins, for frame cameras and for event cameras.
#define PULSE_DDR DDRB
#define PULSE_PORT PORTB
#define PULSE_PIN PINB
#define PULSE_BIT PB1                     // [D9] OC1A
#define PULSE_BITS (_BV(PB1) | _BV(PB2))  // and [D10] OC1B

// Both.
#define BUTTON_PORT PORTD  // [D2] to ground while pressed
#define BUTTON_PIN PIND
#define BUTTON_BIT PD2
#define STATUS_DDR DDRB  // [D13] the board's own LED
#define STATUS_PORT PORTB
#define STATUS_BIT PB5
