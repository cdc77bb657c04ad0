// SPDX-License-Identifier: MIT
#include "photographs/stated_size.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

namespace ols {

Status check_stated_size(const std::string& path, double width, double height, double bytes_a_pixel, bool packs_flat) {
    std::error_code error;
    const double file = double(std::filesystem::file_size(path, error));
    const bool is_possible =
        width >= 1 && height >= 1 && width <= 65535 && height <= 65535 && width * height <= 1 << 28;
    if (is_possible && width * height * bytes_a_pixel <= std::max(packs_flat ? 64e6 : 0, 2000 * file)) return Done{};
    return fail(fmt::format("'{}' says it is {:.0f} x {:.0f}: {}", path, width, height,
                            is_possible ? fmt::format("{:.0f} bytes cannot hold that; it is damaged", file)
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
