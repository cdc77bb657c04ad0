// SPDX-License-Identifier: MIT
// USB: endpoint 0, two bulk endpoints, and nothing else (RP2040 datasheet 4.1; USB 2.0 chapter 9). Every control
// transfer here fits one packet, so endpoint 0 needs no state beyond the address that takes effect after its reply.
#include "usb.h"

#include <string.h>

#include "board.h"
#include "rp2040.h"

enum { ENDPOINT_OUT = 1, ENDPOINT_IN = 2, PACKET_BYTES = TRANSPORT_PACKET_BYTES };
enum { BUFFER_EP0 = 0x100, BUFFER_OUT = 0x180, BUFFER_IN = 0x1c0 };  // in the controller's memory (4.1.2.5)
enum {
    DONE_EP0_IN = 1 << 0,
    DONE_EP0_OUT = 1 << 1,
    DONE_OUT = 1 << (2 * ENDPOINT_OUT + 1),
    DONE_IN = 1 << 2 * ENDPOINT_IN
};

// The handler masks what has come up; usb_poll deals with it.
enum { INTERRUPTS = USB_INT_BUFF_STATUS | USB_INT_BUS_RESET | USB_INT_SUSPEND | USB_INT_SETUP_REQ };

// Requests of USB 2.0 9.4, as bRequest << 8 | bmRequestType.
enum {
    GET_STATUS_DEVICE = 0x0080,
    GET_STATUS_INTERFACE = 0x0081,
    GET_STATUS_ENDPOINT = 0x0082,
    CLEAR_FEATURE_ENDPOINT = 0x0102,
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

static bool configured, suspended;
static uint32_t attachments;
static uint8_t new_address;  // not zero: takes effect when the status stage is over
static bool out_toggle, in_toggle;
static size_t received_bytes;
static bool received;
static const uint8_t* sending;
static size_t sending_bytes;  // still to be handed to the controller
static bool in_busy, send_empty_packet;

static volatile uint8_t* buffer_at(uint32_t offset) {
    return (volatile uint8_t*)(USB_MEMORY + offset);
}

static void copy_words(volatile uint8_t* to, const uint8_t* from, size_t byte_count) {
    for (size_t i = 0; i < byte_count; i++) to[i] = from[i];
}

// The controller must see AVAILABLE a few cycles after the rest (datasheet 4.1.2.5.1).
static void give_buffer(volatile uint32_t* control, uint32_t value) {
    *control = value;
    for (int i = 0; i < 4; i++) __asm volatile("nop\nnop\nnop");
    *control = value | USB_BUFFER_AVAILABLE;
}

static void accept_packet(void) {
    give_buffer(&USB_BUFFER_CONTROL_OUT(ENDPOINT_OUT), (out_toggle ? USB_BUFFER_DATA1 : 0) | PACKET_BYTES);
    out_toggle = !out_toggle;
}

static void send_packet(void) {
    const size_t packet_bytes = sending_bytes < PACKET_BYTES ? sending_bytes : PACKET_BYTES;
    copy_words(buffer_at(BUFFER_IN), sending, packet_bytes);
    sending += packet_bytes;
    sending_bytes -= packet_bytes;
    // A message that ends with a full packet needs an empty one, or the host's read would wait for more.
    send_empty_packet = sending_bytes == 0 && packet_bytes == PACKET_BYTES;
    in_busy = true;
    give_buffer(&USB_BUFFER_CONTROL_IN(ENDPOINT_IN),
                USB_BUFFER_FULL | (in_toggle ? USB_BUFFER_DATA1 : 0) | (uint32_t)packet_bytes);
    in_toggle = !in_toggle;
}

static void reply_to_control(const uint8_t* bytes, size_t byte_count, size_t requested) {
    if (byte_count > requested) byte_count = requested;
    copy_words(buffer_at(BUFFER_EP0), bytes, byte_count);
    give_buffer(&USB_BUFFER_CONTROL_IN(0), USB_BUFFER_FULL | USB_BUFFER_LAST | USB_BUFFER_DATA1 | (uint32_t)byte_count);
}

static void acknowledge_control(void) {
    reply_to_control(0, 0, 0);
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
    in_busy = send_empty_packet = false;
    USB_BUFFER_CONTROL_OUT(ENDPOINT_OUT) = 0;
    USB_BUFFER_CONTROL_IN(ENDPOINT_IN) = 0;
}

static void set_configuration(uint16_t value) {
    reset_endpoints();
    configured = value == 1;
    if (!configured) return;
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

static void clear_halt(uint16_t endpoint) {
    // Restarts the data toggle (USB 2.0 9.4.5); these endpoints never halt, so that is all.
    if (endpoint == (0x80 | ENDPOINT_IN)) in_toggle = false;
    if (endpoint != ENDPOINT_OUT) return;
    out_toggle = false;
    if (configured && !received) accept_packet();  // else when the packet at hand has been taken
}

static void handle_setup(void) {
    struct setup setup;
    uint8_t bytes[8];
    for (size_t i = 0; i < sizeof bytes; i++) bytes[i] = buffer_at(0)[i];
    memcpy(&setup, bytes, sizeof setup);
    new_address = 0;
    switch (setup.request << 8 | setup.request_type) {
        case GET_DESCRIPTOR: return reply_with_descriptor(setup.value, setup.length);
        case SET_ADDRESS: new_address = setup.value & 0x7f; return acknowledge_control();
        case SET_CONFIGURATION: set_configuration(setup.value); return acknowledge_control();
        case GET_CONFIGURATION: return reply_to_control((const uint8_t[]){configured}, 1, setup.length);
        case GET_STATUS_DEVICE:
        case GET_STATUS_INTERFACE:
        case GET_STATUS_ENDPOINT: return reply_to_control((const uint8_t[]){0, 0}, 2, setup.length);
        case CLEAR_FEATURE_ENDPOINT: clear_halt(setup.index); return acknowledge_control();
        case SET_INTERFACE: return acknowledge_control();
        default: return stall_control();
    }
}

static void write_serial_number(void) {
    uint8_t id[8];
    board_read_id(id);
    for (size_t i = 0; i < 2 * sizeof id; i++)
        serial_number[i] = "0123456789abcdef"[id[i / 2] >> (i % 2 ? 0 : 4) & 0xf];
}

void usb_init(void) {
    write_serial_number();
    for (uint32_t offset = 0; offset < BUFFER_EP0; offset += 4) REGISTER(USB_MEMORY + offset) = 0;
    USB_MUXING = USB_MUXING_TO_PHY | USB_MUXING_SOFTCON;
    USB_PWR = USB_PWR_VBUS_DETECT | USB_PWR_VBUS_DETECT_OVERRIDE;  // the board is powered by the bus it talks to
    REGISTER(USB_SIE_CTRL) = USB_SIE_EP0_INT_1BUF;
    REGISTER(USB_INTE) = INTERRUPTS;
    USB_MAIN_CTRL = 1;  // controller on, as a device
    REGISTER_SET(USB_SIE_CTRL) = USB_SIE_PULLUP;
}

static void handle_done_buffers(void) {
    const uint32_t done = USB_BUFF_STATUS;
    USB_BUFF_STATUS_CLEAR = done;
    if (done & DONE_EP0_IN) {
        if (new_address) USB_ADDR_ENDP = new_address;
        new_address = 0;
        give_buffer(&USB_BUFFER_CONTROL_OUT(0), USB_BUFFER_DATA1);  // the status stage of a read
    }
    if (done & DONE_OUT) {
        received = true;
        received_bytes = USB_BUFFER_CONTROL_OUT(ENDPOINT_OUT) & USB_BUFFER_BYTES;
    }
    if (done & DONE_IN) {
        in_busy = false;
        if (sending_bytes > 0 || send_empty_packet) send_packet();
    }
}

void usb_poll(void) {
    const uint32_t status = USB_SIE_STATUS;
    // Before the reset, which ends a suspension; it takes the bus longer than a turn to be idle after one.
    if (status & (USB_SIE_SUSPENDED | USB_SIE_RESUME)) {
        USB_SIE_STATUS_CLEAR = status & (USB_SIE_SUSPENDED | USB_SIE_RESUME);
        suspended = !(status & USB_SIE_RESUME);
    }
    if (status & USB_SIE_BUS_RESET) {
        USB_SIE_STATUS_CLEAR = USB_SIE_BUS_RESET;
        USB_ADDR_ENDP = 0;
        configured = suspended = false;
        new_address = 0;
        reset_endpoints();
    }
    // Before setup packets: a finished SET_ADDRESS takes effect before what is asked next.
    if (USB_BUFF_STATUS) handle_done_buffers();
    if (status & USB_SIE_SETUP_REC) {
        USB_SIE_STATUS_CLEAR = USB_SIE_SETUP_REC;
        handle_setup();
    }
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
