// SPDX-License-Identifier: MIT
// The Aravis driver over real GigE Vision on the loopback, against the conformance suite and what is particular to it.
// links: ols_aravis_rigs
#include <fmt/format.h>

#include "aravis_rigs.hpp"
#include "camera_conformance.hpp"
#include "device/aravis_setup.hpp"
#include "network_space.hpp"

namespace ols::test {
namespace {

// With a network of its own this program meets no camera but its own. Before main, as there are no threads yet.
const bool is_alone = enter_network_space() && add_loopback_address(2);

INSTANTIATE_TEST_SUITE_P(Gige, CameraConformance,
                         testing::Values(CameraKind{"line", [] { return std::make_unique<GigeRig>(); }}),
                         [](const auto& kind) { return std::string(kind.param.name); });
INSTANTIATE_TEST_SUITE_P(ArvFake, CameraConformance,
                         testing::Values(CameraKind{"fake", [] { return std::make_unique<ArvFakeRig>(); }}),
                         [](const auto& kind) { return std::string(kind.param.name); });

std::vector<uint16_t> samples_of(const Frame& frame) {
    const auto* samples = reinterpret_cast<const uint16_t*>(frame.samples.data());
    return {samples, samples + frame.samples.size() / 2};
}

std::vector<uint16_t> truth(uint64_t id, size_t pixels, int bits) {
    std::vector<uint16_t> samples(pixels);
    for (size_t n = 0; n < pixels; ++n) samples[n] = GigeDevice::sample(id, n, bits);
    return samples;
}

// A camera that was set up as fits, with a way to change that.
struct Opened {
    explicit Opened(GigeOptions options = {})
        : rig(std::move(options)), camera(rig.open()), wanted(rig.fitting_setup()) {}
    GigeDevice& device() { return rig.device(); }

    std::string set_up() {
        const Status taken = camera->set_up(wanted);
        return taken.ok() ? "" : taken.error().message;
    }
    uint64_t start() {
        EXPECT_EQ(set_up(), "");
        const auto started_ns = camera->start();
        EXPECT_TRUE(started_ns.ok()) << (started_ns.ok() ? "" : started_ns.error().message);
        return started_ns.ok() ? *started_ns : 0;
    }
    Frame read() {
        auto frame = camera->read(surely_ms);
        EXPECT_TRUE(frame.has_value());
        return frame ? std::move(*frame) : Frame();
    }
    CameraState state_after_all() {
        for (int waited_ms = 0; waited_ms < surely_ms && camera->state().kind == CameraState::live; waited_ms += 10)
            (void)camera->read(10), std::this_thread::sleep_for(std::chrono::milliseconds(10));
        return camera->state();
    }

    GigeRig rig;
    std::unique_ptr<Camera> camera;
    CameraSetup wanted;
};

}  // namespace

class PixelFormats : public testing::TestWithParam<PixelCode> {};

TEST_P(PixelFormats, every_sample_comes_as_the_camera_made_it) {
    const PixelCode& format = GetParam();
    GigeOptions options;
    options.description.pixel_formats = {format.name};
    Opened o(options);
    o.wanted.bits = format.bits;
    o.wanted.cfa = sample_layout_of(format.name)->cfa;
    o.wanted.width = 22;  // rows of 12 bits end within a byte's neighbour's pair
    o.start();
    EXPECT_NE(o.camera->info().link.find(format.name), std::string::npos) << o.camera->info().link;
    for (uint64_t id = 1; id <= 3; ++id) {
        o.device().trigger();
        const Frame frame = o.read();
        EXPECT_EQ(samples_of(frame), truth(id, 22 * 8, format.bits));
        EXPECT_EQ(frame.white, float((1 << format.bits) - 1));
    }
}

INSTANTIATE_TEST_SUITE_P(All, PixelFormats, testing::ValuesIn([] {
                             std::vector<PixelCode> readable;
                             for (const PixelCode& code : pixel_codes())
                                 if (sample_layout_of(code.name)) readable.push_back(code);
                             return readable;
                         }()),
                         [](const auto& format) { return std::string(format.param.name); });

TEST(AravisSetup, tells_layouts_by_their_names_and_knows_no_others) {
    const std::pair<const char*, SampleLayout> known[] = {
        {"Mono8", {SamplePacking::bytes, 8, Cfa::none}},
        {"Mono10p", {SamplePacking::bits_low, 10, Cfa::none}},
        {"BayerGB12Packed", {SamplePacking::gige_pairs, 12, Cfa::gbrg}},
        {"BayerBG16", {SamplePacking::words, 16, Cfa::bggr}}};
    for (const auto& [name, layout] : known) EXPECT_TRUE(sample_layout_of(name) == layout) << name;
    for (const char* name :
         {"", "Mono", "Mono8s", "Mono9", "Mono8p", "Mono16p", "Mono14Packed", "RGB8", "Mono12pp", "BayerRG8 "})
        EXPECT_FALSE(sample_layout_of(name).has_value()) << name;
}

TEST(AravisSetup, sets_trigger_exposure_and_region_and_takes_out_what_would_spoil_them) {
    Opened o;
    o.wanted.width = 640, o.wanted.height = 480;
    o.wanted.trigger_source = "Line2";
    o.wanted.trigger_activation = TriggerActivation::falling_edge;
    o.wanted.trigger_delay_us = 12.5;
    o.wanted.exposure_mode = ExposureMode::timed;
    o.wanted.exposure_us = 98.7;
    ASSERT_EQ(o.set_up(), "");
    const auto& device = o.device();
    EXPECT_EQ(device.word(reg_width), 640u);
    EXPECT_EQ(device.word(reg_height), 480u);
    EXPECT_EQ(device.word(reg_offset_x), (2048u - 640) / 2) << "in the middle";
    EXPECT_EQ(device.word(reg_offset_y), (2048u - 480) / 2);
    EXPECT_EQ(device.word(reg_trigger_mode), 1u);
    EXPECT_EQ(device.word(reg_trigger_mode + 4), 0u) << "AcquisitionStart would hold frames back";
    EXPECT_EQ(device.word(reg_trigger_source), 2u);
    EXPECT_EQ(device.word(reg_trigger_activation), 1u);
    EXPECT_EQ(device.word(reg_trigger_overlap), 1u);
    EXPECT_EQ(device.number(reg_trigger_delay), 12.5);
    EXPECT_EQ(device.word(reg_exposure_mode), 0u);
    EXPECT_EQ(device.word(reg_exposure_auto), 0u);
    EXPECT_EQ(device.number(reg_exposure_time), 98.7);
    o.wanted.exposure_mode = ExposureMode::trigger_width;
    ASSERT_EQ(o.set_up(), "");
    EXPECT_EQ(device.word(reg_exposure_mode), 1u);
}

TEST(AravisSetup, takes_the_format_of_the_fewest_bytes) {
    Opened o;
    o.wanted.cfa = Cfa::none;
    for (const auto& [bits, format] : {std::pair{10, "Mono10p"}, {12, "Mono12Packed"}, {16, "Mono16"}}) {
        o.wanted.bits = bits;
        ASSERT_EQ(o.set_up(), "");
        EXPECT_EQ(o.device().pixel_format(), format);
    }
}

TEST(AravisSetup, names_keys_and_features_that_a_model_lacks) {
    GigeOptions options;
    options.description.lacks = {"TriggerDelay", "ExposureMode", "TriggerActivation"};
    Opened o(options);
    o.wanted.trigger_delay_us = 3;
    o.wanted.trigger_activation = TriggerActivation::falling_edge;
    const std::string message = o.set_up();
    for (const char* words :
         {"OLS Line OLS1", "it has no trigger_delay_us, leave it out", "it has no trigger_activation",
          "exposure_mode is timed and not trigger_width", "ExposureMode", "TriggerDelay", "TriggerActivation"})
        EXPECT_NE(message.find(words), std::string::npos) << words << ": " << message;
    o.wanted = o.rig.fitting_setup();
    o.wanted.exposure_mode = ExposureMode::timed;
    EXPECT_EQ(o.set_up(), "") << "what it lacks is not needed";
}

TEST(AravisSetup, sets_features_of_the_cameras_own_by_their_names) {
    Opened o;
    o.wanted.controls = {{"BlackLevel", "128"}, {"TriggerOverlap", "ReadOut"}, {"TriggerDelay", "0.0"}};
    ASSERT_EQ(o.set_up(), "");
    EXPECT_EQ(o.device().word(reg_black_level), 128u);
    o.wanted.controls = {{"BlackLevel", "9999"}, {"NoSuchThing", "1"}, {"ExposureAuto", "Sometimes"}};
    const std::string message = o.set_up();
    for (const char* words : {"BlackLevel", "128", "it has no control \"NoSuchThing\"", "ExposureAuto", "Off"})
        EXPECT_NE(message.find(words), std::string::npos) << words << ": " << message;
}

TEST(AravisSetup, lists_what_could_be_had_of_inputs_and_formats) {
    GigeOptions options;
    options.description.pixel_formats = {"Mono8", "RGB8"};
    options.description.lacks = {"TriggerSource=Line2"};
    Opened o(options);
    o.wanted.trigger_source = "Line2";
    const std::string message = o.set_up();
    EXPECT_NE(message.find("its inputs are Software, Line1"), std::string::npos) << message;
    EXPECT_NE(message.find("bits is 8 and not 12"), std::string::npos) << message;
    EXPECT_NE(message.find("Mono8, RGB8"), std::string::npos) << message;
}

TEST(AravisSetup, rounds_nothing_without_a_word) {
    GigeOptions options;
    options.description.width_step = 16;
    Opened o(options);
    o.wanted.width = 40;
    EXPECT_NE(o.set_up().find("width is 64 and not 40"), std::string::npos) << o.set_up();
}

TEST(AravisSetup, a_camera_that_cannot_be_triggered_is_refused) {
    GigeOptions options;
    options.description.lacks = {"TriggerMode", "TriggerSelector=FrameStart"};
    Opened o(options);
    EXPECT_NE(o.set_up().find("no trigger FrameStart"), std::string::npos) << o.set_up();
}

TEST(AravisCamera, says_what_it_chose) {
    Opened o;
    o.start();
    const CameraInfo info = o.camera->info();
    EXPECT_EQ(info.name, "OLS Line OLS1");
    for (const char* words :
         {"GigE Vision", "packets of 89", "lost ones asked for again", "1024 buffers", "socket buffer of"})
        EXPECT_NE(info.link.find(words), std::string::npos) << words << ": " << info.link;
    EXPECT_EQ(info.setup.trigger_source, "Line1");
}

TEST(AravisLoss, lost_packets_are_asked_for_again_and_the_frame_is_whole) {
    Opened o;
    o.wanted.width = 256, o.wanted.height = 256;  // some packets
    o.start();
    o.device().on_the_way = [](auto& packets) { packets.erase(packets.begin() + 3, packets.begin() + 5); };
    // The library waits a tenth of a second for them; on a machine that is busy another frame may have to do.
    std::optional<Frame> frame;
    for (int tries = 0; tries < 50 && !frame; ++tries) {
        o.device().trigger();
        frame = o.camera->read(1000);
    }
    ASSERT_TRUE(frame.has_value());
    EXPECT_EQ(samples_of(*frame), truth(frame->stamp.frame_id, 256 * 256, 12));
    EXPECT_GT(o.device().resend_requests, 0u);
}

TEST(AravisLoss, a_frame_that_stays_incomplete_is_no_frame_and_is_counted_by_cause) {
    GigeOptions options;
    options.resends = false;
    options.description.packet_size_max = 1500;
    Opened o(options);
    o.wanted.width = 64, o.wanted.height = 64;  // five packets, between leader and trailer
    o.start();
    for (int n = 1; n <= 4; ++n) {
        o.device().on_the_way = [n](auto& packets) {
            if (n == 2) packets.erase(packets.begin() + 3);
            if (n == 3) packets.erase(packets.begin());  // the leader, which has the frame's id
        };
        o.device().trigger();
    }
    EXPECT_EQ(o.read().stamp.frame_id, 1u);
    EXPECT_EQ(o.read().stamp.frame_id, 4u);
    EXPECT_EQ(o.camera->counts().underrun, 2u);
    EXPECT_EQ(o.camera->counts().missing_ids, 2u);
    EXPECT_EQ(o.camera->counts().dropped, 0u);
}

TEST(AravisLoss, whole_frames_that_are_lost_count_each_although_the_library_counts_their_gap_as_one) {
    Opened o;
    o.start();
    for (int n = 1; n <= 8; ++n) {
        o.device().on_the_way = [n](auto& packets) {
            if (n >= 3 && n <= 7) packets.clear();
        };
        o.device().trigger();
    }
    for (const uint64_t id : {1, 2, 8}) EXPECT_EQ(o.read().stamp.frame_id, id);
    EXPECT_EQ(o.camera->counts().missing_ids, 5u);
    EXPECT_EQ(o.camera->counts().underrun, 0u);
}

TEST(AravisLoss, doubled_and_swapped_packets_make_the_same_frame_once) {
    Opened o;
    o.wanted.width = 256, o.wanted.height = 256;
    o.start();
    for (int n = 1; n <= 3; ++n) {
        o.device().on_the_way = [n](auto& packets) {
            if (n == 1) packets.insert(packets.end(), packets.begin(), packets.end());
            if (n == 2) std::reverse(packets.begin(), packets.end());
            if (n == 3) std::swap(packets[1], packets[4]), packets.insert(packets.begin() + 2, packets[6]);
        };
        o.device().trigger();
        EXPECT_EQ(samples_of(o.read()), truth(uint64_t(n), 256 * 256, 12)) << n;
    }
    EXPECT_FALSE(o.camera->read(soon_ms).has_value());
    const CameraCounts counts = o.camera->counts();
    EXPECT_EQ(counts.missing_ids + counts.underrun + counts.dropped, 0u);
}

TEST(AravisLoss, a_missed_trigger_is_a_gap_in_time_and_a_lost_frame_one_of_ids) {
    Opened o;
    o.start();
    o.device().trigger();
    o.device().miss_trigger();
    o.device().trigger();
    o.device().lose_frame();
    o.device().trigger();
    for (const uint64_t id : {1, 2, 4}) EXPECT_EQ(o.read().stamp.frame_id, id);
    EXPECT_EQ(o.camera->counts().missing_ids, 1u);
}

TEST(AravisLoss, frames_beyond_our_buffers_are_dropped_and_counted_as_such) {
    Opened o;
    o.start();
    for (int n = 0; n < 1100; ++n) {
        o.device().trigger();
        if (n % 50 == 0) std::this_thread::sleep_for(std::chrono::milliseconds(5));  // for the socket, not the buffers
    }
    // All that have buffers have come when a late one is refused: read until there are none, then one more closes the gap.
    uint64_t got = 0;
    while (o.camera->read(200)) ++got;
    o.device().trigger();
    (void)o.read(), ++got;
    const CameraCounts counts = o.camera->counts();
    EXPECT_EQ(got + counts.missing_ids, 1101u);
    EXPECT_GT(counts.dropped, 0u);
    EXPECT_LE(counts.dropped + counts.underrun, counts.missing_ids) << "a busy machine's socket loses some, too";
}

TEST(AravisIds, sixteen_bits_wrap_to_a_count_that_does_not) {
    Opened o;
    o.start();
    o.device().set_next_id(65533);
    for (int n = 0; n < 3; ++n) o.device().trigger();  // 65533 to 65535
    o.device().trigger();                              // 1
    o.device().lose_frame();
    o.device().trigger();  // 3
    std::vector<uint64_t> ids;
    for (int n = 0; n < 5; ++n) ids.push_back(o.read().stamp.frame_id);
    EXPECT_EQ(ids, (std::vector<uint64_t>{65533, 65534, 65535, 65536, 65538}));
    EXPECT_EQ(o.camera->counts().missing_ids, 1u);
}

TEST(AravisIds, extended_ids_are_as_the_camera_counts) {
    GigeOptions options;
    options.extended_ids = true;
    Opened o(options);
    o.start();
    o.device().set_next_id(0x1'0000'fffe);
    for (uint64_t n = 0; n < 4; ++n) {
        o.device().trigger();
        EXPECT_EQ(o.read().stamp.frame_id, 0x1'0000'fffe + n);
    }
    EXPECT_EQ(o.camera->counts().missing_ids, 0u);
}

TEST(AravisTimes, the_first_frame_after_an_idle_gap_is_there) {
    Opened o;
    o.start();
    for (const int idle_ms : {1500, 700}) {  // beyond the library's polls and patience with packets
        EXPECT_FALSE(o.camera->read(idle_ms).has_value());
        o.device().trigger();
        (void)o.read();
    }
    EXPECT_EQ(o.camera->counts().missing_ids, 0u);
}

TEST(AravisTimes, are_those_of_the_exposures_in_nanoseconds_whatever_the_cameras_ticks) {
    GigeOptions options;
    options.ticks_hz = 125'000'000;
    options.description.lacks = {"TimestampLatch", "ChunkModeActive"};  // an older model: registers tell its time
    Opened o(options);
    const uint64_t before_ns = o.device().now_ns();
    const uint64_t started_ns = o.start();
    EXPECT_GE(started_ns + 8, before_ns);
    EXPECT_LE(started_ns, o.device().now_ns());
    EXPECT_EQ(o.camera->info().clock_step_ns, 8u);
    const uint64_t first_ns = o.device().now_ns();
    o.device().trigger();
    const Frame frame = o.read();
    EXPECT_GE(frame.stamp.timestamp_ns + 8, first_ns);
    EXPECT_LE(frame.stamp.timestamp_ns, o.device().now_ns());
}

TEST(AravisTimes, are_of_the_frames_own_chunk_where_the_leaders_are_of_something_else) {
    Opened o;  // whose leaders are a millisecond late
    o.start();
    EXPECT_NE(o.camera->info().link.find("times by chunk data"), std::string::npos) << o.camera->info().link;
    o.device().trigger();
    const uint64_t after_ns = o.device().now_ns();
    EXPECT_LE(o.read().stamp.timestamp_ns, after_ns);
}

TEST(AravisTimes, of_a_camera_that_cannot_be_asked_are_bounded_by_zero_and_go_on) {
    for (const bool latches_nothing : {false, true}) {
        GigeOptions options;
        options.description.lacks = {"TimestampLatch"};
        if (latches_nothing)
            options.clock_ns = [] { return uint64_t(5); };
        else
            options.ticks_hz = 1'000'000'000;
        Opened o(options);
        const uint64_t started_ns = o.start();
        if (latches_nothing) {
            EXPECT_EQ(started_ns, 0u);
        }
        const uint64_t first_ns = o.camera->watermark_ns();
        while (o.camera->watermark_ns() <= first_ns + 1'000'000) std::this_thread::yield();
        EXPECT_EQ(o.camera->state().kind, CameraState::live);
    }
}

TEST(AravisGone, unplugged_while_idle_armed_or_recording_it_says_so) {
    Opened idle, armed, recording;  // at once, as a heart that does not beat takes its time
    armed.start();
    recording.start();
    recording.device().trigger();
    (void)recording.read();
    recording.device().trigger();
    for (Opened* o : {&idle, &armed, &recording}) o->device().unplug();
    for (Opened* o : {&idle, &armed, &recording}) {
        const CameraState state = o->state_after_all();
        EXPECT_EQ(state.kind, CameraState::gone);
        EXPECT_NE(state.why.find("check its power and cable"), std::string::npos) << state.why;
        EXPECT_FALSE(o->camera->start().ok());
    }
}

TEST(AravisGone, a_set_up_without_an_answer_says_what_became_of_it) {
    Opened o;
    o.device().unplug();
    EXPECT_NE(o.set_up().find("gone"), std::string::npos);
}

std::string error_of(const Result<std::unique_ptr<Camera>>& opened) {
    return opened.ok() ? "" : opened.error().message;
}

TEST(AravisOpen, one_that_another_program_controls_is_in_use) {
    Opened o;
    EXPECT_NE(error_of(open_camera("aravis:" + o.rig.address())).find("in use"), std::string::npos);
}

TEST(AravisOpen, a_name_that_nobody_has_is_answered_with_what_to_look_at) {
    const std::string message = error_of(open_camera("aravis:no-such-camera"));
    EXPECT_NE(message.find("arv-tool-0.8"), std::string::npos) << message;
}

TEST(AravisOpen, the_only_camera_needs_no_name_and_several_are_listed) {
    if (!is_alone) GTEST_SKIP() << "user namespaces are off: cameras of others may be on this network";
    EXPECT_NE(error_of(open_camera("aravis:")).find("there is no GigE Vision or USB3 Vision camera"),
              std::string::npos);
    GigeOptions options;
    options.serial = "SN7";
    GigeRig one(options);
    {
        const auto only = open_camera("aravis:");
        ASSERT_TRUE(only.ok()) << error_of(only);
        EXPECT_EQ((*only)->info().name, "OLS Line SN7");
    }
    EXPECT_EQ(error_of(open_camera("aravis:SN7")), "");
    options.serial = "SN8";
    GigeRig other(options);
    const std::string message = error_of(open_camera("aravis:"));
    EXPECT_NE(message.find("aravis:SN7 (OLS Line)"), std::string::npos) << message;
    EXPECT_NE(message.find("aravis:SN8 (OLS Line)"), std::string::npos) << message;
}

TEST(AravisFake, what_its_link_loses_is_counted_to_the_last_frame) {
    ArvFakeRig rig;
    const auto camera = rig.open();
    ASSERT_TRUE(camera && camera->set_up(rig.fitting_setup()).ok() && camera->start().ok());
    rig.expose(1);
    ASSERT_TRUE(camera->read(surely_ms).has_value());  // it has gone out before any is lost
    rig.set_lost_ratio(0.1);
    rig.expose(100);
    rig.set_lost_ratio(0);
    rig.expose(1);
    std::vector<uint64_t> ids = {1};
    while (ids.back() != 102) {
        const auto frame = camera->read(surely_ms);
        ASSERT_TRUE(frame.has_value());
        ids.push_back(frame->stamp.frame_id);
    }
    const CameraCounts counts = camera->counts();
    EXPECT_EQ(ids.size() + counts.missing_ids, 102u);
    EXPECT_GT(counts.missing_ids, 0u) << "of 300 packets a tenth";
    EXPECT_LE(counts.underrun, counts.missing_ids) << "of some not one packet came";
}

}  // namespace ols::test
