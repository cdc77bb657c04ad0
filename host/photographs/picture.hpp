// SPDX-License-Identifier: MIT
// Pictures that other programs and cameras made, read to linear light: right, or refused.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "image/frame.hpp"
#include "photographs/picture_samples.hpp"
#include "photographs/raw_picture.hpp"
#include "result.hpp"

namespace ols {

enum class Transfer {
    by_file,  // as the file says; if it does not, integers are sRGB (IEC 61966-2-1) and floats are linear
    srgb,
    linear,
};

struct PictureOptions {
    Transfer transfer = Transfer::by_file;
    double full_scale = 0;  // the code that is 1, in the file's own bits; 0: the largest code of integers, 1 of floats
    int page = 0;           // from 1; 0: the only one
    RawUse raw = RawUse::refuse;
    bool turn = true;  // as Exif orientation says
};

// What is known of a picture beside its pixels.
struct PictureFacts {
    Cfa cfa = Cfa::none;                     // Cfa::rgb, or of a raw mosaic
    bool is_rec709 = false;                  // R G B are of Rec. 709's primaries (or grey of sRGB's curve)
    bool was_unlabelled = false;             // integers of a file that says nothing, taken as sRGB
    int orientation = 1;                     // as the file says, whether it was turned or not
    double largest_code = 0, last_code = 0;  // found, possible; in the file's own bits, 0 for floats
    ExposureSettings exposure;
    std::vector<std::string> said;  // what was converted or left out, one sentence each
};

struct Picture : PictureFacts {
    Image light;                 // 1 or 3 channels
    std::optional<Image> alpha;  // 1 channel, 0 to 1
};

inline bool is_mosaic(Cfa cfa) {
    return cfa != Cfa::none && cfa != Cfa::rgb;
}

// Reads PNG, JPEG, TIFF, BMP, TGA, WebP and PNM through OpenImageIO, HEIC and AVIF through libheif, OpenEXR and Radiance (image/exr.hpp, image/radiance.hpp)
// and, if asked for, camera raw through LibRaw. Rows top to bottom, R G B. Where pixels lie: turned and mirrored as the file says, the
// display window where there is one. Colours: profiles, gamma and primaries are converted to linear light of Rec. 709's primaries; with
// another transfer than by_file they are left out, and this is said. Alpha does not change colours. docs/doors/pictures.md has all rules.
// Errors name the file, what is wrong, and what to do.
Result<Picture> read_picture(const std::string& path, const PictureOptions& options = {});

}  // namespace ols
