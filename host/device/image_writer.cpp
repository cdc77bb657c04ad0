// SPDX-License-Identifier: MIT
// The order of erasing and writing that no interruption harms.
#include "device/image_writer.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "image_label.h"

namespace ols {

namespace {

constexpr uint32_t label_page = OLS_IMAGE_LABEL_ADDRESS / flash_page_bytes * flash_page_bytes;
constexpr uint32_t label_in_page = OLS_IMAGE_LABEL_ADDRESS - label_page;
constexpr uint32_t note_sector = flash_address + flash_bytes - flash_sector_bytes;

constexpr const char* untouched = "its old firmware is untouched: plug it in again";
constexpr const char* incomplete =
    "the board has no complete firmware now: it stays dark in its boot loader; run the same command again";
constexpr const char* complete = "the new firmware is complete: plug the board in again";

Error in_state(const Error& error, const char* state) {
    return fail(error.message + ". " + state);
}

Result<std::optional<ImageLabel>> read_label_at(Picoboot& loader, uint32_t page) {
    const auto bytes = loader.read(page, flash_page_bytes);
    if (!bytes.ok()) return bytes.error();
    return parse_label(std::span(*bytes).subspan(label_in_page));
}

Status write_and_compare(Picoboot& loader, uint32_t address, std::span<const uint8_t> bytes) {
    if (Status written = loader.write(address, bytes); !written.ok()) return written;
    const auto read = loader.read(address, uint32_t(bytes.size()));
    if (!read.ok()) return read.error();
    const auto at = std::mismatch(bytes.begin(), bytes.end(), read->begin()).first;
    if (at == bytes.end()) return Done{};
    return fail(fmt::format("flash at {:08x} does not keep what is written: the chip is worn out or damaged",
                            address + uint32_t(at - bytes.begin())));
}

Status write_note(Picoboot& loader, const FirmwareImage& image) {
    if (Status erased = loader.erase(note_sector, flash_sector_bytes); !erased.ok()) return erased;
    return write_and_compare(loader, note_sector,
                             std::span(image.bytes).subspan(label_page - flash_address, flash_page_bytes));
}

// All but the first sector, then the first without its first page, then that page.
Status write_sectors(Picoboot& loader, const FirmwareImage& image, const FlashProgress& progress) {
    const std::span all(image.bytes);
    const size_t first = std::min<size_t>(flash_sector_bytes, all.size());
    size_t done = 0;
    for (size_t offset = first; offset < all.size(); offset += flash_sector_bytes) {
        const auto sector = all.subspan(offset, std::min<size_t>(flash_sector_bytes, all.size() - offset));
        const uint32_t address = flash_address + uint32_t(offset);
        if (Status erased = loader.erase(address, flash_sector_bytes); !erased.ok()) return erased;
        if (Status written = write_and_compare(loader, address, sector); !written.ok()) return written;
        progress(done += sector.size(), all.size());
    }
    const auto behind_boot2 = all.subspan(flash_page_bytes, first - flash_page_bytes);
    if (Status written = write_and_compare(loader, flash_address + flash_page_bytes, behind_boot2); !written.ok())
        return written;
    if (Status written = write_and_compare(loader, flash_address, all.first(flash_page_bytes)); !written.ok())
        return written;
    progress(all.size(), all.size());
    return Done{};
}

}  // namespace

Status take_over(Picoboot& loader) {
    if (Status done = loader.reset(); !done.ok()) return done;
    if (Status done = loader.exclusive_access(); !done.ok()) return done;
    return loader.exit_xip();
}

Result<std::optional<ImageLabel>> read_label(Picoboot& loader) {
    auto label = read_label_at(loader, label_page);
    if (!label.ok() || *label) return label;
    return read_label_at(loader, note_sector);
}

Status write_image(Picoboot& loader, const FirmwareImage& image, const FlashProgress& progress) {
    progress(0, image.bytes.size());
    if (const Status noted = write_note(loader, image); !noted.ok()) return in_state(noted.error(), untouched);
    if (const Status erased = loader.erase(flash_address, flash_sector_bytes); !erased.ok())
        return in_state(erased.error(), incomplete);
    if (const Status written = write_sectors(loader, image, progress); !written.ok())
        return in_state(written.error(), incomplete);
    if (const Status erased = loader.erase(note_sector, flash_sector_bytes); !erased.ok())
        return in_state(erased.error(), complete);
    return Done{};
}

}  // namespace ols
