# SPDX-License-Identifier: MIT
# A host for the board in Python's standard library alone, independent of the C and C++ code.
