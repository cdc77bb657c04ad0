// SPDX-License-Identifier: MIT
// Interrupts: the handlers that stop. Each ends its interrupt's cause, or masks it until the main loop has dealt with it.
#ifndef OLS_INTERRUPTS_H
#define OLS_INTERRUPTS_H

// Lets them in. Once, when everything else is ready.
void interrupts_init(void);

// Priority 0, so none of them interrupts another.
void interrupt_tick(void);         // a millisecond has passed: wakes
void interrupt_heartbeat(void);    // no message in time
void interrupt_usb(void);          // the bus is reset or suspended; everything else wakes
void interrupt_player(void);       // a machine of PIO block 0 is starved; all cycles played wakes
void interrupt_light(void);        // a light is too long
void interrupt_stop_inputs(void);  // one has fallen; GENLOCK's rise wakes, the CAN controller's fall raises IRQ_CAN

// Priority 1: these follow the program, which takes longer than stopping may.
void interrupt_trigger(void);       // TRIG0 has been stamped: was it due?
void interrupt_trigger_late(void);  // it should have been stamped by now

#endif
