// SPDX-License-Identifier: MIT
// Messages for people, put together in a fixed buffer.
#include "text.h"

struct text text_in(char* buffer, size_t capacity) {
    buffer[0] = 0;
    return (struct text){buffer, capacity, 0};
}

void text_append(struct text* text, const char* words) {
    while (*words && text->length + 1 < text->capacity) text->characters[text->length++] = *words++;
    text->characters[text->length] = 0;
}

void text_append_number(struct text* text, uint32_t number) {
    char digits[11];
    char* first = digits + sizeof digits;
    *--first = 0;
    do {
        *--first = (char)('0' + number % 10);
        number /= 10;
    } while (number);
    text_append(text, first);
}
