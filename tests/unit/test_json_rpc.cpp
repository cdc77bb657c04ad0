// SPDX-License-Identifier: MIT
// JSON-RPC 2.0 against the specification's own examples (jsonrpc.org/specification, section 7), and what comes from anywhere.
// links: ols_daemon
#include "daemon/json_rpc.hpp"

#include <gtest/gtest.h>

namespace ols {
namespace {

using nlohmann::json;

RpcOutcome subtract(const std::string& method, const json& params) {
    if (method == "throws") throw std::runtime_error("a bug");
    if (method != "subtract") return {nullptr, RpcError{RpcError::method_not_found, "Method not found"}};
    return {params.at("minuend").get<int>() - params.at("subtrahend").get<int>()};
}

std::optional<json> answer(const std::string& text) {
    const auto line = answer_rpc(text, subtract);
    if (!line) return std::nullopt;
    EXPECT_EQ(line->find('\n'), std::string::npos);
    return json::parse(*line);
}

int code_of(const std::string& text) {
    const auto answered = answer(text);
    return answered ? answered->value("error", json::object()).value("code", 0) : 1;
}

TEST(JsonRpc, named_parameters_are_passed_in_any_order) {
    EXPECT_EQ(
        answer(R"({"jsonrpc": "2.0", "method": "subtract", "params": {"subtrahend": 23, "minuend": 42}, "id": 3})"),
        json::parse(R"({"jsonrpc": "2.0", "result": 19, "id": 3})"));
    EXPECT_EQ(
        answer(R"({"jsonrpc": "2.0", "method": "subtract", "params": {"minuend": 42, "subtrahend": 23}, "id": "4"})"),
        json::parse(R"({"jsonrpc": "2.0", "result": 19, "id": "4"})"));
}

TEST(JsonRpc, notifications_have_no_answer) {
    EXPECT_FALSE(answer(R"({"jsonrpc": "2.0", "method": "update"})"));
    EXPECT_FALSE(answer(R"({"jsonrpc": "2.0", "method": "throws"})"));
    EXPECT_FALSE(answer(R"([{"jsonrpc": "2.0", "method": "a"}, {"jsonrpc": "2.0", "method": "b"}])"));
}

TEST(JsonRpc, errors_are_those_of_the_specification) {
    EXPECT_EQ(code_of(R"({"jsonrpc": "2.0", "method": "foobar", "id": "1"})"), -32601);
    EXPECT_EQ(code_of(R"({"jsonrpc": "2.0", "method": "foobar, "params": "bar", "baz])"), -32700);
    EXPECT_EQ(code_of(R"({"jsonrpc": "2.0", "method": 1, "params": "bar"})"), -32600);
    EXPECT_EQ(code_of("[]"), -32600);
    EXPECT_EQ(code_of(""), -32700);
    EXPECT_EQ(code_of("\xff\xfe"), -32700);
    EXPECT_EQ(code_of(R"({"jsonrpc": "2.0", "method": "throws", "id": 1})"), -32603);
    EXPECT_EQ(code_of(R"({"jsonrpc": "2.0", "method": "subtract", "id": 1, "extra": 1})"), -32600);
    EXPECT_EQ(code_of(R"({"jsonrpc": "2.0", "method": "subtract", "id": [1]})"), -32600);
    EXPECT_EQ(code_of(std::string(100'000, '[')), -32700);
}

TEST(JsonRpc, batches_are_answered_one_by_one_and_bounded) {
    const auto answers = answer(R"([
        {"jsonrpc": "2.0", "method": "subtract", "params": {"minuend": 42, "subtrahend": 23}, "id": "2"},
        {"jsonrpc": "2.0", "method": "notify"}, {"foo": "boo"}, 1])");
    ASSERT_TRUE(answers && answers->is_array());
    ASSERT_EQ(answers->size(), 3u);
    EXPECT_EQ((*answers)[0]["result"], 19);
    EXPECT_EQ((*answers)[1]["error"]["code"], -32600);
    EXPECT_EQ((*answers)[2]["error"]["code"], -32600);
    json many = json::array();
    for (size_t n = 0; n <= batch_max; ++n) many.push_back({{"jsonrpc", "2.0"}, {"method", "x"}, {"id", n}});
    EXPECT_EQ(code_of(many.dump()), -32600);
}

}  // namespace
}  // namespace ols
