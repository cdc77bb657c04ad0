// SPDX-License-Identifier: MIT
// doctor's checks of permissions, CAN, GPIO, boards and cameras, against made-up kernels and devices.
// links: ols_doctor
#include "doctor/check_up.hpp"
#include "doctor/shipped.hpp"
#include "made_up_machine.hpp"
#include "scripted_board.hpp"

using namespace ols;

namespace {

std::string rules_of_this_release() {
    std::ifstream file("host/device/60-open-light-stage.rules");
    return {std::istreambuf_iterator<char>(file), {}};
}

class PermissionsOfAStage : public DoctorTest {
  protected:
    void plug_in(const std::string& name, const std::string& vendor, const std::string& product,
                 const std::string& words) {
        const std::string folder = "/sys/bus/usb/devices/" + name;
        put(folder + "/idVendor", vendor + "\n");
        put(folder + "/idProduct", product + "\n");
        put(folder + "/product", words + "\n");
        put(folder + "/busnum", "1\n");
        put(folder + "/devnum", "7\n");
        put("/dev/bus/usb/001/007", "");
    }
};

TEST_F(PermissionsOfAStage, without_devices_are_not_looked_at) {
    for (const Finding& finding : check_permissions(up))
        EXPECT_EQ(finding.verdict, CheckVerdict::skipped) << finding.id();
}

TEST_F(PermissionsOfAStage, need_the_rules_of_this_release) {
    up.board_link = "usb:";
    expect(check_permissions(up), Check::udev_rules, CheckVerdict::fail, "no 60-open-light-stage.rules");
    put("/usr/local/lib/udev/rules.d/60-open-light-stage.rules", "# someone's own words\n\n" + rules_of_this_release());
    expect(check_permissions(up), Check::udev_rules, CheckVerdict::ok, "/usr/local/lib/udev/rules.d/");
}

// A file in /etc hides those of its name.
TEST_F(PermissionsOfAStage, are_those_of_the_file_that_udev_reads) {
    up.board_link = "usb:";
    put("/usr/lib/udev/rules.d/60-open-light-stage.rules", rules_of_this_release());
    put("/etc/udev/rules.d/60-open-light-stage.rules", "SUBSYSTEM==\"usb\", MODE=\"0660\"\n");
    expect(check_permissions(up), Check::udev_rules, CheckVerdict::warn, "/etc/udev/rules.d/");
}

TEST_F(PermissionsOfAStage, name_the_group_that_is_missing) {
    give_camera("v4l2:0", 1);
    put("/dev/video0", "");
    expect(check_permissions(up), Check::groups, CheckVerdict::warn, "ada is not in it");
    EXPECT_NE(only(check_permissions(up), Check::groups).commands[0].find("usermod -aG video ada"), std::string::npos);
    put("/etc/group", "video:x:44:ben,ada\nada:x:1000:\n");
    expect(check_permissions(up), Check::groups, CheckVerdict::warn, "not yet in this login");
    be_user("1000", "44 1000", 0);
    expect(check_permissions(up), Check::groups, CheckVerdict::ok);
}

TEST_F(PermissionsOfAStage, of_root_say_nothing_of_who_records) {
    give_camera("v4l2:0", 1);
    be_user("0", "0", ~uint64_t(0));
    expect(check_permissions(up), Check::groups, CheckVerdict::skipped, "run doctor as the user");
}

TEST_F(PermissionsOfAStage, include_every_node_that_is_named) {
    give_camera("v4l2:2", 1);
    expect(check_permissions(up), Check::nodes, CheckVerdict::fail, "no such node");
    put("/dev/video2", "");
    expect(check_permissions(up), Check::nodes, CheckVerdict::ok);
    machine.closed = {"/dev/video2"};
    expect(check_permissions(up), Check::nodes, CheckVerdict::fail, "ada may not open it");
}

TEST_F(PermissionsOfAStage, include_the_board_on_usb_and_no_other_device) {
    up.board_link = "usb:";
    plug_in("1-2", "1209", "0001", "someone else's");
    expect(check_permissions(up), Check::nodes, CheckVerdict::skipped);
    plug_in("1-2", "1209", "0001", "light stage sequencer");
    machine.closed = {"/dev/bus/usb/001/007"};
    expect(check_permissions(up), Check::nodes, CheckVerdict::fail);
}

TEST_F(PermissionsOfAStage, include_a_usb3_camera_by_the_class_of_its_interface) {
    give_camera("aravis:SN8", 1, {{"id", "maker", "model", "SN8", "", "USB3Vision"}});
    plug_in("2-1", "abcd", "0001", "camera");
    expect(check_permissions(up), Check::nodes, CheckVerdict::skipped);
    put("/sys/bus/usb/devices/2-1:1.0/bInterfaceClass", "ef\n");
    put("/sys/bus/usb/devices/2-1:1.0/bInterfaceSubClass", "05\n");
    put("/sys/bus/usb/devices/2-1:1.0/bInterfaceProtocol", "00\n");
    expect(check_permissions(up), Check::nodes, CheckVerdict::ok);
}

class CanOfAStage : public DoctorTest {
  protected:
    CanOfAStage() {
        up.board_link = "can:can0#3";
        put("/proc/sys/kernel/osrelease", "6.1.0\n");
    }
    void put_interface(const std::string& flags, const std::string& queue, int type = 280) {
        put("/sys/class/net/can0/type", std::to_string(type) + "\n");
        put("/sys/class/net/can0/flags", flags + "\n");
        put("/sys/class/net/can0/tx_queue_len", queue + "\n");
    }
};

TEST_F(CanOfAStage, is_not_looked_at_without_one) {
    up.board_link = "can-socket:/run/can.sock";
    for (const Finding& finding : check_can(up)) EXPECT_EQ(finding.verdict, CheckVerdict::skipped) << finding.id();
}

TEST_F(CanOfAStage, is_well) {
    put_interface("0x40041", "1000");
    machine.links["can0"] = {"can", 1'000'000, false};
    put("/sys/module/can_isotp/version", "");
    for (const Finding& finding : check_can(up)) EXPECT_EQ(finding.verdict, CheckVerdict::ok) << finding.id();
}

TEST_F(CanOfAStage, is_there_of_the_right_kind_and_up) {
    expect(check_can(up), Check::can_interface, CheckVerdict::fail, "no such interface");
    put_interface("0x1003", "1000", 1);
    expect(check_can(up), Check::can_interface, CheckVerdict::fail, "no CAN interface");
    put_interface("0x40040", "1000");
    expect(check_can(up), Check::can_interface, CheckVerdict::fail, "down");
    put_interface("0x40041", "1000");
    machine.links["can0"] = {"can", 1'000'000, true};
    expect(check_can(up), Check::can_interface, CheckVerdict::fail, "bus off");
}

TEST_F(CanOfAStage, has_the_bit_rate_of_the_boards) {
    put_interface("0x40041", "1000");
    machine.links["can0"] = {"can", 250'000, false};
    expect(check_can(up), Check::can_bit_rate, CheckVerdict::fail, "250000");
    machine.links["can0"] = {"can", 500'000, false};
    expect(check_can(up), Check::can_bit_rate, CheckVerdict::warn);
    machine.links["can0"] = {"vcan", 0, false};
    expect(check_can(up), Check::can_bit_rate, CheckVerdict::skipped, "vcan");
}

TEST_F(CanOfAStage, has_a_queue_for_a_message) {
    put_interface("0x40041", "10");
    expect(check_can(up), Check::can_queue, CheckVerdict::warn, "10 frames");
    put_interface("0x40041", "155");
    expect(check_can(up), Check::can_queue, CheckVerdict::ok);
}

TEST_F(CanOfAStage, has_isotp_built_in_loaded_or_to_be_loaded) {
    expect(check_can(up), Check::can_isotp, CheckVerdict::warn, "6.1.0");
    put("/lib/modules/6.1.0/modules.dep", "kernel/net/can/can-raw.ko: kernel/net/can/can.ko\n");
    expect(check_can(up), Check::can_isotp, CheckVerdict::warn);
    put("/lib/modules/6.1.0/modules.dep", "kernel/net/can/can-isotp.ko.xz: kernel/net/can/can.ko\n");
    expect(check_can(up), Check::can_isotp, CheckVerdict::ok, "when it is asked for");
    put("/lib/modules/6.1.0/modules.builtin", "kernel/net/can/can-isotp.ko\n");
    expect(check_can(up), Check::can_isotp, CheckVerdict::ok, "built");
}

TEST_F(CanOfAStage, includes_the_lamp_nodes) {
    up.board_link = "usb:";
    up.stage.telemetry.bus = "can:can1";
    const Findings findings = check_can(up);
    expect(findings, Check::can_interface, CheckVerdict::fail);
    EXPECT_EQ(only(findings, Check::can_interface).subject, "can1");
    expect(findings, Check::can_isotp, CheckVerdict::skipped);
}

class DevicesOfAStage : public DoctorTest {};

TEST_F(DevicesOfAStage, that_are_not_named_are_skipped) {
    give_camera("", 1);
    for (const auto family : {check_board, check_cameras, check_gpio})
        for (const Finding& finding : family(up)) EXPECT_EQ(finding.verdict, CheckVerdict::skipped) << finding.id();
}

TEST_F(DevicesOfAStage, a_board_that_does_not_answer_fails_and_nothing_is_said_of_it) {
    up.board_link = "usb:";
    const Findings findings = check_board(up);
    expect(findings, Check::board_link, CheckVerdict::fail, "no board in this test");
    expect(findings, Check::board_firmware, CheckVerdict::skipped);
    expect(findings, Check::board_fault, CheckVerdict::skipped);
}

class BoardOfAStage : public DoctorTest {
  protected:
    BoardOfAStage() {
        up.board_link = "usb:";
        std::strcpy(hello_.firmware_version, shipped_firmware);
        std::strcpy(hello_.board, "pico");
        up.open_board = [this] {
            return Board::connect(std::make_unique<ScriptedBoard>(
                [this](uint16_t type, const Bytes&) {
                    return Answer{uint16_t(type | OLS_REPLY), type == OLS_HELLO ? bytes_of(hello_) : bytes_of(status_)};
                },
                4096));
        };
    }

    ols_hello_reply hello_ = hello_reply();
    ols_status_reply status_{};
};

TEST_F(BoardOfAStage, is_well_when_idle_and_of_this_release) {
    const Findings findings = check_board(up);
    expect(findings, Check::board_link, CheckVerdict::ok, "1011121314151617");
    expect(findings, Check::board_firmware, CheckVerdict::ok, "pico");
    expect(findings, Check::board_fault, CheckVerdict::ok, "idle");
}

TEST_F(BoardOfAStage, of_another_release_is_warned_of) {
    std::strcpy(hello_.firmware_version, "9.9.9");
    expect(check_board(up), Check::board_firmware, CheckVerdict::warn, "9.9.9");
}

TEST_F(BoardOfAStage, with_another_chain_can_not_play) {
    hello_.chain_bits = 96;
    expect(check_board(up), Check::board_firmware, CheckVerdict::fail, "chain of 96 bits");
}

TEST_F(BoardOfAStage, with_a_latched_fault_names_it) {
    status_.state = OLS_STATE_FAULT;
    status_.fault = OLS_FAULT_SLIPPED;
    expect(check_board(up), Check::board_fault, CheckVerdict::fail, "slipped");
    EXPECT_NE(only(check_board(up), Check::board_fault).commands[0].find("--clear-fault"), std::string::npos);
}

TEST_F(BoardOfAStage, that_plays_belongs_to_a_take) {
    for (const uint8_t state : {OLS_STATE_ARMED, OLS_STATE_PLAYING, OLS_STATE_WAITING}) {
        status_.state = state;
        expect(check_board(up), Check::board_fault, CheckVerdict::warn);
    }
}

TEST_F(DevicesOfAStage, a_camera_is_opened_and_set_up) {
    give_camera("fake:100", 1);
    const Findings findings = check_cameras(up);
    expect(findings, Check::camera_link, CheckVerdict::ok, "fake:100");
    expect(findings, Check::camera_setup, CheckVerdict::ok, "640 x 480, 12 bits");
}

TEST_F(DevicesOfAStage, a_camera_that_takes_another_size_fails_by_its_key) {
    give_camera("fake:100", 1);
    up.stage.cameras[0].width = 8192;
    expect(check_cameras(up), Check::camera_setup, CheckVerdict::fail, "width");
}

TEST_F(DevicesOfAStage, a_camera_that_is_not_there_fails_and_is_not_set_up) {
    give_camera("ring:/no/such/ring", 1);
    const Findings findings = check_cameras(up);
    expect(findings, Check::camera_link, CheckVerdict::fail);
    expect(findings, Check::camera_setup, CheckVerdict::skipped);
}

TEST_F(DevicesOfAStage, a_line_of_a_chip_that_is_not_there_fails) {
    up.stage.gpio.chip = "no-such-chip";
    up.stage.gpio.arm = GpioLineSetup{};
    expect(check_gpio(up), Check::gpio_lines, CheckVerdict::fail, "no GPIO chip 'no-such-chip'");
}

TEST_F(DevicesOfAStage, a_camera_of_no_name_is_the_only_one_there_is) {
    const std::vector<AravisListing> one = {{"id", "", "", "SN1", "10.0.0.1", "GigEVision"}};
    EXPECT_EQ(place_cameras({"aravis:"}, one)[0].address, "10.0.0.1");
    EXPECT_EQ(place_cameras({"aravis:"}, {one[0], one[0]})[0].kind, CameraPlace::aravis);
    EXPECT_EQ(place_cameras({"aravis:SN2"}, one)[0].kind, CameraPlace::aravis);
    EXPECT_EQ(place_cameras({"aravis:10.0.0.9"}, one)[0].address, "10.0.0.9");
}

TEST_F(DevicesOfAStage, all_checks_give_a_finding_each) {
    give_camera("fake:100", 1);
    std::set<Check> made;
    for (const Finding& finding : check_all(up)) made.insert(finding.check);
    EXPECT_EQ(made.size(), size_t(Check::count));
}

}  // namespace
