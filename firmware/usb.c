// SPDX-License-Identifier: MIT
// USB: endpoint 0, two bulk endpoints, and nothing else (RP2040 datasheet 4.1; USB 2.0 chapter 9). Every control
// transfer here fits one packet, so endpoint 0 needs no state beyond what is due after its reply.
#include "usb.h"

#include <string.h>

#include "board.h"
#include "board_rp2040.h"
#include "rp2040.h"
#include "usb_buffer.h"
#include "usb_line.h"
#include "usb_watch.h"

enum { ENDPOINT_OUT = 1, ENDPOINT_IN = 2, PACKET_BYTES = TRANSPORT_PACKET_BYTES };
enum { BUFFER_EP0 = 0x100, BUFFER_OUT = 0x180, BUFFER_IN = 0x1c0 };  // in the controller's memory (4.1.2.5)
enum { BULK_OUT = USB_OUT(ENDPOINT_OUT), BULK_IN = USB_IN(ENDPOINT_IN) };

// The handler masks what has come up; usb_poll deals with it.
enum { INTERRUPTS = USB_INT_BUFF_STATUS | USB_INT_BUS_RESET | USB_INT_SUSPEND | USB_INT_SETUP_REQ | USB_INT_SOF };

enum {
    // Erratum RP2040-E15: a bus error at the end of a frame can lock the controller up in a bulk IN, so none is handed to it
    // later than 800 us after a start of frame, less some for the timer's steps.
    FRAME_SAFE_US = 800 - 10,
    DETACHED_US = 100000  // a hub debounces a connection for as long (USB 2.0 7.1.7.3), and so surely saw it end
};

// Requests of USB 2.0 9.4, as bRequest << 8 | bmRequestType.
enum {
    GET_STATUS_DEVICE = 0x0080,
    GET_STATUS_INTERFACE = 0x0081,
    GET_STATUS_ENDPOINT = 0x0082,
    CLEAR_FEATURE_ENDPOINT = 0x0102,
    GET_INTERFACE = 0x0a81,
    SET_ADDRESS = 0x0500,
    GET_DESCRIPTOR = 0x0680,
    GET_CONFIGURATION = 0x0880,
    SET_CONFIGURATION = 0x0900,
    SET_INTERFACE = 0x0b01
};
enum { DESCRIPTOR_DEVICE = 1, DESCRIPTOR_CONFIGURATION = 2, DESCRIPTOR_STRING = 3 };

struct setup {
    uint8_t request_type, request;
    uint16_t value, index, length;
};

// USB 2.0 9.6. Vendor and product are pid.codes' pair for development; a product needs its own.
static const uint8_t device_descriptor[] = {
    18, DESCRIPTOR_DEVICE, 0x00, 0x02, 0xff, 0, 0, PACKET_BYTES, 0x09, 0x12, 0x01, 0x00, 0x00, 0x01, 1, 2, 3, 1};
static const uint8_t configuration_descriptor[] = {
    9,
    DESCRIPTOR_CONFIGURATION,
    32,
    0,
    1,
    1,
    0,
    0x80,
    50,  // bus powered, 100 mA
    9,
    4,
    0,
    0,
    2,
    0xff,
    0,
    0,
    0,  // one vendor interface
    7,
    5,
    ENDPOINT_OUT,
    2,
    PACKET_BYTES,
    0,
    0,  // bulk OUT
    7,
    5,
    0x80 | ENDPOINT_IN,
    2,
    PACKET_BYTES,
    0,
    0,  // bulk IN
};
static const uint8_t language_descriptor[] = {4, DESCRIPTOR_STRING, 0x09, 0x04};
static char serial_number[2 * 8 + 1];  // the flash chip's unique number, in hex
static const char* const strings[] = {"open light stage", "light stage sequencer", serial_number};

static bool attached, configured, suspended;
static uint32_t attachments, detached_us;
static uint32_t frame_us;  // the last start of frame came then, or later

static uint8_t new_address;     // not zero: takes effect when the status stage is over
static bool status_out_is_due;  // once the host has fetched the reply
static bool out_toggle, in_toggle;
static size_t received_bytes;
static bool received;
static const uint8_t* sending;
static size_t sending_bytes;  // still to be handed to the controller
static uint32_t in_packet_bytes;
static bool in_busy, in_waits;  // there is a packet to fetch; it waits for the next frame
static bool send_empty_packet;

static volatile uint8_t* buffer_at(uint32_t offset) {
    return (volatile uint8_t*)(USB_MEMORY + offset);
}

static void copy_words(volatile uint8_t* to, const uint8_t* from, size_t byte_count) {
    for (size_t i = 0; i < byte_count; i++) to[i] = from[i];
}

static void accept_packet(void) {
    usb_buffer_give(BULK_OUT, (out_toggle ? USB_BUFFER_DATA1 : 0) | PACKET_BYTES);
    out_toggle = !out_toggle;
}

// The packet in the buffer may be fetched, at once or from the next frame on.
static void offer_packet(void) {
    const uint32_t fields = USB_BUFFER_FULL | (in_toggle ? USB_BUFFER_DATA1 : 0) | in_packet_bytes;
    const uint32_t held = board_hold_interrupts();  // or it might be late by a handler
    in_waits = TIMER_RAW_LOW - frame_us >= FRAME_SAFE_US;
    if (!in_waits) usb_buffer_give(BULK_IN, fields);
    board_release_interrupts(held);
    if (!in_waits) in_toggle = !in_toggle;
}

static void send_packet(void) {
    const size_t packet_bytes = sending_bytes < PACKET_BYTES ? sending_bytes : PACKET_BYTES;
    copy_words(buffer_at(BUFFER_IN), sending, packet_bytes);
    sending += packet_bytes;
    sending_bytes -= packet_bytes;
    // A message that ends with a full packet needs an empty one, or the host's read would wait for more.
    send_empty_packet = sending_bytes == 0 && packet_bytes == PACKET_BYTES;
    in_packet_bytes = packet_bytes;
    in_busy = true;
    offer_packet();
}

static void reply_to_control(const uint8_t* bytes, size_t byte_count, size_t requested) {
    if (byte_count > requested) byte_count = requested;
    copy_words(buffer_at(BUFFER_EP0), bytes, byte_count);
    status_out_is_due = requested > 0;
    usb_buffer_give(USB_IN(0), USB_BUFFER_FULL | USB_BUFFER_DATA1 | (uint32_t)byte_count);
}

static void acknowledge_control(void) {
    reply_to_control(0, 0, 0);
}

// What was left of an earlier control transfer: the host may give one up at any time by a new setup packet (USB 2.0 8.5.3),
// and the controller keeps the buffers as they were.
static void forget_control(void) {
    usb_buffer_revoke(USB_IN(0));
    usb_buffer_revoke(USB_OUT(0));
    USB_BUFF_STATUS_CLEAR = 1u << USB_IN(0) | 1u << USB_OUT(0);
    new_address = 0;
    status_out_is_due = false;
}

static void stall_control(void) {
    USB_EP_STALL_ARM = 3;  // both directions of endpoint 0, until the next setup packet (4.1.2.6.3)
    USB_BUFFER_CONTROL_IN(0) = USB_BUFFER_STALL;
    USB_BUFFER_CONTROL_OUT(0) = USB_BUFFER_STALL;
}

static void reset_endpoints(void) {
    out_toggle = in_toggle = false;
    received = false;
    received_bytes = sending_bytes = 0;
    in_busy = in_waits = send_empty_packet = false;
    usb_buffer_revoke(BULK_OUT);
    usb_buffer_revoke(BULK_IN);
    USB_BUFF_STATUS_CLEAR = 1u << BULK_OUT | 1u << BULK_IN;
    USB_ENDPOINT_CONTROL_OUT(ENDPOINT_OUT) = 0;
    USB_ENDPOINT_CONTROL_IN(ENDPOINT_IN) = 0;
    configured = false;
}

static void set_configuration(uint16_t value) {
    if (value > 1) return stall_control();
    reset_endpoints();
    acknowledge_control();
    if (value == 0) return;
    configured = true;
    attachments++;
    USB_ENDPOINT_CONTROL_OUT(ENDPOINT_OUT) =
        USB_ENDPOINT_ENABLE | USB_ENDPOINT_INTERRUPT | USB_ENDPOINT_BULK | BUFFER_OUT;
    USB_ENDPOINT_CONTROL_IN(ENDPOINT_IN) = USB_ENDPOINT_ENABLE | USB_ENDPOINT_INTERRUPT | USB_ENDPOINT_BULK | BUFFER_IN;
    accept_packet();
}

static void reply_with_string(uint8_t index, uint16_t requested) {
    if (index == 0) return reply_to_control(language_descriptor, sizeof language_descriptor, requested);
    if (index > sizeof strings / sizeof *strings) return stall_control();
    uint8_t descriptor[PACKET_BYTES] = {0, DESCRIPTOR_STRING};
    uint8_t bytes = 2;
    for (const char* c = strings[index - 1]; *c; c++, bytes += 2) descriptor[bytes] = (uint8_t)*c;
    descriptor[0] = bytes;
    reply_to_control(descriptor, bytes, requested);
}

static void reply_with_descriptor(uint16_t value, uint16_t requested) {
    switch (value >> 8) {
        case DESCRIPTOR_DEVICE: return reply_to_control(device_descriptor, sizeof device_descriptor, requested);
        case DESCRIPTOR_CONFIGURATION:
            return reply_to_control(configuration_descriptor, sizeof configuration_descriptor, requested);
        case DESCRIPTOR_STRING: return reply_with_string((uint8_t)value, requested);
        default: return stall_control();
    }
}

// Restarts of data toggles (USB 2.0 9.1.1.5, 9.4.5). A packet that the host has yet to fetch is fetched with the new toggle.
static void restart_in(void) {
    const bool was_offered = in_busy && !in_waits;
    if (was_offered && !usb_buffer_revoke(BULK_IN)) return (void)(in_toggle = false);  // it has just been fetched
    in_toggle = false;
    if (was_offered) offer_packet();
}

static void restart_out(void) {
    out_toggle = false;
    // Otherwise a packet is at hand, and the next one is accepted when that one has been taken.
    if (!received && !(USB_BUFF_STATUS & 1u << BULK_OUT) && usb_buffer_revoke(BULK_OUT)) accept_packet();
}

static void clear_halt(uint16_t endpoint) {
    if (configured && endpoint == (0x80 | ENDPOINT_IN)) restart_in();
    if (configured && endpoint == ENDPOINT_OUT) restart_out();
    acknowledge_control();  // these endpoints never halt, so that is all
}

// The one interface has one setting (USB 2.0 9.4.10).
static void set_interface(uint16_t interface, uint16_t setting) {
    if (!configured || interface != 0 || setting != 0) return stall_control();
    restart_in();
    restart_out();
    acknowledge_control();
}

static void handle_setup(void) {
    struct setup setup;
    uint8_t bytes[8];
    for (size_t i = 0; i < sizeof bytes; i++) bytes[i] = buffer_at(0)[i];
    memcpy(&setup, bytes, sizeof setup);
    forget_control();
    switch (setup.request << 8 | setup.request_type) {
        case GET_DESCRIPTOR: return reply_with_descriptor(setup.value, setup.length);
        case SET_ADDRESS: new_address = setup.value & 0x7f; return acknowledge_control();
        case SET_CONFIGURATION: return set_configuration(setup.value);
        case GET_CONFIGURATION: return reply_to_control((const uint8_t[]){configured}, 1, setup.length);
        case GET_STATUS_DEVICE:
        case GET_STATUS_INTERFACE:
        case GET_STATUS_ENDPOINT: return reply_to_control((const uint8_t[]){0, 0}, 2, setup.length);
        case CLEAR_FEATURE_ENDPOINT: return clear_halt(setup.index);
        case SET_INTERFACE: return set_interface(setup.index, setup.value);
        case GET_INTERFACE: return reply_to_control((const uint8_t[]){0}, 1, setup.length);
        default: return stall_control();
    }
}

static void write_serial_number(void) {
    uint8_t id[8];
    board_read_id(id);
    for (size_t i = 0; i < 2 * sizeof id; i++)
        serial_number[i] = "0123456789abcdef"[id[i / 2] >> (i % 2 ? 0 : 4) & 0xf];
}

// Needs the controller as a reset leaves it (RESETS): every register at its reset value, no pull-up.
static void attach(void) {
    usb_buffer_clear_all();
    USB_MUXING = USB_MUXING_TO_PHY | USB_MUXING_SOFTCON;
    USB_PWR = USB_PWR_VBUS_DETECT | USB_PWR_VBUS_DETECT_OVERRIDE;  // the board is powered by the bus it talks to
    REGISTER(USB_SIE_CTRL) = USB_SIE_EP0_INT_1BUF;
    REGISTER(USB_INTE) = INTERRUPTS;
    USB_MAIN_CTRL = 1;  // controller on, as a device
    REGISTER_SET(USB_SIE_CTRL) = USB_SIE_PULLUP;
    attached = true;
}

// Leaves the bus with a controller that is as new, for DETACHED_US.
static void detach(uint32_t now_us) {
    usb_line_release();
    reset_blocks(RESET_USBCTRL);
    usb_buffer_clear_all();  // whatever it was about to do
    usb_watch_begin();
    reset_endpoints();
    forget_control();
    suspended = attached = false;
    detached_us = now_us;
}

void usb_init(void) {
    write_serial_number();
    attach();
}

static void handle_done_buffers(void) {
    const uint32_t done = USB_BUFF_STATUS;
    if (done == 0) return;
    USB_BUFF_STATUS_CLEAR = done;
    usb_watch_answered();
    if (done & 1u << USB_IN(0)) {
        if (new_address) USB_ADDR_ENDP = new_address;
        new_address = 0;
        if (status_out_is_due) usb_buffer_give(USB_OUT(0), USB_BUFFER_DATA1);
        status_out_is_due = false;
    }
    if (done & 1u << BULK_OUT) {
        received = true;
        received_bytes = USB_BUFFER_CONTROL_OUT(ENDPOINT_OUT) & USB_BUFFER_BYTES;
    }
    if (done & 1u << BULK_IN) {
        in_busy = false;
        if (sending_bytes > 0 || send_empty_packet) send_packet();
    }
}

// USB 2.0 7.1.7.5, 9.1.1: back to address 0, nothing configured. The controller leaves all of it to the program, and what it
// reports from before the reset no longer counts.
static void handle_bus_reset(uint32_t now_us) {
    USB_SIE_STATUS_CLEAR = USB_SIE_BUS_RESET | USB_SIE_SETUP_REC | USB_SIE_ERRORS;
    USB_ADDR_ENDP = 0;
    USB_EP_STALL_ARM = 0;
    reset_endpoints();
    forget_control();
    usb_line_reset();
    usb_watch_reset(now_us);
}

// A start of frame that has come since the last turn ends a sleep, so it came when the processor was awake: as long ago as
// that was at most.
static void note_frame(uint32_t now_us) {
    static uint32_t before_us, slept_before_us;
    const uint32_t slept_us = board_slept_us();
    const uint32_t awake_us = now_us - before_us - (slept_us - slept_before_us);
    before_us = now_us;
    slept_before_us = slept_us;
    if (!(USB_INTR & USB_INT_SOF)) return;
    (void)USB_SOF_RD;
    frame_us = now_us - awake_us;
}

static void handle_errors(uint32_t errors, uint32_t now_us) {
    if (errors == 0) return;
    USB_SIE_STATUS_CLEAR = errors;
    if (in_busy && !in_waits) usb_watch_error(now_us);
}

static void poll_attached(uint32_t now_us, bool nothing_is_armed) {
    note_frame(now_us);
    // The suspend state has changed, either way (4.1.4, INTR): cleared first, so that no later change is missed.
    if (USB_INTR & USB_INT_SUSPEND) USB_SIE_STATUS_CLEAR = USB_SIE_SUSPENDED;
    const uint32_t status = USB_SIE_STATUS;
    suspended = status & USB_SIE_SUSPENDED;
    handle_errors(status & USB_SIE_ERRORS, now_us);
    if (status & USB_SIE_BUS_RESET) handle_bus_reset(now_us);
    usb_line_poll(status, now_us, nothing_is_armed);
    // Before setup packets: a finished SET_ADDRESS takes effect before what is asked next.
    handle_done_buffers();
    if (status & USB_SIE_SETUP_REC && !(status & USB_SIE_BUS_RESET)) {
        USB_SIE_STATUS_CLEAR = USB_SIE_SETUP_REC;
        usb_watch_answered();
        handle_setup();
    }
    if (in_waits) offer_packet();
}

void usb_poll(bool nothing_is_armed) {
    const uint32_t now_us = TIMER_RAW_LOW;
    if (!attached) {
        if (now_us - detached_us >= DETACHED_US) attach();
        return;
    }
    poll_attached(now_us, nothing_is_armed);
    const bool unheard = usb_line_is_in_doubt() && nothing_is_armed;
    if (unheard || usb_watch_is_locked_up(now_us)) return detach(now_us);
    REGISTER_SET(USB_INTE) = INTERRUPTS;
}

static bool is_attached(void) {
    return configured && !suspended;
}

static uint32_t session(void) {
    return attachments;
}

static size_t receive(uint8_t* bytes) {
    if (!received) return 0;
    for (size_t i = 0; i < received_bytes; i++) bytes[i] = buffer_at(BUFFER_OUT)[i];
    received = false;
    const size_t byte_count = received_bytes;
    accept_packet();
    return byte_count;
}

static bool can_send(void) {
    return configured && !in_busy && sending_bytes == 0;
}

static void send(const uint8_t* bytes, size_t byte_count) {
    sending = bytes;
    sending_bytes = byte_count;
    send_packet();
}

const struct transport usb_transport = {is_attached, session, receive, can_send, send};
