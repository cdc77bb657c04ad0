// SPDX-License-Identifier: MIT
#include "photographs/stated_size.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

namespace ols {

namespace {

double size_of(const std::string& path) {
    std::error_code error;
    const auto size = std::filesystem::file_size(path, error);
    return error ? 0 : double(size);
}

}  // namespace

bool can_hold(const std::string& path, double bytes) {
    return bytes <= std::max(64e6, 2000 * size_of(path));
}

Status check_stated_size(const std::string& path, double width, double height, double bytes_a_pixel) {
    const bool is_possible =
        width >= 1 && height >= 1 && width <= 65535 && height <= 65535 && width * height <= 1 << 28;
    if (is_possible && can_hold(path, width * height * bytes_a_pixel)) return Done{};
    return fail(fmt::format("'{}' says it is {:.0f} x {:.0f}: {}", path, width, height,
                            is_possible ? fmt::format("{:.0f} bytes cannot hold that; it is damaged", size_of(path))
                                        : "larger than any picture that is read (65535 a side, 268 million pixels)"));
}

Status check_page(const std::string& path, int pages, int page) {
    if (page == 0 && pages > 1)
        return fail(fmt::format("'{}' has {} pages: choose one with --page 1 to {}", path, pages, pages));
    if (page > pages)
        return fail(
            fmt::format("'{}' has {} {}: there is no page {}", path, pages, pages == 1 ? "page" : "pages", page));
    return Done{};
}

}  // namespace ols
