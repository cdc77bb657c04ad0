// SPDX-License-Identifier: MIT
// Refusal: why a command is not done, for the host to read.
#ifndef OLS_REFUSAL_H
#define OLS_REFUSAL_H

#include <stdbool.h>

#include "wire.h"

#ifdef __cplusplus
extern "C" {
#endif

// Fills in `error`, of no slot. False, so that it can be what a command returns.
bool refuse(struct ols_error_reply* error, enum ols_error_code code, const char* reason);

#ifdef __cplusplus
}
#endif

#endif
