# SPDX-License-Identifier: MIT
# Writes version.hpp: the project's version and, in a checkout, the commit. -DSOURCE=... -DVERSION=... -DOUTPUT=...
set(text "${VERSION}")
if(EXISTS ${SOURCE}/.git)
  execute_process(
    COMMAND git --git-dir=${SOURCE}/.git --work-tree=${SOURCE} describe --always --dirty --exclude=*
    OUTPUT_VARIABLE commit OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET RESULT_VARIABLE failed)
  if(NOT failed)
    set(text "${VERSION} (${commit})")
  endif()
endif()
# Leaves the file as it is, and what depends on it, where nothing changed.
file(CONFIGURE OUTPUT ${OUTPUT} @ONLY CONTENT "// Made by host/version.cmake.
#pragma once
inline constexpr const char* version = \"${text}\";
")
