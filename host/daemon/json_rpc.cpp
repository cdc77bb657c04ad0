// SPDX-License-Identifier: MIT
// Requests into calls, and outcomes into responses.
#include "daemon/json_rpc.hpp"

#include <fmt/format.h>

#include "exceptions.hpp"
#include "image/json_object.hpp"

namespace ols {

namespace {

using nlohmann::json;

json response(const json& id, const RpcOutcome& outcome) {
    if (outcome.error) return outcome.error->to_json(id);
    return {{"jsonrpc", "2.0"}, {"id", id}, {"result", outcome.result}};
}

// Why a value is no request; empty when it is one.
std::string defect_of(const json& request) {
    if (!request.is_object()) return "a request is an object";
    for (const auto& [key, value] : request.items())
        if (key != "jsonrpc" && key != "method" && key != "params" && key != "id")
            return "a request has jsonrpc, method, params and id, and not " + key;
    if (request.value("jsonrpc", json()) != "2.0") return R"(a request has "jsonrpc": "2.0")";
    if (!request.contains("method") || !request["method"].is_string()) return "a request has a method, a text";
    if (request.contains("params") && !request["params"].is_object()) return "params are an object: {\"name\": value}";
    return "";
}

// An id that may be sent back: a text or a number (fractions are what the specification advises against), or null.
json id_of(const json& request) {
    if (!request.is_object() || !request.contains("id")) return nullptr;
    const json& id = request["id"];
    return id.is_string() || id.is_number_integer() ? id : json(nullptr);
}

std::optional<json> answer_one(const json& request, const RpcCall& call) {
    const json id = id_of(request);
    if (const std::string defect = defect_of(request); !defect.empty())
        return response(id, {nullptr, RpcError{RpcError::invalid_request, defect}});
    if (request.contains("id") && id.is_null() && !request["id"].is_null())
        return response(id, {nullptr, RpcError{RpcError::invalid_request, "an id is a text or a whole number"}});
    const auto outcome = guarded("the call failed", [&]() -> Result<RpcOutcome> {
        return call(request["method"].get<std::string>(), request.value("params", json::object()));
    });
    if (!request.contains("id")) return std::nullopt;
    if (!outcome) return response(id, {nullptr, RpcError{RpcError::internal_error, outcome.error().message}});
    return response(id, *outcome);
}

std::optional<std::string> answer_batch(const json& batch, const RpcCall& call) {
    const auto refuse = [](const std::string& why) {
        return json_line(RpcError{RpcError::invalid_request, why}.to_json(nullptr));
    };
    if (batch.empty()) return refuse("a batch has requests");
    if (batch.size() > batch_max) return refuse(fmt::format("a batch has at most {} requests", batch_max));
    json answers = json::array();
    for (const json& request : batch)
        if (auto answer = answer_one(request, call)) answers.push_back(std::move(*answer));
    if (answers.empty()) return std::nullopt;
    return json_line(answers);
}

}  // namespace

json RpcError::to_json(const json& id) const {
    return {{"jsonrpc", "2.0"}, {"id", id}, {"error", {{"code", int(code)}, {"message", message}}}};
}

std::optional<std::string> answer_rpc(std::string_view text, const RpcCall& call) {
    const auto parsed = parse_json(text, "the request");
    if (!parsed) return json_line(RpcError{RpcError::parse_error, parsed.error().message}.to_json(nullptr));
    if (parsed->is_array()) return answer_batch(*parsed, call);
    const auto answer = answer_one(*parsed, call);
    if (!answer) return std::nullopt;
    return json_line(*answer);
}

}  // namespace ols
