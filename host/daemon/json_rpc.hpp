// SPDX-License-Identifier: MIT
// JSON-RPC 2.0 (jsonrpc.org/specification): one text in, one text or nothing out. It knows no method of its own.
#pragma once

#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>

namespace ols {

// Why a call failed. Codes: the specification's own, section 5.1, and those of this program from its range for servers.
struct RpcError {
    enum Code {
        parse_error = -32700,
        invalid_request = -32600,
        method_not_found = -32601,
        invalid_params = -32602,
        internal_error = -32603,
        failed = -32000,       // what was asked for cannot be done now; the message says why, and what to do
        wrong_state = -32001,  // the state does not allow it
        too_much = -32002,     // more than this client may ask for
    } code = internal_error;
    std::string message;

    nlohmann::json to_json(const nlohmann::json& id) const;  // a response
};

// The result, or an error.
struct RpcOutcome {
    nlohmann::json result;
    std::optional<RpcError> error = std::nullopt;
};

using RpcCall = std::function<RpcOutcome(const std::string& method, const nlohmann::json& params)>;

// One request or a batch. Nothing for notifications. A batch has at most batch_max requests. `params` are an object or left out: names
// say what is meant. Never throws.
constexpr size_t batch_max = 16;
std::optional<std::string> answer_rpc(std::string_view text, const RpcCall& call);

}  // namespace ols
