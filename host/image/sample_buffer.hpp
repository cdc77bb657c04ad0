// SPDX-License-Identifier: MIT
// Sample buffer: the bytes of a frame's samples, in memory of their own or in memory that is lent and goes back.
#pragma once

#include <cstddef>
#include <memory>

namespace ols {

class SampleBuffer;

// Keeps memory that frames come and go in, so that none is made for each. Its buffers may outlive their other owners.
class SampleLender {
  public:
    virtual ~SampleLender() = default;

    // Empty, with room for a frame; where none is left, without.
    virtual SampleBuffer lend() = 0;

  private:
    friend class SampleBuffer;
    virtual void take_back(std::byte* memory) noexcept = 0;
};

// As a vector of bytes is, but that memory may be lent. Moves keep the memory; a copy has its own. Begins on a cache line.
class SampleBuffer {
  public:
    SampleBuffer() = default;
    // Lent memory of `capacity` bytes.
    SampleBuffer(std::shared_ptr<SampleLender> lender, std::byte* memory, size_t capacity)
        : lender_(std::move(lender)), data_(memory), capacity_(capacity) {}
    SampleBuffer(const SampleBuffer& other) { assign(other.data_, other.data_ + other.size_); }
    SampleBuffer(SampleBuffer&& other) noexcept { swap(other); }
    SampleBuffer& operator=(SampleBuffer other) noexcept {
        swap(other);
        return *this;
    }
    ~SampleBuffer() { let_go(); }

    std::byte* data() { return data_; }
    const std::byte* data() const { return data_; }
    size_t size() const { return size_; }
    bool empty() const { return size_ == 0; }
    std::byte* begin() { return data_; }
    std::byte* end() { return data_ + size_; }
    const std::byte* begin() const { return data_; }
    const std::byte* end() const { return data_ + size_; }
    std::byte& operator[](size_t i) { return data_[i]; }
    const std::byte& operator[](size_t i) const { return data_[i]; }
    friend bool operator==(const SampleBuffer& a, const SampleBuffer& b);

    bool is_lent() const { return lender_ != nullptr; }

    // What was there stays, what is new is 0. More than was lent takes memory of its own, here as below.
    void resize(size_t bytes);
    // For samples that are all to be written: what they are before is not said.
    void make_room(size_t bytes);
    void assign(const std::byte* first, const std::byte* last);
    void assign(size_t bytes, std::byte value);

  private:
    void swap(SampleBuffer& other) noexcept;
    void let_go() noexcept;

    std::shared_ptr<SampleLender> lender_;  // null: the memory is its own
    std::byte* data_ = nullptr;
    size_t size_ = 0, capacity_ = 0;
};

}  // namespace ols
