// SPDX-License-Identifier: MIT
// Cargo wants a source file; nothing is built.
