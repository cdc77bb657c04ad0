// SPDX-License-Identifier: MIT
// cpp-httplib, behind checks that come before a request's body is read.
#include "daemon/http_server.hpp"

#include <fmt/format.h>

#include <atomic>
#include <filesystem>
#include <thread>

#include "daemon/bounded_server.hpp"
#include "daemon/call_rate.hpp"
#include "daemon/subscriber.hpp"
#include "daemon/token.hpp"
#include "image/json_object.hpp"

namespace ols {

namespace {

constexpr std::chrono::seconds comment_pause(15);

// "127.0.0.1:8156" or "localhost:8156".
bool is_this_machine(const std::string& host) {
    const std::string name = host.substr(0, host.find(':'));
    return name == "127.0.0.1" || name == "localhost";
}

std::string stream_text(const char* event, uint64_t number, const nlohmann::json& data) {
    return fmt::format("id: {}\nevent: {}\ndata: {}\n\n", number, event, json_line(data));
}

}  // namespace

struct HttpServer::State {
    State(std::string secret, Api& api, EventLog& events) : token(std::move(secret)), api(api), events(events) {}

    // Why a request is refused before it is looked at; 0: it is not.
    int refusal(const httplib::Request& request) const {
        if (!is_this_machine(request.get_header_value("Host"))) return 421;
        const std::string origin = request.get_header_value("Origin");
        if (!origin.empty() && origin != "http://" + request.get_header_value("Host")) return 403;
        const std::string shown = request.get_header_value("Authorization");
        const std::string scheme = "Bearer ";
        if (shown.compare(0, scheme.size(), scheme) != 0 || !is_token(shown.substr(scheme.size()), token)) return 401;
        if (request.has_header("Transfer-Encoding")) return 411;
        if (request.has_header("Content-Length") &&
            request.get_header_value<uint64_t>("Content-Length") > request_bytes_max)
            return 413;
        return 0;
    }

    void refuse(int status, httplib::Response& response) {
        const char* const why = status == 421   ? "this is for http://127.0.0.1 and http://localhost alone"
                                : status == 403 ? "pages of another origin may not ask"
                                : status == 411 ? "say how long the request is: Content-Length"
                                : status == 413 ? "a request has at most 65536 bytes"
                                                : "show the token: Authorization: Bearer TOKEN";
        response.status = status;
        if (status == 401) response.set_header("WWW-Authenticate", "Bearer");
        response.set_content(std::string(why) + "\n", "text/plain");
        if (const auto now = std::chrono::steady_clock::now(); now >= next_told) {
            next_told = now + std::chrono::seconds(10);
            events.add(EventKind::client_refused, fmt::format("a request over HTTP was refused: {}: {}", status, why));
        }
    }

    void add_routes();
    void stream(httplib::Response& response);

    const std::string token;
    Api& api;
    EventLog& events;
    BoundedHttpServer server{HttpBounds{}};
    std::atomic<bool> ends = false, has_ended = false;
    std::atomic<int> streams = 0;
    std::mutex mutex;  // of what follows
    CallRate rate;
    std::chrono::steady_clock::time_point next_told{};
    std::thread thread;
};

// The present state first, then every event; Last-Event-ID is not needed for that.
void HttpServer::State::stream(httplib::Response& response) {
    if (streams.fetch_add(1) >= streams_max) {
        --streams;
        response.status = 503;
        response.set_content("too many streams of events are open\n", "text/plain");
        return;
    }
    struct Stream {
        explicit Stream(State& state) : state(state), subscriber(state.events) {}
        ~Stream() { --state.streams; }
        State& state;
        Subscriber subscriber;
        uint64_t known_number = 0;
        bool has_begun = false;
        std::chrono::steady_clock::time_point next_comment;
    };
    const auto open = std::make_shared<Stream>(*this);
    response.set_header("Cache-Control", "no-store");
    response.set_chunked_content_provider("text/event-stream", [open](size_t, httplib::DataSink& sink) {
        State& state = open->state;
        std::string text;
        const auto now = std::chrono::steady_clock::now();
        if (!open->has_begun) {
            const nlohmann::json present = state.api.present_state();
            open->has_begun = true;
            open->known_number = present["event_number"];
            text = stream_text("state", open->known_number, present);
        } else if (const auto event = open->subscriber.next(std::chrono::milliseconds(100))) {
            if (event->number > open->known_number) text = stream_text("event", event->number, event->to_json());
        } else if (now >= open->next_comment) {
            text = ": still here\n\n";  // or a client that has left would never be noticed
        }
        if (!text.empty()) {
            open->next_comment = now + comment_pause;
            if (!sink.write(text.data(), text.size())) return false;
        }
        return !state.ends && !open->subscriber.is_behind();
    });
}

void HttpServer::State::add_routes() {
    server.set_pre_routing_handler([this](const httplib::Request& request, httplib::Response& response) {
        std::chrono::milliseconds wait;
        int status;
        {
            const std::lock_guard lock(mutex);
            wait = rate.take();
            status = refusal(request);
            if (status != 0) refuse(status, response);
        }
        std::this_thread::sleep_for(std::min(wait, std::chrono::milliseconds(1000)));
        return status != 0 ? httplib::Server::HandlerResponse::Handled : httplib::Server::HandlerResponse::Unhandled;
    });
    server.Post("/rpc", [this](const httplib::Request& request, httplib::Response& response) {
        const auto answer = answer_rpc(request.body, [this](const std::string& method, const nlohmann::json& params) {
            return api.call(method, params, "HTTP");
        });
        if (answer)
            response.set_content(*answer, "application/json");
        else
            response.status = 204;
    });
    server.Get("/events", [this](const httplib::Request&, httplib::Response& response) { stream(response); });
    server.Get("/metrics", [this](const httplib::Request&, httplib::Response& response) {
        response.set_content(api.metrics(), "text/plain; version=0.0.4; charset=utf-8");
    });
}

std::string token_file_of(const DaemonSetup& setup) {
    if (!setup.token_file.empty()) return setup.token_file;
    return (std::filesystem::path(setup.socket).parent_path() / "token").string();
}

Result<std::unique_ptr<HttpServer>> HttpServer::listen(const DaemonSetup& setup, Api& api, EventLog& events) {
    auto token = token_of_file(token_file_of(setup));
    if (!token) return token.error();
    auto state = std::make_unique<State>(std::move(*token), api, events);
    state->server.new_task_queue = [] { return new httplib::ThreadPool(size_t(threads)); };
    state->server.set_payload_max_length(request_bytes_max);
    state->server.set_socket_options([](int socket) {
        const int on = 1;  // not SO_REUSEPORT, with which a second daemon would share the port
        setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
    });
    state->add_routes();
    if (!state->server.bind_to_port("127.0.0.1", setup.http_port))
        return fail(fmt::format("port {} of 127.0.0.1 is taken: give another [daemon] http_port", setup.http_port));
    state->thread = std::thread([&state = *state] {
        state.server.listen_after_bind();
        state.has_ended = true;
    });
    return std::unique_ptr<HttpServer>(new HttpServer(std::move(state)));
}

HttpServer::HttpServer(std::unique_ptr<State> state) : state_(std::move(state)) {}

HttpServer::~HttpServer() {
    state_->ends = true;
    while (!state_->server.is_running() && !state_->has_ended)
        std::this_thread::sleep_for(std::chrono::milliseconds(1));  // stop() before that would be forgotten
    state_->server.stop();
    state_->thread.join();
}

}  // namespace ols
