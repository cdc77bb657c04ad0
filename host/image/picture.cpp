// SPDX-License-Identifier: MIT
// Decoding by OpenCV, read_exr or read_tga, then linear light by table.
#include "image/picture.hpp"

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "image/exr.hpp"
#include "image/tga.hpp"
#include "image/tone.hpp"

namespace ols {

namespace {

std::string lower_extension(const std::string& path) {
    std::string extension = std::filesystem::path(path).extension().string();
    std::transform(extension.begin(), extension.end(), extension.begin(), [](unsigned char c) { return tolower(c); });
    return extension;
}

// Whether a JPEG file goes on to its end-of-image marker. Decoders fill what is missing with grey and call it a success.
// Segments before the first scan are skipped by their lengths: an embedded thumbnail has an end of its own.
bool jpeg_is_whole(const std::string& path) {
    std::ifstream stream(path, std::ios::binary);
    const std::string file{std::istreambuf_iterator<char>(stream), {}};
    const auto byte = [&](size_t i) { return i < file.size() ? (unsigned char)file[i] : 0; };
    if (byte(0) != 0xff || byte(1) != 0xd8) return true;  // another format under this name
    size_t at = 2;
    while (byte(at) == 0xff && byte(at + 1) != 0xda) at += 2 + (byte(at + 2) << 8 | byte(at + 3));
    return file.find("\xff\xd9", at) != std::string::npos;
}

Image without_alpha(Image image) {
    if (image.channels != 4) return image;
    Image rgb(image.width, image.height, 3);
    for (size_t p = 0; p < rgb.data.size() / 3; ++p) std::copy_n(&image.data[p * 4], 3, &rgb.data[p * 3]);
    return rgb;
}

void linearise(Image& image, float full_scale, bool srgb) {
    for (float& v : image.data) {
        v /= full_scale;
        if (srgb) v = srgb_decode(v);
    }
}

// Integer code values to linear light through a table of all of them.
template <typename Code>
Image from_codes(const cv::Mat& codes, bool srgb) {
    constexpr int last = (1 << (8 * sizeof(Code))) - 1;
    std::vector<float> light(last + 1);
    for (int i = 0; i <= last; ++i) light[i] = srgb ? srgb_decode(float(i) / last) : float(i) / last;
    Image image(codes.cols, codes.rows, codes.channels());
    float* out = image.data.data();
    for (int y = 0; y < codes.rows; ++y) {
        const Code* row = codes.ptr<Code>(y);
        for (int i = 0; i < codes.cols * codes.channels(); ++i) *out++ = light[row[i]];
    }
    return image;
}

Result<Picture> from_mat(cv::Mat mat, const std::string& path, Transfer transfer) {
    if (mat.channels() == 3) cv::cvtColor(mat, mat, cv::COLOR_BGR2RGB);
    if (mat.channels() == 4) cv::cvtColor(mat, mat, cv::COLOR_BGRA2RGB);
    if (mat.channels() != 1 && mat.channels() != 3)
        return fail("'" + path + "' has neither one nor three channels: save it as grey or RGB");
    const bool integer_srgb = transfer != Transfer::linear;
    if (mat.depth() == CV_8U) return Picture{from_codes<uint8_t>(mat, integer_srgb), integer_srgb};
    if (mat.depth() == CV_16U) return Picture{from_codes<uint16_t>(mat, integer_srgb), integer_srgb};
    if (mat.depth() != CV_32F && mat.depth() != CV_64F)
        return fail("'" + path + "' has samples of an unusual kind: save it with 8 or 16 bits or as floats");
    mat.convertTo(mat, CV_32F);
    Image image(mat.cols, mat.rows, mat.channels());
    for (int y = 0; y < mat.rows; ++y)
        std::copy_n(mat.ptr<float>(y), mat.cols * mat.channels(),
                    image.data.data() + size_t(y) * mat.cols * mat.channels());
    linearise(image, 1, transfer == Transfer::srgb);
    return Picture{std::move(image), transfer == Transfer::srgb};
}

Result<Picture> read_with_opencv(const std::string& path, Transfer transfer) {
    try {
        if (!jpeg_is_whole(path)) return fail("'" + path + "' is cut short: copy it again");
        cv::Mat mat = cv::imread(path, cv::IMREAD_UNCHANGED);
        if (mat.empty())
            return fail("cannot read '" + path + "': it is damaged or no picture of a known format (PNG, JPEG, TIFF, " +
                        "TGA, EXR)");
        return from_mat(std::move(mat), path, transfer);
    } catch (const std::exception& e) {
        return fail("cannot read '" + path + "': " + e.what());
    }
}

}  // namespace

Result<Picture> read_picture(const std::string& path, Transfer transfer) {
    std::error_code error;
    if (!std::filesystem::is_regular_file(path, error)) return fail("'" + path + "' is not there: check the path");
    const std::string extension = lower_extension(path);
    if (extension != ".exr" && extension != ".tga") return read_with_opencv(path, transfer);
    const bool exr = extension == ".exr";
    auto image = exr ? read_exr(path) : read_tga(path);
    if (!image) return image.error();
    const bool srgb = transfer == Transfer::srgb || (!exr && transfer == Transfer::by_type);
    Picture picture{without_alpha(std::move(*image)), srgb};
    linearise(picture.light, exr ? 1 : 255, srgb);
    return picture;
}

}  // namespace ols
