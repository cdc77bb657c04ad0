// SPDX-License-Identifier: MIT
// Memory of one's own, and memory that is lent.
#include "image/sample_buffer.hpp"

#include <algorithm>
#include <cstring>
#include <new>
#include <utility>

namespace ols {

namespace {

constexpr std::align_val_t line{64};

}  // namespace

bool operator==(const SampleBuffer& a, const SampleBuffer& b) {
    return std::equal(a.begin(), a.end(), b.begin(), b.end());
}

void SampleBuffer::swap(SampleBuffer& other) noexcept {
    std::swap(lender_, other.lender_);
    std::swap(data_, other.data_);
    std::swap(size_, other.size_);
    std::swap(capacity_, other.capacity_);
}

void SampleBuffer::let_go() noexcept {
    if (lender_)
        lender_->take_back(data_);
    else if (data_)
        ::operator delete(data_, line);
}

void SampleBuffer::make_room(size_t bytes) {
    if (bytes > capacity_) {
        SampleBuffer own;
        own.data_ = static_cast<std::byte*>(::operator new(bytes, line));
        own.capacity_ = bytes;
        if (size_ > 0) std::memcpy(own.data_, data_, size_);
        own.size_ = size_;
        swap(own);
    }
    size_ = bytes;
}

void SampleBuffer::resize(size_t bytes) {
    const size_t before = size_;
    make_room(bytes);
    if (bytes > before) std::memset(data_ + before, 0, bytes - before);
}

void SampleBuffer::assign(const std::byte* first, const std::byte* last) {
    size_ = 0;
    make_room(size_t(last - first));
    if (size_ > 0) std::memcpy(data_, first, size_);
}

void SampleBuffer::assign(size_t bytes, std::byte value) {
    size_ = 0;
    make_room(bytes);
    if (bytes > 0) std::memset(data_, int(value), bytes);
}

}  // namespace ols
