// SPDX-License-Identifier: MIT
// doctor's checks of a GigE camera's network, against made-up kernels, and routes and interfaces against `ip`.
// links: ols_doctor
#include "doctor/route.hpp"
#include "made_up_machine.hpp"

using namespace ols;

namespace {

// 192.168.7.0/24 is at eth1 itself; everything else goes to a router at eth0.
constexpr const char* routes =
    "Iface\tDestination\tGateway \tFlags\tRefCnt\tUse\tMetric\tMask\t\tMTU\tWindow\tIRTT\n"
    "eth0\t00000000\t0101A8C0\t0003\t0\t0\t0\t00000000\t0\t0\t0\n"
    "eth1\t0007A8C0\t00000000\t0001\t0\t0\t0\t00FFFFFF\t0\t0\t0\n";

class GigeNetwork : public DoctorTest {
  protected:
    GigeNetwork() {
        put("/proc/net/route", routes);
        put("/proc/sys/net/core/rmem_max", "33554432\n");
        put("/proc/sys/net/core/rmem_default", "33554432\n");
        put_port("eth1", 9000);
        set_filter("all", 0);
        set_filter("eth1", 0);
    }
    void put_port(const std::string& name, int mtu) {
        put("/sys/class/net/" + name + "/mtu", std::to_string(mtu) + "\n");
        put("/sys/class/net/" + name + "/operstate", "up\n");
        put("/sys/class/net/" + name + "/address", "02:00:00:00:00:01\n");
    }
    void set_filter(const std::string& name, int value) {
        put("/proc/sys/net/ipv4/conf/" + name + "/rp_filter", std::to_string(value) + "\n");
    }
};

TEST_F(GigeNetwork, is_well_with_room_jumbo_frames_and_no_filter) {
    give_camera("aravis:192.168.7.2", 53);
    const Findings findings = check_network(up);
    for (const Check check : {Check::rmem_max, Check::rmem_default, Check::mtu, Check::rp_filter})
        expect(findings, check, CheckVerdict::ok);
    expect(findings, Check::packet_socket, CheckVerdict::warn, "no CAP_NET_RAW");
}

TEST_F(GigeNetwork, is_not_looked_at_without_a_camera_on_it) {
    give_camera("v4l2:0", 53);
    for (const Finding& finding : check_network(up)) EXPECT_EQ(finding.verdict, CheckVerdict::skipped) << finding.id();
}

// 53 MB/s times 0.1 s are 5.3 MB.
TEST_F(GigeNetwork, needs_a_socket_for_a_tenth_of_a_second) {
    give_camera("aravis:192.168.7.2", 53);
    put("/proc/sys/net/core/rmem_max", "5299999\n");
    put("/proc/sys/net/core/rmem_default", "5300000\n");
    const Findings findings = check_network(up);
    expect(findings, Check::rmem_max, CheckVerdict::fail, "5299999 bytes");
    expect(findings, Check::rmem_default, CheckVerdict::ok, "5300000 bytes");
    EXPECT_NE(only(findings, Check::rmem_max).needed.find("5300000 bytes"), std::string::npos);
    EXPECT_NE(only(findings, Check::rmem_max).commands[0].find("net.core.rmem_max = 33554432"), std::string::npos);
}

TEST_F(GigeNetwork, needs_no_larger_socket_than_the_driver_asks_for) {
    give_camera("aravis:192.168.7.2", 1000);
    expect(check_network(up), Check::rmem_max, CheckVerdict::ok);
    put("/proc/sys/net/core/rmem_max", "33554431\n");
    expect(check_network(up), Check::rmem_max, CheckVerdict::fail);
}

TEST_F(GigeNetwork, that_the_kernel_does_not_show_is_not_well) {
    give_camera("aravis:192.168.7.2", 53);
    std::filesystem::remove(machine.place("/proc/sys/net/core/rmem_max"));
    std::filesystem::remove(machine.place("/sys/class/net/eth1/mtu"));
    expect(check_network(up), Check::rmem_max, CheckVerdict::skipped);
    expect(check_network(up), Check::mtu, CheckVerdict::skipped, "eth1");
}

TEST_F(GigeNetwork, with_small_packets_is_warned_of_with_a_setting_that_lasts) {
    give_camera("aravis:192.168.7.2", 53);
    put_port("eth1", 1500);
    const Findings findings = check_network(up);
    expect(findings, Check::mtu, CheckVerdict::warn, "1500 bytes on eth1");
    EXPECT_NE(only(findings, Check::mtu).commands[0].find("MACAddress=02:00:00:00:00:01\\n[Link]\\nMTUBytes=9000"),
              std::string::npos);
}

TEST_F(GigeNetwork, of_a_camera_that_is_found_by_its_serial_number_is_that_of_its_address) {
    give_camera("aravis:SN7", 53, {{"id", "maker", "model", "SN7", "192.168.7.9", "GigEVision"}});
    expect(check_network(up), Check::mtu, CheckVerdict::ok, "eth1");
}

TEST_F(GigeNetwork, does_not_matter_to_a_usb3_camera) {
    give_camera("aravis:SN8", 53, {{"id", "maker", "model", "SN8", "", "USB3Vision"}});
    expect(check_network(up), Check::rmem_max, CheckVerdict::skipped);
}

TEST_F(GigeNetwork, of_a_camera_that_is_not_found_has_no_interface_yet_needs_a_socket) {
    give_camera("aravis:SN7", 53);
    put("/proc/sys/net/core/rmem_max", "212992\n");
    const Findings findings = check_network(up);
    expect(findings, Check::mtu, CheckVerdict::skipped, "'aravis:SN7' is not found");
    expect(findings, Check::rmem_max, CheckVerdict::fail);
}

TEST_F(GigeNetwork, may_be_strict_where_the_camera_is_in_its_own_network) {
    give_camera("aravis:192.168.7.2", 53);
    set_filter("eth1", 1);
    expect(check_network(up), Check::rp_filter, CheckVerdict::ok, "1 on eth1");
}

TEST_F(GigeNetwork, may_not_be_strict_where_the_camera_is_behind_a_router) {
    give_camera("aravis:10.0.0.2", 53);
    put_port("eth0", 9000);
    set_filter("all", 1);  // the higher of the two counts
    expect(check_network(up), Check::rp_filter, CheckVerdict::warn, "1 on eth0");
    set_filter("eth0", 2);
    expect(check_network(up), Check::rp_filter, CheckVerdict::ok, "2 on eth0");
}

TEST_F(GigeNetwork, that_is_strict_may_be_why_a_camera_is_not_found) {
    give_camera("aravis:SN7", 53);
    expect(check_network(up), Check::rp_filter, CheckVerdict::skipped);
    set_filter("eth1", 1);
    expect(check_network(up), Check::rp_filter, CheckVerdict::warn, "strict on eth1");
}

TEST_F(GigeNetwork, has_a_packet_socket_for_who_has_the_capability) {
    give_camera("aravis:192.168.7.2", 53);
    be_user("1000", "1000", uint64_t(1) << 13);
    expect(check_network(up), Check::packet_socket, CheckVerdict::ok);
    be_user("1000", "1000", ~(uint64_t(1) << 13));
    expect(check_network(up), Check::packet_socket, CheckVerdict::warn);
}

TEST_F(GigeNetwork, is_the_loopback_for_a_camera_of_this_machine) {
    give_camera("aravis:127.0.0.1", 53);
    put_port("lo", 65536);
    expect(check_network(up), Check::mtu, CheckVerdict::ok, "65536 bytes on lo");
    expect(check_network(up), Check::packet_socket, CheckVerdict::skipped);
}

TEST_F(GigeNetwork, is_chosen_by_the_longest_prefix) {
    EXPECT_EQ(route_to(machine, "192.168.7.200")->interface, "eth1");
    EXPECT_TRUE(route_to(machine, "192.168.7.200")->is_direct);
    EXPECT_EQ(route_to(machine, "192.168.8.1")->interface, "eth0");
    EXPECT_FALSE(route_to(machine, "192.168.8.1")->is_direct);
    put("/proc/net/route", "");
    EXPECT_FALSE(route_to(machine, "192.168.7.200"));
}

// The machine that the test runs on: what we read of it is what iproute2 reads.
std::string output_of(const std::string& command) {
    std::string text;
    FILE* const pipe = popen((command + " 2>/dev/null").c_str(), "r");
    char buffer[4096];
    while (pipe && std::fgets(buffer, sizeof buffer, pipe)) text += buffer;
    if (pipe) pclose(pipe);
    return text;
}

TEST(ThisMachine, has_the_interfaces_and_kinds_that_iproute2_sees) {
    const Machine here;
    const auto names = here.list("/sys/class/net");
    ASSERT_FALSE(names.empty());
    for (const std::string& name : names) {
        if (!here.exists("/sys/class/net/" + name + "/mtu")) continue;  // bonding_masters is a file
        const std::string line = output_of("ip -details -oneline link show dev " + name);
        if (line.empty()) GTEST_SKIP() << "no iproute2";
        EXPECT_NE(line.find(" mtu " + here.read("/sys/class/net/" + name + "/mtu").value() + " "), std::string::npos)
            << line;
        const auto details = here.link_details(name);
        ASSERT_TRUE(details) << name;
        if (!details->kind.empty()) {
            EXPECT_NE(line.find(" " + details->kind + " "), std::string::npos) << line;
        }
    }
    EXPECT_FALSE(here.link_details("no-such-port"));
}

TEST(ThisMachine, has_the_route_that_iproute2_sees) {
    const auto route = route_to(Machine(), "8.8.8.8");
    const std::string line = output_of("ip -4 route get 8.8.8.8");
    if (line.empty()) GTEST_SKIP() << "no route out of this machine, or no iproute2";
    ASSERT_TRUE(route);
    EXPECT_NE(line.find(" dev " + route->interface + " "), std::string::npos) << line;
    EXPECT_EQ(line.find(" via ") == std::string::npos, route->is_direct) << line;
}

}  // namespace
