// SPDX-License-Identifier: MIT
// Every message between a host and the board, byte for byte: packed little-endian C structs for both sides.
// PROTOCOL.md draws them; layout_hash.py hashes their layout, so a change here makes old and new refuse each other.
#ifndef OLS_WIRE_H
#define OLS_WIRE_H

#include <stdint.h>

#ifdef __cplusplus
#define OLS_WIRE_ASSERT static_assert
#else
#define OLS_WIRE_ASSERT _Static_assert
#endif
// The attribute and not the pragma: with it, the compiler refuses references to members that may be misaligned.
#define OLS_PACKED __attribute__((packed))
// For what the board keeps in memory as it came: whole words, which it may then read as words.
#define OLS_PACKED_WORDS __attribute__((packed, aligned(4)))

OLS_WIRE_ASSERT(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "the wire is little-endian, and so must be its users");

#define OLS_FRAME_SYNC 0x534c       // bytes 4c 53, "LS"
#define OLS_PAYLOAD_BYTES_MAX 1024  // of one frame
#define OLS_SLOTS_MAX 1024          // of one program
#define OLS_TRIGGERS 4              // TRIG0 to TRIG3
#define OLS_PLANES_MAX 8            // of a grey slot
#define OLS_CYCLES_MAX 524288       // of one program, when counted
#define OLS_CHAIN_BITS_MAX 256      // 8 words: a whole pattern must fit the shifter's FIFO (RP2040 datasheet 3.5.4)
#define OLS_LOG_ENTRIES_MAX 48      // of one reply
#define OLS_DIGESTS_MAX 31          // of one reply
#define OLS_NO_SLOT 0xffff          // where no slot is to blame
#define OLS_REPLY 0x80              // a reply's type is its request's with this bit

// A frame is this header, `payload_bytes` of payload and the CRC-32 (u32) of both. `header_check` is the low half of
// the CRC-32 of the eight bytes before it: a corrupt length is noticed at once, not after waiting for bytes that never
// come.
struct ols_frame_header {
    uint16_t sync;
    uint16_t payload_bytes;
    uint16_t type;        // enum ols_message
    uint16_t request_id;  // chosen by the host, returned in the reply
    uint16_t header_check;
} OLS_PACKED;

// Requests. Without a struct below, a request or reply has no payload.
enum ols_message {
    OLS_HELLO = 0x01,                 // -> ols_hello_reply, in any state
    OLS_LOAD_BEGIN = 0x02,            // ols_load_begin; not while armed; while playing, the next program is loaded
    OLS_LOAD_CHUNK = 0x03,            // ols_load_chunk and data; chunks in order, without gaps
    OLS_LOAD_END = 0x04,              // checks CRC and program -> state loaded, or next ready
    OLS_ARM = 0x05,                   // ols_arm; loaded or done -> armed: first pattern shifted, everything ready
    OLS_START = 0x06,                 // armed -> playing, or waiting for the edge on GENLOCK that starts
    OLS_STOP = 0x07,                  // armed, playing or done -> loaded, dark at once
    OLS_STATUS = 0x08,                // -> ols_status_reply, in any state
    OLS_READ_TRIGGER_LOG = 0x09,      // ols_read_trigger_log -> ols_trigger_log_reply and entries, in any state
    OLS_CLEAR_FAULT = 0x0a,           // fault -> idle; the program must be loaded again
    OLS_SWAP = 0x0b,                  // playing with a next program ready -> ols_swap_reply; goes on with that
    OLS_READ_DIGESTS = 0x0c,          // ols_read_digests -> ols_digests_reply and digests, in any state
    OLS_REBOOT_TO_BOOTLOADER = 0x0d,  // not while armed or playing; the board leaves after the reply, to be flashed
    OLS_ERROR = 0x7f                  // only as reply, OLS_ERROR | OLS_REPLY: ols_error_reply
};

// The first eight bytes of both structs never change, whatever else does, so that any two versions can compare hashes.
struct ols_hello {
    uint64_t layout_hash;
} OLS_PACKED;

enum ols_capability {
    OLS_CAN_OFFSET_TRIGGERS = 1,  // triggers may have offsets, widths and polarities of their own
    OLS_CAN_START_BY_EDGE = 4,    // of GENLOCK
    OLS_CAN_GREY = 8,             // slots may have planes
    OLS_CAN_SWAP = 2,             // the next program can be loaded while one plays
    OLS_CAN_CYCLE_BY_EDGE = 16,   // each cycle can wait for a debounced edge of GENLOCK, such as a photo-receptor's
    OLS_CAN_SPEAK_CAN = 32,       // a CAN controller was found at start
    OLS_CAN_DIGEST = 64           // keeps a digest of each cycle
};

struct ols_hello_reply {
    uint64_t layout_hash;
    char firmware_version[24];  // zero-terminated
    uint8_t board_id[8];        // the flash chip's unique number
    uint32_t boot_nonce;        // differs after each reset
    uint32_t tick_hz;
    uint32_t capabilities;  // enum ols_capability bits
    uint16_t chain_bits;    // of this board's shift chain
    uint16_t slots_max;
    uint32_t shift_ticks;             // to send one pattern
    uint32_t slot_gap_ticks;          // period_ticks - exposure_ticks must be at least this
    uint16_t lamps_lit_max;           // chain bits that a pattern may light at once: the supply's current
    uint16_t lamp_duty_max_permille;  // of a cycle that any lamp may be lit
    uint32_t edge_start_ticks;        // from the rise of GENLOCK to the begin of the first cycle
    uint32_t cycle_edge_ticks;        // and debounce_ticks: from a rise of GENLOCK to the begin of the cycle it starts
    char board[16];                   // whose pins this firmware drives, zero-terminated: "pico", "feather_can"
} OLS_PACKED;

// One camera trigger. All zero: fires with the light, as long as the exposure, in every slot that asks for it.
struct ols_trigger {
    int32_t offset_ticks;  // of its rise, added to each slot's own; before the light when negative
    uint32_t width_ticks;  // 0: from the slot's first light to its last
    uint8_t skip_kinds;    // bit k: does not fire in slots of kind k
    uint8_t active_low;    // 1: the pin idles high and is low while the camera is to expose
    uint16_t reserved;     // 0
} OLS_PACKED_WORDS;

// The program follows in chunks: slot_count times an ols_slot, then the patterns of all slots in the same order,
// ceil(chain_bits / 32) words each; those of a grey slot from the most significant plane to the least.
struct ols_load_begin {
    uint16_t slot_count;  // 1..OLS_SLOTS_MAX
    uint16_t chain_bits;  // must be the board's
    uint32_t cycles;      // OLS_CYCLES_MAX at most, 0: until stopped
    uint32_t program_bytes;
    uint32_t program_crc32;
    uint32_t lead_ticks;  // dark before a cycle's first latch, taken from its last slot: room for early triggers
    struct ols_trigger triggers[4];  // OLS_TRIGGERS
} OLS_PACKED_WORDS;

struct ols_load_chunk {
    uint32_t offset_bytes;  // of the data that follow, in the program
} OLS_PACKED;

enum ols_slot_kind {
    OLS_BASIS = 0,
    OLS_TRACKING = 1,
    OLS_MATTE = 2,
    OLS_DARK = 3  // triggers the cameras, lights nothing; its pattern is all zero
};

// Chain bit b is words[b / 32] >> (31 - b % 32) & 1; bits past the chain's end are zero.
struct ols_slot {
    uint8_t kind;                  // enum ols_slot_kind
    uint8_t trigger_mask;          // bit n: TRIGn
    uint8_t planes;                // bits of a lamp's level, 2 to 8, one pattern each; 0 or 1: on/off, one pattern
    uint8_t reserved;              // 0
    uint32_t exposure_ticks;       // of a lamp at its highest level; a multiple of 2^planes - 1
    uint32_t period_ticks;         // from this slot's light to the next slot's
    int32_t trigger_offset_ticks;  // from the light to the triggers, before it when negative
} OLS_PACKED_WORDS;

#define OLS_HEARTBEAT_TICKS_MIN 625000  // 5 ms: the board looks every millisecond or two
#define OLS_DEBOUNCE_TICKS_MIN 4

enum ols_start_source {
    OLS_START_BY_COMMAND = 0,
    OLS_START_BY_EDGE = 1,            // the first rise of GENLOCK after OLS_START
    OLS_START_EACH_CYCLE_BY_EDGE = 2  // each cycle by a debounced rise of GENLOCK, from a photo-receptor for example
};

struct ols_arm {
    uint32_t heartbeat_ticks;  // without a message for longer than this, armed or playing, is a fault; 0: never
    uint8_t start_source;      // enum ols_start_source
    uint8_t reserved[3];       // 0
    uint32_t
        debounce_ticks;  // for which GENLOCK must stay high or low to be so, even; 0 unless each cycle is started by it
} OLS_PACKED;

enum ols_state {
    OLS_STATE_IDLE = 0,  // no program
    OLS_STATE_LOADED = 1,
    OLS_STATE_ARMED = 2,
    OLS_STATE_PLAYING = 3,
    OLS_STATE_DONE = 4,    // all cycles played; the program is still there
    OLS_STATE_FAULT = 5,   // dark until OLS_CLEAR_FAULT
    OLS_STATE_WAITING = 6  // for the edge that starts
};

// The program that is to follow the playing one.
enum ols_next {
    OLS_NEXT_NONE = 0,
    OLS_NEXT_LOADING = 1,
    OLS_NEXT_READY = 2,    // OLS_SWAP makes it follow; so does the next arm, when play has ended
    OLS_NEXT_SWAPPING = 3  // it will follow at the end of a cycle; nothing can be loaded until then
};

// Program and cycle at which a swap takes place.
struct ols_swap_reply {
    uint32_t after_cycles;  // of the playing program, since it began
    uint8_t program;        // number of the new one in log entries: programs swapped in since start, modulo 256
    uint8_t reserved[3];
} OLS_PACKED;

enum ols_fault {
    OLS_FAULT_NONE = 0,
    OLS_FAULT_TIMELINE_STARVED = 1,  // the next event was not there in time
    OLS_FAULT_SHIFTER_STARVED = 2,   // the next pattern was not there in time
    OLS_FAULT_SLIPPED = 3,           // a measured trigger was not at its scheduled tick
    OLS_FAULT_HOST_LOST = 4,         // the bus was reset, suspended or unplugged while armed or playing
    OLS_FAULT_WATCHDOG = 5,          // the processor hung and was reset
    OLS_FAULT_PROCESSOR = 6,         // hard fault or unexpected interrupt
    OLS_FAULT_BAD_MEMORY = 7,        // the program in memory no longer has its CRC
    OLS_FAULT_EMERGENCY_STOP = 8,    // the emergency stop was pressed, or its wire is open
    OLS_FAULT_OVER_TEMPERATURE = 9,  // said a lamp driver
    OLS_FAULT_OPEN_LAMP = 10,        // said a lamp driver
    OLS_FAULT_HEARTBEAT = 11,        // no message from the host for the time chosen when arming
    OLS_FAULT_OVER_DUTY = 12,        // a light was longer, measured at the pin, than any of the program's
    OLS_FAULT_LIGHT_STUCK = 13       // the light's pin was lit while nothing may be: cleared only when it is dark again
};

struct ols_status_reply {
    uint8_t state;        // enum ols_state
    uint8_t fault;        // enum ols_fault
    uint16_t fault_slot;  // or OLS_NO_SLOT
    uint32_t boot_nonce;
    uint64_t fault_ticks;  // since start, to a microsecond
    uint64_t now_ticks;    // since start, to a microsecond; 0 before
    uint32_t triggers_fired;
    uint32_t cycles_played;
    uint32_t log_entries_lost;
    uint32_t program_crc32;  // of the loaded program, 0 without
    uint8_t next;            // enum ols_next
    uint8_t reserved[3];
    uint32_t edges_seen;    // of GENLOCK, debounced, since start, where each starts a cycle
    uint32_t edges_missed;  // of those, the ones that came while a cycle was playing
} OLS_PACKED;

struct ols_read_trigger_log {
    uint32_t first_counter;
    uint16_t entries_max;
    uint16_t reserved;  // 0
} OLS_PACKED;

struct ols_trigger_log_reply {
    uint32_t first_counter;  // of the first entry that follows
    uint32_t next_counter;   // that the next trigger will have
    uint32_t entries_lost;   // since start
    uint16_t entry_count;
    uint16_t reserved;  // 0
} OLS_PACKED;

// A trigger as measured at the pin. Only TRIG0 is watched: slots without it in their mask have no entry.
struct ols_trigger_log_entry {
    uint64_t rise_ticks;  // since start, even: measured every second tick
    uint32_t counter;     // 0 for the first trigger after start
    uint32_t cycle;       // of its program
    uint16_t slot;
    uint8_t trigger_mask;
    uint8_t program;  // how many programs have been swapped in since start, modulo 256
} OLS_PACKED;

struct ols_read_digests {
    uint32_t first_digest;
    uint16_t digests_max;
    uint16_t reserved;  // 0
} OLS_PACKED;

struct ols_digests_reply {
    uint32_t first_digest;  // number of the first that follows
    uint32_t next_digest;   // number that the next one will have
    uint32_t digests_lost;  // since start: overwritten before the host has read them
    uint16_t digest_count;
    uint16_t reserved;  // 0
} OLS_PACKED;

enum ols_digest_flags {
    OLS_DIGEST_INCOMPLETE =
        1  // not of all the cycle's triggers: some were lost or too many at once, or play ended in it
};

// What the trigger log says of one cycle. A host that has all its entries can tell: it makes the same of them.
struct ols_cycle_digest {
    uint64_t first_rise_ticks;
    uint64_t last_rise_ticks;
    uint32_t first_counter;  // of its first entry
    uint32_t cycle;          // of its program
    uint32_t entries_crc32;  // of all its ols_trigger_log_entry in order
    uint16_t trigger_count;  // of entries
    uint8_t program;         // as in log entries
    uint8_t flags;           // enum ols_digest_flags bits
} OLS_PACKED;

// CAN identifiers, 11 bits. Of a board: + 16 times its number, 0 to 15. The lower wins the bus: news before bulk.
enum ols_canbus_id {
    OLS_CANBUS_STATE = 0x100,       // ols_canbus_state
    OLS_CANBUS_CYCLE = 0x101,       // ols_canbus_cycle
    OLS_CANBUS_FIRST_RISE = 0x102,  // ols_canbus_rise
    OLS_CANBUS_LAST_RISE = 0x103,   // ols_canbus_rise
    OLS_CANBUS_CYCLE_CRC = 0x104,   // ols_canbus_cycle_crc
    OLS_CANBUS_HEALTH = 0x105,      // ols_canbus_health
    OLS_CANBUS_LAMP_NODE = 0x200,   // + the lamp node's number, 0 to 255: ols_canbus_lamp_node
    OLS_CANBUS_TO_BOARD = 0x600,    // ISO-TP: requests, and flow control of replies
    OLS_CANBUS_TO_HOST = 0x608      // ISO-TP: replies, and flow control of requests
};

// Sent by the board when it changes, and every 50 ms.
struct ols_canbus_state {
    uint8_t state;        // enum ols_state
    uint8_t fault;        // enum ols_fault
    uint16_t fault_slot;  // or OLS_NO_SLOT
    uint32_t cycles_played;
} OLS_PACKED;

// A cycle's digest, in four frames.
struct ols_canbus_cycle {
    uint32_t cycle;
    uint16_t trigger_count;
    uint8_t program;
    uint8_t flags;  // enum ols_digest_flags bits
} OLS_PACKED;

struct ols_canbus_rise {
    uint32_t rise_ticks_low;   // bits 0 to 31
    uint16_t rise_ticks_high;  // bits 32 to 47
    uint16_t cycle_low;        // bits 0 to 15 of the cycle that this is about
} OLS_PACKED;

struct ols_canbus_cycle_crc {
    uint32_t cycle;
    uint32_t entries_crc32;
} OLS_PACKED;

// Sent by the board when it changes, and every second.
struct ols_canbus_health {
    uint16_t frames_lost;      // since reset: received without room for them, or given up unsent
    uint16_t messages_lost;    // since reset: in part received or sent, then given up (isotp.h)
    uint16_t bus_offs;         // since reset
    uint8_t last_error;        // enum isotp_error of the last message lost
    uint8_t controller_flags;  // MCP2515 datasheet, register 6-3, EFLG
} OLS_PACKED;

enum ols_lamp_fault {
    OLS_LAMP_OVER_TEMPERATURE = 1,
    OLS_LAMP_OPEN = 2,
    OLS_LAMP_SHORTED = 4,
    OLS_LAMP_UNDER_VOLTAGE = 8
};

// Sent by a lamp node (one driver of 16 outputs) every second, and at once when `faults` changes.
struct ols_canbus_lamp_node {
    int16_t temperature_centi_c;  // of the driver, hundredths of a degree Celsius
    uint16_t current_ma;          // drawn by all its lamps
    uint16_t open_outputs;        // bit k: nothing conducts at output k
    uint8_t faults;               // enum ols_lamp_fault bits
    uint8_t count;                // of frames sent, modulo 256: shows losses
} OLS_PACKED;

enum ols_error_code {
    OLS_ERROR_UNKNOWN_MESSAGE = 1,
    OLS_ERROR_BAD_LENGTH = 2,
    OLS_ERROR_BAD_STATE = 3,
    OLS_ERROR_BAD_OFFSET = 4,
    OLS_ERROR_BAD_CRC = 5,
    OLS_ERROR_BAD_PROGRAM = 6,
    OLS_ERROR_FAULT_LATCHED = 7,
    OLS_ERROR_OVER_LIMIT = 8,  // a lamp would be lit for too long, or too many at once
    OLS_ERROR_NOT_SAFE = 9     // the emergency stop or a driver says no
};

struct ols_error_reply {
    uint16_t code;   // enum ols_error_code
    uint16_t slot;   // or OLS_NO_SLOT
    char text[116];  // what is wrong and what to do, zero-terminated
} OLS_PACKED;

OLS_WIRE_ASSERT(sizeof(struct ols_frame_header) == 10, "frame header");
OLS_WIRE_ASSERT(sizeof(struct ols_hello) == 8, "hello");
OLS_WIRE_ASSERT(sizeof(struct ols_hello_reply) == 92, "hello reply");
OLS_WIRE_ASSERT(sizeof(struct ols_trigger) == 12, "trigger");
OLS_WIRE_ASSERT(sizeof(struct ols_load_begin) == 68, "load begin");
OLS_WIRE_ASSERT(sizeof(struct ols_load_chunk) == 4, "load chunk");
OLS_WIRE_ASSERT(sizeof(struct ols_slot) == 16, "slot");
OLS_WIRE_ASSERT(sizeof(struct ols_arm) == 12, "arm");
OLS_WIRE_ASSERT(sizeof(struct ols_swap_reply) == 8, "swap reply");
OLS_WIRE_ASSERT(sizeof(struct ols_status_reply) == 52, "status reply");
OLS_WIRE_ASSERT(sizeof(struct ols_read_trigger_log) == 8, "read trigger log");
OLS_WIRE_ASSERT(sizeof(struct ols_trigger_log_reply) == 16, "trigger log reply");
OLS_WIRE_ASSERT(sizeof(struct ols_trigger_log_entry) == 20, "trigger log entry");
OLS_WIRE_ASSERT(sizeof(struct ols_error_reply) == 120, "error reply");
OLS_WIRE_ASSERT(sizeof(struct ols_read_digests) == 8, "read digests");
OLS_WIRE_ASSERT(sizeof(struct ols_digests_reply) == 16, "digests reply");
OLS_WIRE_ASSERT(sizeof(struct ols_cycle_digest) == 32, "cycle digest");
OLS_WIRE_ASSERT(sizeof(struct ols_canbus_state) == 8, "a CAN frame");
OLS_WIRE_ASSERT(sizeof(struct ols_canbus_cycle) == 8, "a CAN frame");
OLS_WIRE_ASSERT(sizeof(struct ols_canbus_rise) == 8, "a CAN frame");
OLS_WIRE_ASSERT(sizeof(struct ols_canbus_cycle_crc) == 8, "a CAN frame");
OLS_WIRE_ASSERT(sizeof(struct ols_canbus_health) == 8, "a CAN frame");
OLS_WIRE_ASSERT(sizeof(struct ols_canbus_lamp_node) == 8, "a CAN frame");
OLS_WIRE_ASSERT(sizeof(struct ols_trigger_log_reply) + OLS_LOG_ENTRIES_MAX * sizeof(struct ols_trigger_log_entry) <=
                    OLS_PAYLOAD_BYTES_MAX,
                "a full trigger log reply fits a frame");
OLS_WIRE_ASSERT(sizeof(struct ols_digests_reply) + OLS_DIGESTS_MAX * sizeof(struct ols_cycle_digest) <=
                    OLS_PAYLOAD_BYTES_MAX,
                "a full digests reply fits a frame");

#endif
