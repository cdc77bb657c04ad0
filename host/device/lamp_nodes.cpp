// SPDX-License-Identifier: MIT
// One thread listens to the bus; silence is told by the bus's own clock, which on an emulated bus is not the wall's.
#include "device/lamp_nodes.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>

#include "exceptions.hpp"

namespace ols {

namespace {

constexpr CanIds telemetry_ids{OLS_CANBUS_LAMP_NODE, 0x700};  // 0x200 to 0x2ff
constexpr uint64_t look_us = 50'000;                          // between looks for silence
constexpr std::chrono::milliseconds poll_pause(10);

Result<std::unique_ptr<CanBus>> open_bus(const std::string& link) {
    const std::string place = link.substr(link.find(':') + 1);
    if (link.starts_with("can:")) return open_socketcan(CanPlace{place}, telemetry_ids);
    Patience patience;
    return open_can_socket(place, patience.begin_exchange());
}

std::string readings(const ols_canbus_lamp_node& news) {
    return fmt::format("{:.1f} C, {} mA", int16_t(news.temperature_centi_c) / 100.0, uint16_t(news.current_ma));
}

}  // namespace

std::string lamp_list(const std::vector<int>& lamps) {
    std::string text;
    for (size_t first = 0, last; first < lamps.size(); first = last + 1) {
        for (last = first; last + 1 < lamps.size() && lamps[last + 1] == lamps[last] + 1;) ++last;
        text += text.empty() ? "" : ", ";
        text += first == last ? fmt::format("{}", lamps[first]) : fmt::format("{}-{}", lamps[first], lamps[last]);
    }
    return text.empty() ? "none" : text;
}

Result<std::unique_ptr<LampNodes>> LampNodes::open(const StageConfig& stage, OnStop on_stop) {
    auto bus = open_bus(stage.telemetry.bus);
    if (!bus.ok()) return fail("the lamp nodes' bus: " + bus.error().message);
    return std::make_unique<LampNodes>(std::move(*bus), stage, std::move(on_stop));
}

LampNodes::LampNodes(std::unique_ptr<CanBus> bus, const StageConfig& stage, OnStop on_stop)
    : setup_(stage.telemetry), on_stop_(std::move(on_stop)), bus_(std::move(bus)) {
    lamp_of_bit_.assign(setup_.nodes.size() * lamp_node_outputs, -1);
    for (size_t lamp = 0; lamp < stage.chain_bit_of_lamp.size(); ++lamp)
        if (size_t(stage.chain_bit_of_lamp[lamp]) < lamp_of_bit_.size())
            lamp_of_bit_[size_t(stage.chain_bit_of_lamp[lamp])] = int(lamp);
    for (size_t n = 0; n < setup_.nodes.size(); ++n) {
        const int number = setup_.nodes[n], first_bit = int(n) * lamp_node_outputs;
        Node& node = nodes_[number];
        node.report.node = number;
        node.heard_us = bus_->now_us();
        first_bit_[number] = first_bit;
        for (int bit = first_bit; bit < first_bit + lamp_node_outputs; ++bit)
            if (lamp_of_bit_[size_t(bit)] >= 0) node.report.lamps.push_back(lamp_of_bit_[size_t(bit)]);
        std::ranges::sort(node.report.lamps);
    }
    thread_ = std::thread([this] {
        const Status watched = guarded("the lamp nodes cannot be followed", [this] { return watch(), Status(Done{}); });
        if (watched.ok()) return;
        const std::lock_guard lock(mutex_);
        note_trouble(watched.error().message);
    });
}

LampNodes::~LampNodes() {
    end_ = true;
    thread_.join();
}

void LampNodes::watch() {
    while (!end_) {
        const Status stepped = step();
        if (stepped.ok()) continue;
        const std::lock_guard lock(mutex_);
        return note_trouble("the lamp nodes' bus: " + stepped.error().message);
    }
}

Status LampNodes::step() {
    Patience patience;  // of records that trickle; a bus on which nothing comes is no error
    const Deadline deadline = patience.begin_exchange();
    const auto got = bus_->receive(bus_->now_us() + look_us, deadline);
    if (!got.ok()) return got.error();
    const std::lock_guard lock(mutex_);
    if (*got && telemetry_ids.holds((*got)->can_id) && (*got)->can_dlc == sizeof(ols_canbus_lamp_node)) {
        ols_canbus_lamp_node news;
        std::memcpy(&news, (*got)->data, sizeof news);
        take(int((*got)->can_id - OLS_CANBUS_LAMP_NODE), news);
    }
    look_for_silence();
    return Done{};
}

void LampNodes::take(int number, const ols_canbus_lamp_node& news) {
    const auto found = nodes_.find(number);
    if (found == nodes_.end()) return;  // not of this stage
    Node& node = found->second;
    LampNodeReport& report = node.report;
    const double temperature_c = int16_t(news.temperature_centi_c) / 100.0;
    const int current_ma = uint16_t(news.current_ma);
    const bool is_first = report.frames++ == 0;
    report.temperature_min_c = is_first ? temperature_c : std::min(report.temperature_min_c, temperature_c);
    report.temperature_max_c = is_first ? temperature_c : std::max(report.temperature_max_c, temperature_c);
    report.current_min_ma = is_first ? current_ma : std::min(report.current_min_ma, current_ma);
    report.current_max_ma = is_first ? current_ma : std::max(report.current_max_ma, current_ma);
    report.faults |= news.faults;
    report.open_outputs |= uint16_t(news.open_outputs);
    if (node.last_count >= 0) report.frames_lost += uint8_t(news.count - node.last_count - 1);
    node.last_count = news.count;
    node.heard_us = bus_->now_us();
    if (const std::string fault = fault_of(node, news); !fault.empty())
        note_trouble(fmt::format("lamp node {} reports {} ({}); it drives the lamps {}", number, fault, readings(news),
                                 lamp_list(report.lamps)));
}

// Of `open_outputs`, those that drive a lamp of the stage: a node's spare outputs are open by nature.
uint16_t LampNodes::open_with_lamp(const Node& node, uint16_t open_outputs) const {
    const int first_bit = first_bit_.at(node.report.node);
    uint16_t with_lamp = 0;
    for (int k = 0; k < lamp_node_outputs; ++k)
        if (lamp_of_bit_[size_t(first_bit + k)] >= 0) with_lamp |= uint16_t(1 << k);
    return open_outputs & with_lamp;
}

// What stands against a take, and what to do; "" when nothing does.
std::string LampNodes::fault_of(const Node& node, const ols_canbus_lamp_node& news) const {
    std::string faults;
    const auto add = [&](const std::string& text) { faults += (faults.empty() ? "" : "; ") + text; };
    if (news.faults & OLS_LAMP_OVER_TEMPERATURE) add("over-temperature: let it cool, and check the exposures");
    const uint16_t open = open_with_lamp(node, news.open_outputs);
    if (open != 0 || ((news.faults & OLS_LAMP_OPEN) && news.open_outputs == 0)) {
        std::vector<int> lamps;
        for (int k = 0; k < lamp_node_outputs; ++k)
            if (open >> k & 1) lamps.push_back(lamp_of_bit_[size_t(first_bit_.at(node.report.node) + k)]);
        std::ranges::sort(lamps);
        add(fmt::format("an open output{}: check lamps and wiring",
                        lamps.empty() ? "" : ", lamps " + lamp_list(lamps)));
    }
    if (news.faults & OLS_LAMP_SHORTED) add("a shorted lamp: check lamps and wiring");
    if (news.faults & OLS_LAMP_UNDER_VOLTAGE) add("under-voltage: check the lamp supply and its fuses");
    constexpr uint8_t known = OLS_LAMP_OVER_TEMPERATURE | OLS_LAMP_OPEN | OLS_LAMP_SHORTED | OLS_LAMP_UNDER_VOLTAGE;
    if (news.faults & ~known)
        add(fmt::format("unknown faults {:#04x}: its firmware is of another release", news.faults & ~known));
    if (setup_.temperature_max_c > 0 && int16_t(news.temperature_centi_c) > setup_.temperature_max_c * 100)
        add(fmt::format("more than the stage's temperature_max_c of {:g}: let it cool, and check the exposures",
                        setup_.temperature_max_c));
    return faults;
}

void LampNodes::look_for_silence() {
    const uint64_t now_us = bus_->now_us(), silent_us = uint64_t(setup_.silent_s * 1e6);
    for (const auto& [number, node] : nodes_)
        if (now_us > node.heard_us + silent_us)
            return note_trouble(
                fmt::format("lamp node {} is silent: nothing came for {:.1f} s, and it speaks every second: check its "
                            "supply and {}; it "
                            "drives the lamps {}",
                            number, double(now_us - node.heard_us) / 1e6, bus_->name(), lamp_list(node.report.lamps)));
}

void LampNodes::note_trouble(const std::string& why) {
    if (!trouble_.empty()) return;
    trouble_ = why;
    if (is_taking_) on_stop_(why);
}

Status LampNodes::begin_take(const std::atomic<bool>& stop) {
    for (;; std::this_thread::sleep_for(poll_pause)) {
        const std::lock_guard lock(mutex_);
        if (!trouble_.empty()) return fail(trouble_);
        if (stop) return fail("stopped before every lamp node was heard");
        if (std::ranges::any_of(nodes_, [](const auto& entry) { return entry.second.report.frames == 0; })) continue;
        is_taking_ = true;
        return Done{};
    }
}

void LampNodes::end_take() {
    const std::lock_guard lock(mutex_);
    is_taking_ = false;
}

std::vector<LampNodeReport> LampNodes::report() const {
    const std::lock_guard lock(mutex_);
    std::vector<LampNodeReport> reports;
    for (const auto& [number, node] : nodes_) reports.push_back(node.report);
    return reports;
}

}  // namespace ols
