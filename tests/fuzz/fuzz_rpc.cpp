// SPDX-License-Identifier: MIT
// What a client of the daemon may send: any bytes are answered with one line of JSON, or not at all.
// links: ols_daemon
#include <cstdlib>
#include <cstring>

#include "daemon/json_rpc.hpp"
#include "daemon/states.hpp"
#include "image/json_object.hpp"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    using namespace ols;
    const std::string text(reinterpret_cast<const char*>(data), size);
    const auto answer = answer_rpc(text, [](const std::string& method, const nlohmann::json& params) -> RpcOutcome {
        if (!find_method(method)) return {nullptr, RpcError{RpcError::method_not_found, method}};
        JsonObject given(params, method);
        if (given.has("seconds")) (void)given.number("seconds", 0, 10);
        if (given.has("slate")) (void)given.text("slate");
        if (const Status known = given.finish(); !known)
            return {nullptr, RpcError{RpcError::invalid_params, known.error().message}};
        return {params};
    });
    if (answer && (answer->find('\n') != std::string::npos || !nlohmann::json::accept(*answer))) std::abort();
    return 0;
}
