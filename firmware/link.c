// SPDX-License-Identifier: MIT
// Link: frames from the transports, commands to the stage, replies back to where each request came from. A reply is built
// where it is sent from, and the same host's next request waits for that place.
#include "link.h"

#include <string.h>

#include "board.h"
#include "can.h"
#include "cycle_digest.h"
#include "frame.h"
#include "layout_hash.h"
#include "pulse.h"
#include "refusal.h"
#include "stage.h"
#include "trigger_log.h"
#include "usb.h"

struct link {
    uint32_t session;
    struct ols_frame_parser parser;
    uint8_t packet[TRANSPORT_PACKET_BYTES];  // received, and not yet in the parser from packet_used on
    size_t packet_bytes, packet_used;
    uint8_t reply_frame[OLS_FRAME_BYTES_MAX];
};

enum { USB_LINK, CAN_LINK, LINKS, NO_LINK = -1 };
static const struct transport* const transports[LINKS] = {[USB_LINK] = &usb_transport, [CAN_LINK] = &can_transport};
static struct link links[LINKS];
static int asking = NO_LINK;          // whose request takes several turns: the others wait
static volatile int owner = NO_LINK;  // who armed last

// A reply being made; without `ok` it is the error. `busy`: the request takes another turn of the main loop.
struct reply {
    bool ok, busy;
    size_t payload_bytes;
    union {
        struct ols_hello_reply hello;
        struct ols_status_reply status;
        struct {
            struct ols_trigger_log_reply header;
            struct ols_trigger_log_entry entries[OLS_LOG_ENTRIES_MAX];
        } __attribute__((packed)) log;
        struct {
            struct ols_digests_reply header;
            struct ols_cycle_digest digests[OLS_DIGESTS_MAX];
        } __attribute__((packed)) digests;
        struct ols_swap_reply swap;
        struct ols_error_reply error;
    } payload;
};

static void take_answer(enum stage_answer answer, struct reply* reply) {
    reply->ok = answer == STAGE_OK;
    reply->busy = answer == STAGE_BUSY;
}

static void answer_hello(const struct ols_frame* request, struct reply* reply) {
    (void)request;  // its hash is for boards that could speak more than one layout
    struct ols_hello_reply* const hello = &reply->payload.hello;
    *hello = (struct ols_hello_reply){.layout_hash = OLS_LAYOUT_HASH,
                                      .firmware_version = BOARD_FIRMWARE_VERSION,
                                      .boot_nonce = board_boot_nonce(),
                                      .tick_hz = BOARD_TICK_HZ,
                                      .capabilities = OLS_CAN_OFFSET_TRIGGERS | OLS_CAN_SWAP | OLS_CAN_START_BY_EDGE |
                                                      OLS_CAN_GREY | OLS_CAN_CYCLE_BY_EDGE | OLS_CAN_DIGEST |
                                                      (can_is_there() ? OLS_CAN_SPEAK_CAN : 0),
                                      .chain_bits = BOARD_CHAIN_BITS,
                                      .slots_max = OLS_SLOTS_MAX,
                                      .shift_ticks = slot_shift_ticks(&board_sequence),
                                      .slot_gap_ticks = slot_gap_ticks(),
                                      .lamps_lit_max = board_sequence.limits.lamps_lit_max,
                                      .lamp_duty_max_permille = board_sequence.limits.lamp_duty_max_permille,
                                      .edge_start_ticks = TIMELINE_EDGE_START_TICKS,
                                      .cycle_edge_ticks = RECEPTOR_DELAY_TICKS + TIMELINE_EDGE_START_TICKS,
                                      .board = BOARD_NAME};
    board_read_id(hello->board_id);
    reply->payload_bytes = sizeof *hello;
}

static void answer_load_begin(const struct ols_frame* request, struct reply* reply) {
    struct ols_load_begin begin;
    memcpy(&begin, request->payload, sizeof begin);
    reply->ok = stage_load_begin(&begin, &reply->payload.error);
}

static void answer_load_chunk(const struct ols_frame* request, struct reply* reply) {
    struct ols_load_chunk chunk;
    memcpy(&chunk, request->payload, sizeof chunk);
    reply->ok = stage_load_chunk(chunk.offset_bytes, request->payload + sizeof chunk,
                                 request->payload_bytes - sizeof chunk, &reply->payload.error);
}

static void answer_load_end(const struct ols_frame* request, struct reply* reply) {
    (void)request;
    take_answer(stage_load_end(&reply->payload.error), reply);
}

static void answer_arm(const struct ols_frame* request, struct reply* reply) {
    struct ols_arm arm;
    memcpy(&arm, request->payload, sizeof arm);
    take_answer(stage_arm(&arm, &reply->payload.error), reply);
}

static void answer_start(const struct ols_frame* request, struct reply* reply) {
    (void)request;
    reply->ok = stage_start(&reply->payload.error);
}

static void answer_stop(const struct ols_frame* request, struct reply* reply) {
    (void)request;
    reply->ok = stage_stop(&reply->payload.error);
}

static void answer_swap(const struct ols_frame* request, struct reply* reply) {
    (void)request;
    struct ols_swap_reply swap;
    take_answer(stage_swap(&swap, &reply->payload.error), reply);
    if (!reply->ok) return;
    reply->payload.swap = swap;
    reply->payload_bytes = sizeof swap;
}

static void answer_status(const struct ols_frame* request, struct reply* reply) {
    (void)request;
    stage_status(&reply->payload.status);
    reply->payload_bytes = sizeof reply->payload.status;
}

static void answer_read_trigger_log(const struct ols_frame* request, struct reply* reply) {
    struct ols_read_trigger_log read;
    memcpy(&read, request->payload, sizeof read);
    const uint16_t entries_max = read.entries_max < OLS_LOG_ENTRIES_MAX ? read.entries_max : OLS_LOG_ENTRIES_MAX;
    trigger_log_read(read.first_counter, entries_max, &reply->payload.log.header, reply->payload.log.entries);
    reply->payload_bytes =
        sizeof reply->payload.log.header + reply->payload.log.header.entry_count * sizeof *reply->payload.log.entries;
}

static void answer_read_digests(const struct ols_frame* request, struct reply* reply) {
    struct ols_read_digests read;
    memcpy(&read, request->payload, sizeof read);
    const uint16_t digests_max = read.digests_max < OLS_DIGESTS_MAX ? read.digests_max : OLS_DIGESTS_MAX;
    struct ols_digests_reply* const header = &reply->payload.digests.header;
    cycle_digest_read(read.first_digest, digests_max, header, reply->payload.digests.digests);
    reply->payload_bytes = sizeof *header + header->digest_count * sizeof *reply->payload.digests.digests;
}

static void answer_clear_fault(const struct ols_frame* request, struct reply* reply) {
    (void)request;
    reply->ok = stage_clear_fault(&reply->payload.error);
}

static void answer_reboot_to_bootloader(const struct ols_frame* request, struct reply* reply) {
    (void)request;
    reply->ok = stage_leave(&reply->payload.error);
}

// What only the host that armed may do, while the board is armed or plays.
enum { ANYBODYS, OWNERS };

static const struct command {
    uint16_t type;
    uint16_t payload_bytes_min, payload_bytes_max;
    uint8_t whose;
    void (*answer)(const struct ols_frame* request, struct reply* reply);
} commands[] = {
    {OLS_HELLO, sizeof(struct ols_hello), OLS_PAYLOAD_BYTES_MAX, ANYBODYS, answer_hello},  // longer: a later version's
    {OLS_LOAD_BEGIN, sizeof(struct ols_load_begin), sizeof(struct ols_load_begin), OWNERS, answer_load_begin},
    {OLS_LOAD_CHUNK, sizeof(struct ols_load_chunk), OLS_PAYLOAD_BYTES_MAX, OWNERS, answer_load_chunk},
    {OLS_LOAD_END, 0, 0, OWNERS, answer_load_end},
    {OLS_ARM, sizeof(struct ols_arm), sizeof(struct ols_arm), OWNERS, answer_arm},
    {OLS_START, 0, 0, OWNERS, answer_start},
    {OLS_STOP, 0, 0, ANYBODYS, answer_stop},
    {OLS_STATUS, 0, 0, ANYBODYS, answer_status},
    {OLS_READ_TRIGGER_LOG, sizeof(struct ols_read_trigger_log), sizeof(struct ols_read_trigger_log), ANYBODYS,
     answer_read_trigger_log},
    {OLS_CLEAR_FAULT, 0, 0, ANYBODYS, answer_clear_fault},
    {OLS_SWAP, 0, 0, OWNERS, answer_swap},
    {OLS_READ_DIGESTS, sizeof(struct ols_read_digests), sizeof(struct ols_read_digests), ANYBODYS, answer_read_digests},
    {OLS_REBOOT_TO_BOOTLOADER, 0, 0, ANYBODYS, answer_reboot_to_bootloader},
};

static void refuse_request(struct reply* reply, enum ols_error_code code, const char* reason) {
    reply->ok = refuse(&reply->payload.error, code, reason);
}

static void answer(int n, const struct ols_frame* request, struct reply* reply) {
    for (size_t i = 0; i < sizeof commands / sizeof *commands; i++) {
        const struct command* const command = &commands[i];
        if (command->type != request->type) continue;
        if (request->payload_bytes < command->payload_bytes_min || request->payload_bytes > command->payload_bytes_max)
            return refuse_request(reply, OLS_ERROR_BAD_LENGTH,
                                  "the message's length is wrong: host and board do not match");
        if (command->whose == OWNERS && n != owner && stage_is_armed())
            return refuse_request(reply, OLS_ERROR_BAD_STATE,
                                  "another host has armed the board: stop first, or ask that host");
        return command->answer(request, reply);
    }
    refuse_request(reply, OLS_ERROR_UNKNOWN_MESSAGE, "unknown message: update the firmware with `make flash`");
}

// True when the request has been answered.
static bool handle(int n, const struct ols_frame* request) {
    static struct reply reply;  // too big for the stack of 4 KB to be careless with
    memset(&reply, 0, sizeof reply);
    reply.ok = true;
    answer(n, request, &reply);
    if (reply.busy) return false;
    if (reply.ok && request->type == OLS_ARM) owner = n;
    const uint16_t type = (reply.ok ? request->type : OLS_ERROR) | OLS_REPLY;
    const size_t payload_bytes = reply.ok ? reply.payload_bytes : sizeof reply.payload.error;
    uint8_t* const frame = links[n].reply_frame;
    transports[n]->send(frame, ols_frame_encode(type, request->request_id, &reply.payload, payload_bytes, frame,
                                                sizeof links[n].reply_frame));
    return true;
}

static void begin_session(int n) {
    links[n] = (struct link){.session = transports[n]->session()};
    if (asking == n) asking = NO_LINK;
}

// Moves what has come in to the parser; false when there is nothing.
static bool take_packet(int n) {
    struct link* const link = &links[n];
    if (link->packet_used == link->packet_bytes) {
        link->packet_used = 0;
        link->packet_bytes = transports[n]->receive(link->packet);
        if (link->packet_bytes == 0) return false;
    }
    link->packet_used +=
        ols_frame_parser_write(&link->parser, link->packet + link->packet_used, link->packet_bytes - link->packet_used);
    return true;
}

static void poll_link(int n) {
    static struct ols_frame request;  // of the link that is asking
    if (links[n].session != transports[n]->session()) begin_session(n);
    if (asking != NO_LINK && asking != n) return;
    while (!stage_is_leaving() && transports[n]->can_send()) {
        if (asking == n || ols_frame_parser_read(&links[n].parser, &request)) {
            if (asking != n) stage_begin_request(owner == n);
            asking = handle(n, &request) ? NO_LINK : n;
            if (asking == n) return;
        } else if (!take_packet(n)) {
            return;
        }
    }
}

bool link_poll(void) {
    for (int n = 0; n < LINKS; n++) poll_link(n);
    return asking != NO_LINK;
}

bool link_usb_has_armed(void) {
    return owner == USB_LINK;
}

bool link_host_is_there(void) {
    return owner == NO_LINK || transports[owner]->is_attached();
}

bool link_is_leaving(void) {
    for (int n = 0; n < LINKS; n++)
        if (transports[n]->is_attached() && !transports[n]->can_send()) return false;
    return stage_is_leaving() && can_is_idle();
}
