// SPDX-License-Identifier: MIT
// Schedule: owned by the handler that takes stamps. The main loop begins one while no stamp can come, announces a swap while
// interrupts are held, and puts a search of its own in place of the handler's if no stamp has come since it began that.
#include "schedule.h"

#include <stddef.h>

#include "board.h"
#include "pulse.h"

// Where the search for the next trigger is.
struct search {
    const struct sequence* played;
    const struct sequence* following;  // from cycle swap_cycle of `played` on; null when no swap is due
    uint32_t swap_cycle;
    uint32_t slot, cycle;  // the first of `played` that has not been searched
    uint64_t light_ticks;  // of that slot, since the first light of all
    bool is_due;           // a trigger follows
    uint64_t due_ticks;    // its rise
    uint32_t due_cycle;    // and the cycle it is in
    uint64_t vain_ticks;   // that the last search in vain has passed: a cycle
};

static struct search searches[2];
static struct search* volatile search = searches;  // the one in use
static volatile uint32_t taken;
static uint32_t origin_ticks;  // what the first stamp says less when that trigger was due, modulo 2^32
static uint64_t last_ticks;    // when the last trigger taken was due
static uint32_t last_cycle;    // and the cycle it was in
static bool each_cycle_waits;  // for an edge, so that its first trigger comes whenever that did

static void take_following(struct search* s) {
    s->played = s->following;
    s->following = NULL;
    s->cycle = 0;
}

static void step_slot(struct search* s) {
    s->light_ticks += sequence_slots(s->played)[s->slot].period_ticks;
    if (++s->slot < s->played->header.slot_count) return;
    s->slot = 0;
    s->cycle++;
    if (s->following != NULL && s->cycle == s->swap_cycle) take_following(s);
}

static bool fires(const struct sequence* sequence, const struct ols_slot* slot) {
    return slot->trigger_mask & 1 && !(sequence->header.triggers[0].skip_kinds >> slot->kind & 1);
}

// Looks through one whole cycle, of the next sequence too when that begins meanwhile.
static void seek(struct search* s) {
    const struct sequence* searched = s->played;
    uint64_t from_ticks = s->light_ticks;
    s->is_due = false;
    for (uint32_t left = searched->header.slot_count; left > 0; left--) {
        if (s->played->header.cycles != 0 && s->cycle == s->played->header.cycles) return;
        const struct ols_slot* const slot = &sequence_slots(s->played)[s->slot];
        if (fires(s->played, slot)) {
            s->due_ticks = s->light_ticks + (uint64_t)sequence_trigger_offset_ticks(s->played, slot, 0);
            s->due_cycle = s->cycle;
            s->is_due = true;
            return step_slot(s);
        }
        step_slot(s);
        if (s->played == searched) continue;
        searched = s->played;
        from_ticks = s->light_ticks;
        left = searched->header.slot_count + 1;
    }
    s->vain_ticks = s->light_ticks - from_ticks;
}

// Of a sequence that never triggers: the search stands at the begin of a cycle, and what the cycles from there to the swap
// take is a product.
static void skip_to_swap(struct search* s) {
    s->light_ticks += s->vain_ticks * (s->swap_cycle - s->cycle);
    take_following(s);
    seek(s);
}

static bool waits_for_swap(const struct search* s) {
    return !s->is_due && s->following != NULL;
}

static bool is_whenever_an_edge_comes(const struct search* s) {
    return each_cycle_waits && s->due_cycle != last_cycle;
}

void schedule_begin(const struct sequence* sequence, bool cycles_wait) {
    *search = (struct search){.played = sequence};
    each_cycle_waits = cycles_wait;
    taken = 0;
    seek(search);
}

void schedule_swap(const struct sequence* next, uint32_t after_cycles) {
    search->swap_cycle = after_cycles;
    search->following = next;
}

void schedule_settle(void) {
    const uint32_t taken_before = taken;
    struct search* const ahead = search == searches ? &searches[1] : searches;
    *ahead = *search;
    if (taken != taken_before || !waits_for_swap(ahead)) return;  // a stamp that has just come has settled it
    skip_to_swap(ahead);                                          // which may take long
    const uint32_t held = board_hold_interrupts();
    if (taken == taken_before) search = ahead;
    board_release_interrupts(held);
}

uint32_t schedule_taken(void) {
    return taken;
}

bool schedule_take(uint32_t stamp) {
    struct search* const s = search;
    if (waits_for_swap(s)) skip_to_swap(s);
    if (!s->is_due) return false;
    const uint32_t rise_ticks = ~stamp * WITNESS_COUNT_TICKS;
    const uint32_t due_ticks = (uint32_t)s->due_ticks;
    if (taken == 0 || is_whenever_an_edge_comes(s)) origin_ticks = rise_ticks - due_ticks;
    taken++;
    last_ticks = s->due_ticks;
    last_cycle = s->due_cycle;
    const int32_t slip_ticks = (int32_t)(rise_ticks - origin_ticks - due_ticks);
    return slip_ticks <= SCHEDULE_TOLERANCE_TICKS && slip_ticks >= -SCHEDULE_TOLERANCE_TICKS;
}

void schedule_seek(void) {
    seek(search);
}

uint32_t schedule_ticks_to_next(void) {
    const struct search* const s = search;
    if (!s->is_due || is_whenever_an_edge_comes(s)) return 0;
    const uint64_t ticks = s->due_ticks - last_ticks;
    return ticks < UINT32_MAX ? (uint32_t)ticks : 0;
}
