// SPDX-License-Identifier: MIT
// The mappings that the handler of SIGBUS knows. It takes no lock: entries are claimed, then filled, and cleared before they are
// given back.
#include "device/guarded_mapping.hpp"

#include <signal.h>
#include <sys/mman.h>

#include <cerrno>
#include <cstdint>
#include <iterator>
#include <mutex>

namespace ols {

namespace {

struct Guarded {
    std::atomic<bool> claimed = false, cut = false;
    std::atomic<uintptr_t> begin = 0, end = 0;  // 0: nothing is mapped
};

Guarded guarded[64];
struct sigaction handler_before;

// At a thread's own access, which is repeated when this returns. mmap() is no more than a system call.
bool put_zeros_in_place(uintptr_t address) {
    for (Guarded& entry : guarded) {
        const uintptr_t begin = entry.begin, end = entry.end;
        if (begin == 0 || address < begin || address >= end) continue;
        entry.cut = true;
        return mmap(reinterpret_cast<void*>(begin), end - begin, PROT_READ | PROT_WRITE,
                    MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE | MAP_FIXED, -1, 0) != MAP_FAILED;
    }
    return false;
}

void handle(int, siginfo_t* info, void*) {
    const int error = errno;
    // Where it is not ours the access is repeated under the handler that was there before.
    if (!put_zeros_in_place(reinterpret_cast<uintptr_t>(info->si_addr))) sigaction(SIGBUS, &handler_before, nullptr);
    errno = error;
}

void install_handler() {
    static std::once_flag once;
    std::call_once(once, [] {
        struct sigaction action {};
        action.sa_sigaction = handle;
        action.sa_flags = SA_SIGINFO;
        sigemptyset(&action.sa_mask);
        sigaction(SIGBUS, &action, &handler_before);
    });
}

int claim_place() {
    for (int n = 0; n < int(std::size(guarded)); ++n)
        if (!guarded[n].claimed.exchange(true)) return n;
    errno = EMFILE;
    return -1;
}

}  // namespace

GuardedMapping::GuardedMapping(int fd, size_t bytes) {
    install_handler();
    const int place = claim_place();
    if (place < 0) return;
    void* const memory = mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
    if (memory == MAP_FAILED) {
        guarded[place].claimed = false;
        return;
    }
    data_ = static_cast<std::byte*>(memory);
    bytes_ = bytes;
    place_ = place;
    guarded[place].cut = false;
    guarded[place].end = uintptr_t(memory) + bytes;
    guarded[place].begin = uintptr_t(memory);
}

GuardedMapping::~GuardedMapping() {
    if (!data_) return;
    guarded[place_].begin = 0;
    munmap(data_, bytes_);
    guarded[place_].claimed = false;
}

bool GuardedMapping::cut() const {
    return data_ && guarded[place_].cut;
}

}  // namespace ols
