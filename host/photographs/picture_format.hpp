// SPDX-License-Identifier: MIT
// What kind of picture a file holds, by its first bytes: names lie.
#pragma once

#include <string>

#include "result.hpp"

namespace ols {

enum class PictureFormat { png, jpeg, tiff, bmp, targa, webp, heif, pnm, openexr, radiance, raw };

// OpenImageIO's name of a format, which is also its word in messages.
const char* format_name(PictureFormat format);

// A file that no signature fits is Targa by the name's end (Targa has no signature), else raw if LibRaw knows its camera. A TIFF
// file is raw, too, if LibRaw says so: such files begin with a small preview. Errors name the file and what to do: not there,
// no regular file (nothing is waited for), empty, a picture of a kind that is not read, no picture.
Result<PictureFormat> picture_format(const std::string& path);

// Whether a file's name ends as pictures' names do. Lower or upper case.
bool looks_like_a_picture(const std::string& name);

}  // namespace ols
