// SPDX-License-Identifier: MIT
// Reading faults.toml and tampering with delivery.
#include "run/faults.hpp"

#include "stage/toml_section.hpp"

namespace ols {

constexpr static size_t faults_max = 10'000;

Result<std::vector<Fault>> read_faults(const std::string& path) {
    auto file = TomlSection::open(path);
    if (!file) return file.error();
    std::vector<Fault> faults;
    for (TomlSection& section : file->sections("fault", faults_max)) {
        Fault fault{FaultKind::drop_frame};
        int camera = 0, trigger = 0, by = 1;
        if (!section.has("kind")) section.reject("kind", "is missing");
        if (!section.has("trigger")) section.reject("trigger", "is missing: say which trigger, from 0");
        section.read_choice<FaultKind>("kind", fault.kind,
                                       {{"drop_frame", FaultKind::drop_frame},
                                        {"drop_trigger", FaultKind::drop_trigger},
                                        {"duplicate", FaultKind::duplicate},
                                        {"late", FaultKind::late},
                                        {"swap", FaultKind::swap},
                                        {"wrong_size", FaultKind::wrong_size},
                                        {"freeze", FaultKind::freeze},
                                        {"swap_pictures", FaultKind::swap_pictures},
                                        {"old_light", FaultKind::old_light},
                                        {"dim_lamp", FaultKind::dim_lamp},
                                        {"restart_camera", FaultKind::restart_camera}});
        int lamp = 0, count = 0;
        if (section.has("lamp")) {
            section.read("lamp", lamp, 0, 65535);
            fault.lamp = size_t(lamp);
        }
        section.read("factor", fault.factor, 0.0, 1.0);
        section.read("count", count, 1, 1 << 30);
        if (count > 0) fault.count = uint64_t(count);
        section.read("camera", camera, 0, 3);
        section.read("trigger", trigger, 0, 1 << 30);
        section.read("by", by, 1, 1 << 20);
        section.read("keep_clock", fault.keep_clock);
        fault.camera = uint32_t(camera), fault.trigger = uint64_t(trigger), fault.by = uint64_t(by);
        faults.push_back(fault);
    }
    if (const Status status = file->finish(); !status) return status.error();
    return faults;
}

FaultyDelivery::FaultyDelivery(std::vector<Fault> faults, uint32_t camera) {
    for (const Fault& fault : faults)
        if (fault.camera == camera) faults_.push_back(fault);
}

const Fault* FaultyDelivery::find(FaultKind kind, uint64_t trigger) const {
    for (const Fault& fault : faults_)
        if (fault.kind == kind && fault.trigger == trigger) return &fault;
    return nullptr;
}

void FaultyDelivery::dim(std::vector<double>& lit_us, uint64_t trigger) {
    for (const Fault& fault : faults_) {
        if (fault.kind != FaultKind::dim_lamp || trigger < fault.trigger || trigger - fault.trigger >= fault.count)
            continue;
        for (size_t lamp = 0; lamp < lit_us.size(); ++lamp)
            if (!fault.lamp || *fault.lamp == lamp) lit_us[lamp] *= fault.factor;
    }
    constexpr size_t kept = 1024;
    const std::vector<double> own = lit_us;
    if (const Fault* old = find(FaultKind::old_light, trigger); old && old->by <= lit_before_.size())
        lit_us = lit_before_[size_t(old->by - 1)];
    if (faults_.empty()) return;
    lit_before_.push_front(own);
    if (lit_before_.size() > kept) lit_before_.pop_back();
}

void FaultyDelivery::send(Frame frame, uint64_t trigger, const std::function<void(Frame)>& deliver) {
    if (strikes(FaultKind::drop_frame, trigger)) return;
    const SampleBuffer fresh = frame.samples;
    if (strikes(FaultKind::freeze, trigger) && last_samples_.size() == fresh.size()) frame.samples = last_samples_;
    if (!faults_.empty()) last_samples_ = fresh;
    if (strikes(FaultKind::wrong_size, trigger)) {
        frame.height -= 2;
        frame.samples.resize(size_t(frame.height) * frame.pitch_bytes);
    }
    if (const Fault* swapped = find(FaultKind::swap_pictures, trigger)) {
        waiting_.emplace(trigger + swapped->by, std::move(frame));
        return;
    }
    if (const auto waiting = waiting_.find(trigger); waiting != waiting_.end()) {
        std::swap(waiting->second.samples, frame.samples);
        pass(std::move(waiting->second), deliver);
        waiting_.erase(waiting);
    }
    if (const Fault* late = find(FaultKind::late, trigger)) {
        held_.push_back({std::move(frame), late->by});
    } else if (strikes(FaultKind::swap, trigger)) {
        held_.push_back({std::move(frame), 1});
    } else {
        if (strikes(FaultKind::duplicate, trigger)) pass(frame, deliver);
        pass(std::move(frame), deliver);
    }
}

void FaultyDelivery::pass(Frame frame, const std::function<void(Frame)>& deliver) {
    deliver(std::move(frame));
    for (size_t i = 0; i < held_.size();) {
        if (--held_[i].frames_left > 0) {
            ++i;
            continue;
        }
        deliver(std::move(held_[i].frame));
        held_.erase(held_.begin() + std::ptrdiff_t(i));
    }
}

void FaultyDelivery::finish(const std::function<void(Frame)>& deliver) {
    for (auto& [trigger, frame] : waiting_) deliver(std::move(frame));
    waiting_.clear();
    for (Held& held : held_) deliver(std::move(held.frame));
    held_.clear();
}

}  // namespace ols
