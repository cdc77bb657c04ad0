// SPDX-License-Identifier: MIT
// CAN bus by an MCP2515 or MCP25625 on SPI (Microchip DS20001801J). Its interrupt alone talks to it, at the lowest
// priority: it empties the two receive buffers before a third frame can come, 100 us at 1 Mbit/s, however long the main
// loop's turn, and holds up no other interrupt. Two rings of frames join it to the main loop.
#include <stddef.h>

#include "board.h"
#include "board_rp2040.h"
#include "can_bus.h"
#include "rp2040.h"
#include "wire.h"

// SPI instructions (table 12-1)
enum {
    INSTRUCTION_RESET = 0xc0,
    INSTRUCTION_READ = 0x03,
    INSTRUCTION_WRITE = 0x02,
    INSTRUCTION_MODIFY = 0x05,
    INSTRUCTION_READ_RECEIVED = 0x90,  // + 4 for buffer 1; clears its flag
    INSTRUCTION_LOAD_TO_SEND = 0x40,   // + 2 n for buffer n
    INSTRUCTION_SEND = 0x80            // + 1 << n for buffer n
};

// Registers (table 11-2)
enum { CANSTAT = 0x0e, CANCTRL = 0x0f, CNF3 = 0x28, CANINTF = 0x2c, EFLG = 0x2d, TXB0CTRL = 0x30, RXB0CTRL = 0x60 };
enum { RECEIVED_0 = 1, RECEIVED_1 = 2, SENT_0 = 4, ALL_SENT = 7 * SENT_0, ERROR = 0x20 };     // CANINTE and CANINTF
enum { OVERFLOWS = 0xc0, BUS_OFF = 0x20, TRANSMIT_PASSIVE = 0x10 };                           // EFLG
enum { MODE_NORMAL = 0x00, MODE_CONFIGURATION = 0x80, ABORT_ALL = 0x10, CTRL_RESET = 0x87 };  // CANCTRL, CANSTAT
enum { RECEIVE_ROLLOVER = 0x04 };                                                             // RXB0CTRL

// SIDH, SIDL, EID8, EID0, DLC, then data: one layout for sending and receiving.
enum { ID_HIGH = 0, ID_LOW = 1, LENGTH = 4, DATA = 5, IMAGE_BYTES = 13, EXTENDED = 0x08, REMOTE = 0x10 };

enum {
    SPI_HZ_MAX = 10000000,  // the controller's (table 13-6)
    SPI_PRESCALE = 2,
    SPI_DIVIDER = (BOARD_TICK_HZ + SPI_PRESCALE * SPI_HZ_MAX - 1) / (SPI_PRESCALE * SPI_HZ_MAX),  // 7: 8.9 MHz
    SPI_FIFO = 8,
    SEND_BUFFERS = 3,
    TO_SEND_MAX = 32,
    SERVES_A_TURN = 2 * TO_SEND_MAX,
    RESET_US = 10,  // 128 oscillator cycles after reset (8.1), and RESET low for 2 us (table 13-2)
    GIVE_UP_US = 1000000
};

// Eight quanta of 1 or 2 oscillator periods' pairs: 1 of sync, 4 of propagation, 1 and 2 around the sample at 75 % (chapter 5).
// At 1 Mbit/s a dominant bit of the far end has 500 ns to be seen here: twice the cable and the transceivers' loop delay,
// docs/hardware.md, "CAN". Propagation and phase 1 together are not shorter than phase 2, nor is that as short as a jump (5.3).
enum {
    QUANTA = 8,
    PROPAGATION = 4,
    PHASE_1 = 1,
    PHASE_2 = 2,
    PRESCALER = BOARD_CAN_OSCILLATOR_HZ / 2 / QUANTA / (BOARD_CAN_KBIT_S * 1000),
    TIMING_1 = PRESCALER - 1,
    TIMING_2 = 0x80 | (PHASE_1 - 1) << 3 | (PROPAGATION - 1),
    TIMING_3 = PHASE_2 - 1
};
_Static_assert(1 + PROPAGATION + PHASE_1 + PHASE_2 == QUANTA, "the segments are a bit");
_Static_assert(PRESCALER >= 1 && PRESCALER * 2 * QUANTA * BOARD_CAN_KBIT_S * 1000 == BOARD_CAN_OSCILLATOR_HZ,
               "the oscillator must give eight whole quanta a bit");

// One writer and one reader each, and one core: indices alone keep them apart.
struct ring {
    volatile uint8_t written, read;  // counts, modulo 256
    struct can_bus_frame frames[CAN_BUS_RECEIVED_MAX];
};
_Static_assert((int)TO_SEND_MAX == (int)CAN_BUS_RECEIVED_MAX && 256 % CAN_BUS_RECEIVED_MAX == 0, "one kind of ring");

static struct ring received, to_send;
static bool present;
static volatile uint8_t free_buffers = (1 << SEND_BUFFERS) - 1;  // bit n: send buffer n is empty
static uint8_t next_buffer = SEND_BUFFERS - 1;
static volatile bool give_up;
static volatile uint8_t frames_sent;
static volatile struct can_bus_health health;
static volatile uint8_t serves_left;  // until the main loop's next turn
static uint64_t progress_us;
static uint8_t progress_sent;

static bool is_empty(const struct ring* ring) {
    return ring->written == ring->read;
}

static bool is_full(const struct ring* ring) {
    return (uint8_t)(ring->written - ring->read) == CAN_BUS_RECEIVED_MAX;
}

// SPI

static void select_controller(bool selected) {
    GPIO_CTRL(BOARD_PIN_CAN_CS) =
        GPIO_FUNCTION_NONE | GPIO_OUTPUT_ALWAYS | (selected ? GPIO_OUTPUT_LOW : GPIO_OUTPUT_HIGH);
}

// Bytes both ways at once, one instruction: 0.9 us each, 14 at most.
static void exchange(const uint8_t* out, uint8_t* in, size_t byte_count) {
    select_controller(true);
    size_t sent = 0;
    for (size_t got = 0; got < byte_count;) {
        if (sent < byte_count && sent - got < SPI_FIFO) {
            SPI_DR(BOARD_CAN_SPI) = out[sent];
            sent++;
        }
        if (SPI_SR(BOARD_CAN_SPI) & SPI_SR_RECEIVED) in[got++] = (uint8_t)SPI_DR(BOARD_CAN_SPI);
    }
    select_controller(false);
}

static void instruct(uint8_t instruction) {
    uint8_t nothing;
    exchange(&instruction, &nothing, 1);
}

// Two registers, from `address` on.
static void read_two(uint8_t address, uint8_t values[2]) {
    const uint8_t out[4] = {INSTRUCTION_READ, address};
    uint8_t in[4];
    exchange(out, in, sizeof out);
    values[0] = in[2];
    values[1] = in[3];
}

static void modify(uint8_t address, uint8_t mask, uint8_t value) {
    const uint8_t out[4] = {INSTRUCTION_MODIFY, address, mask, value};
    uint8_t in[4];
    exchange(out, in, sizeof out);
}

static void write(uint8_t address, const uint8_t* values, size_t count) {
    uint8_t out[2 + 12] = {INSTRUCTION_WRITE, address}, in[2 + 12];
    for (size_t i = 0; i < count; i++) out[2 + i] = values[i];
    exchange(out, in, 2 + count);
}

// The interrupt's work

static void take_received(unsigned buffer) {
    const uint8_t out[1 + IMAGE_BYTES] = {(uint8_t)(INSTRUCTION_READ_RECEIVED | buffer << 2)};
    uint8_t in[1 + IMAGE_BYTES];
    exchange(out, in, sizeof out);
    const uint8_t* const image = in + 1;
    if (image[ID_LOW] & (EXTENDED | REMOTE)) return;
    if (is_full(&received)) {
        health.frames_lost++;
        return;
    }
    struct can_bus_frame* const frame = &received.frames[received.written % CAN_BUS_RECEIVED_MAX];
    frame->id = (uint16_t)(image[ID_HIGH] << 3 | image[ID_LOW] >> 5);
    frame->length = image[LENGTH] & 0xf;
    if (frame->length > sizeof frame->data) frame->length = sizeof frame->data;
    for (size_t i = 0; i < frame->length; i++) frame->data[i] = image[DATA + i];
    received.written++;
}

static void load(unsigned buffer, const struct can_bus_frame* frame) {
    uint8_t out[1 + IMAGE_BYTES] = {(uint8_t)(INSTRUCTION_LOAD_TO_SEND | buffer << 1)}, in[1 + IMAGE_BYTES];
    out[1 + ID_HIGH] = (uint8_t)(frame->id >> 3);
    out[1 + ID_LOW] = (uint8_t)(frame->id << 5);
    out[1 + LENGTH] = frame->length;
    for (size_t i = 0; i < frame->length; i++) out[1 + DATA + i] = frame->data[i];
    exchange(out, in, 1 + DATA + frame->length);
    instruct((uint8_t)(INSTRUCTION_SEND | 1 << buffer));
}

// The controller sends the highest of its full buffers first (3.3), so they are filled downwards and only from the top
// again when all are empty: frames leave in order.
static void send_queued(void) {
    while (!is_empty(&to_send)) {
        if (next_buffer == SEND_BUFFERS - 1 && free_buffers != (1 << SEND_BUFFERS) - 1) return;
        load(next_buffer, &to_send.frames[to_send.read % CAN_BUS_RECEIVED_MAX]);
        to_send.read++;
        free_buffers &= (uint8_t) ~(1 << next_buffer);
        next_buffer = next_buffer == 0 ? SEND_BUFFERS - 1 : next_buffer - 1;
    }
}

static void give_up_sending(void) {
    give_up = false;
    modify(CANCTRL, ABORT_ALL, ABORT_ALL);
    modify(CANCTRL, ABORT_ALL, 0);
    for (unsigned buffer = 0; buffer < SEND_BUFFERS; buffer++)
        if (!(free_buffers >> buffer & 1)) health.frames_lost++;
    health.frames_lost = (uint16_t)(health.frames_lost + (uint8_t)(to_send.written - to_send.read));
    to_send.read = to_send.written;
    free_buffers = (1 << SEND_BUFFERS) - 1;
    next_buffer = SEND_BUFFERS - 1;
}

static void note_errors(uint8_t flags, uint8_t errors) {
    if (errors & OVERFLOWS) {
        health.frames_lost++;
        modify(EFLG, OVERFLOWS, 0);
    }
    if (errors & ~health.controller_flags & BUS_OFF) health.bus_offs++;
    health.controller_flags = errors & (uint8_t)~OVERFLOWS;
    if (flags & ERROR) modify(CANINTF, ERROR, 0);
}

static bool wants_something(void) {
    return !(GPIO_STATUS(BOARD_PIN_CAN_INTERRUPT) & GPIO_FROM_PAD);
}

static void serve(void) {
    uint8_t state[2];  // CANINTF, EFLG
    read_two(CANINTF, state);
    // Buffer 0 first: buffer 1 has a frame only if it came while buffer 0 was full. Both are emptied again before another
    // frame can be complete, 47 us at the least, so that their order is never in doubt.
    if (state[0] & RECEIVED_0) take_received(0);
    if (state[0] & RECEIVED_1) take_received(1);
    const uint8_t sent = state[0] & ALL_SENT;
    if (sent) {
        modify(CANINTF, sent, 0);
        free_buffers |= sent / SENT_0;
        frames_sent++;
    }
    note_errors(state[0], state[1]);
}

// However often the pin falls, or if it never rises, the main loop has its turn: it lets the handler serve some more. As
// many as a working controller can ask for meanwhile: every frame of both rings.
void mcp2515_interrupt(void) {
    if (give_up) give_up_sending();
    for (; serves_left > 0; serves_left--) {
        board_watch_can_interrupt();  // before the look, so that no fall is between them
        if (!wants_something()) break;
        serve();
    }
    send_queued();
    board_wake();
}

// The main loop's side

static void connect(unsigned pin, uint32_t function, uint32_t pull) {
    PAD_GPIO(pin) = PAD_INPUT | PAD_4MA | PAD_SCHMITT | pull;
    GPIO_CTRL(pin) = function;
}

static void wait_us(uint32_t us) {
    for (const uint64_t begin_us = board_time_us(); board_time_us() - begin_us <= us;) {
    }
}

static void connect_pins(void) {
    connect(BOARD_PIN_CAN_CS, GPIO_FUNCTION_NONE | GPIO_OUTPUT_ALWAYS | GPIO_OUTPUT_HIGH, PAD_PULL_UP);
    connect(BOARD_PIN_CAN_RESET, GPIO_FUNCTION_NONE | GPIO_OUTPUT_ALWAYS | GPIO_OUTPUT_LOW, PAD_PULL_UP);
    connect(BOARD_PIN_CAN_STANDBY, GPIO_FUNCTION_NONE | GPIO_OUTPUT_ALWAYS | GPIO_OUTPUT_LOW, PAD_PULL_DOWN);
    connect(BOARD_PIN_CAN_INTERRUPT, GPIO_FUNCTION_SIO, PAD_PULL_UP);
    connect(BOARD_PIN_CAN_MISO, GPIO_FUNCTION_SPI, PAD_PULL_DOWN);
    connect(BOARD_PIN_CAN_SCK, GPIO_FUNCTION_SPI, PAD_PULL_DOWN);
    connect(BOARD_PIN_CAN_MOSI, GPIO_FUNCTION_SPI, PAD_PULL_DOWN);
    wait_us(RESET_US);
    GPIO_CTRL(BOARD_PIN_CAN_RESET) = GPIO_FUNCTION_NONE | GPIO_OUTPUT_ALWAYS | GPIO_OUTPUT_HIGH;
}

static void release_pins(void) {
    static const uint8_t pins[] = {BOARD_PIN_CAN_CS,        BOARD_PIN_CAN_RESET, BOARD_PIN_CAN_STANDBY,
                                   BOARD_PIN_CAN_INTERRUPT, BOARD_PIN_CAN_MISO,  BOARD_PIN_CAN_SCK,
                                   BOARD_PIN_CAN_MOSI};
    for (size_t i = 0; i < sizeof pins; i++) connect(pins[i], GPIO_FUNCTION_NONE, PAD_PULL_DOWN);
}

static void init_spi(void) {
    CLK_PERI_CTRL = CLK_ENABLE;  // from clk_sys
    reset_blocks(BOARD_CAN_SPI ? RESET_SPI1 : RESET_SPI0);
    SPI_CPSR(BOARD_CAN_SPI) = SPI_PRESCALE;
    SPI_CR0(BOARD_CAN_SPI) = (SPI_DIVIDER - 1) << 8 | SPI_MODE_1_1 | SPI_8_BITS;
    SPI_CR1(BOARD_CAN_SPI) = SPI_ENABLE;
}

// What the board listens to goes to buffer 0, and to buffer 1 when that is full. All other filters are the same.
static void configure(unsigned board_number) {
    static const uint8_t exact[4] = {0xff, 0xe0};
    const uint16_t id = (uint16_t)(OLS_CANBUS_TO_BOARD + 16 * board_number);
    const uint8_t filter[4] = {(uint8_t)(id >> 3), (uint8_t)(id << 5)};
    static const uint8_t filters[] = {0x00, 0x04, 0x08, 0x10, 0x14, 0x18}, masks[] = {0x20, 0x24};
    for (size_t i = 0; i < sizeof filters; i++) write(filters[i], filter, sizeof filter);
    for (size_t i = 0; i < sizeof masks; i++) write(masks[i], exact, sizeof exact);
    // CNF3, CNF2, CNF1, CANINTE
    const uint8_t timing[] = {TIMING_3, TIMING_2, TIMING_1, RECEIVED_0 | RECEIVED_1 | ALL_SENT | ERROR};
    write(CNF3, timing, sizeof timing);
    write(RXB0CTRL, (const uint8_t[]){RECEIVE_ROLLOVER}, 1);
    write(CANCTRL, (const uint8_t[]){MODE_NORMAL}, 1);
}

bool can_bus_init(unsigned board_number) {
    connect_pins();
    init_spi();
    wait_us(RESET_US);
    instruct(INSTRUCTION_RESET);
    wait_us(RESET_US);
    uint8_t state[2];  // CANSTAT, CANCTRL
    read_two(CANSTAT, state);
    present = state[0] == MODE_CONFIGURATION && state[1] == CTRL_RESET;
    if (!present) {
        release_pins();
        return false;
    }
    configure(board_number);
    serves_left = SERVES_A_TURN;
    board_enable_can_interrupt();
    board_watch_can_interrupt();
    return true;
}

bool can_bus_receive(struct can_bus_frame* frame) {
    if (is_empty(&received)) return false;
    *frame = received.frames[received.read % CAN_BUS_RECEIVED_MAX];
    received.read++;
    return true;
}

bool can_bus_has_room(void) {
    return present && !is_full(&to_send);
}

bool can_bus_send(const struct can_bus_frame* frame) {
    if (!can_bus_has_room()) return false;
    to_send.frames[to_send.written % CAN_BUS_RECEIVED_MAX] = *frame;
    to_send.written++;
    board_raise_can_interrupt();
    return true;
}

bool can_bus_is_idle(void) {
    return is_empty(&to_send) && free_buffers == (1 << SEND_BUFFERS) - 1;
}

void can_bus_poll(uint64_t now_us) {
    const bool was_cut_short = present && serves_left == 0;
    serves_left = SERVES_A_TURN;
    if (was_cut_short) board_raise_can_interrupt();
    if (can_bus_is_idle() || frames_sent != progress_sent || give_up) {
        progress_sent = frames_sent;
        progress_us = now_us;
    } else if (now_us - progress_us > GIVE_UP_US) {
        give_up = true;
        board_raise_can_interrupt();
    }
}

bool can_bus_is_answered(void) {
    return present && !(health.controller_flags & (TRANSMIT_PASSIVE | BUS_OFF));
}

struct can_bus_health can_bus_health(void) {
    return (struct can_bus_health){health.frames_lost, health.bus_offs, health.controller_flags};
}
