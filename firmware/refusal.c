// SPDX-License-Identifier: MIT
// Refusal: code and text of an error reply.
#include "refusal.h"

#include "text.h"

bool refuse(struct ols_error_reply* error, enum ols_error_code code, const char* reason) {
    error->code = (uint16_t)code;
    error->slot = OLS_NO_SLOT;
    struct text text = text_in(error->text, sizeof error->text);
    text_append(&text, reason);
    return false;
}
