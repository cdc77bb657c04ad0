// SPDX-License-Identifier: MIT
// Messages for people, put together in a fixed buffer without printf (which would triple the image).
#ifndef OLS_TEXT_H
#define OLS_TEXT_H

#include <stddef.h>
#include <stdint.h>

// A zero-terminated text that grows by appending and is cut off where the buffer ends.
struct text {
    char* characters;
    size_t capacity;  // with the final zero; at least 1
    size_t length;
};

struct text text_in(char* buffer, size_t capacity);
void text_append(struct text* text, const char* words);
void text_append_number(struct text* text, uint32_t number);

#endif
