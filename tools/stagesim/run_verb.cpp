// SPDX-License-Identifier: MIT
// stagesim run: the emulated board plays, the virtual cameras see what it lit and deliver frames.
#include <fmt/format.h>

#include <atomic>
#include <csignal>
#include <filesystem>

#include "image/outputs.hpp"
#include "image/whole_file.hpp"
#include "program.hpp"
#include "run/board_process.hpp"
#include "run/inputs.hpp"
#include "run/plan.hpp"
#include "run/virtual_camera.hpp"
#include "verbs.hpp"

namespace ols {

namespace {

struct RunOptions {
    InputOptions inputs;
    std::string work, image, vcd, pace = "virtual", faults, camera_model = "on", board_program;
    std::vector<std::string> board_faults;
    bool once = false, no_board = false, can = false, keep_frames = false, json = false;
};

// With --once, board time without exposures after the USB client has gone that counts as the end.
constexpr uint64_t idle_ticks = 500'000;  // 4 ms

std::atomic<bool> stop_requested = false;

void request_stop(int) {
    stop_requested = true;
}

std::filesystem::path program_folder() {
    std::error_code error;
    return std::filesystem::read_symlink("/proc/self/exe", error).parent_path();
}

// In a build tree (build/host/bin) things lie where they are built, otherwise beside the installed program.
std::string find_part(const std::string& given, const char* in_tree, const char* installed) {
    if (!given.empty()) return given;
    const auto tree = (program_folder() / "../../.." / in_tree).lexically_normal();
    if (std::filesystem::exists(tree)) return tree;
    return (program_folder() / ".." / installed).lexically_normal();
}

class StageRun {
  public:
    explicit StageRun(const RunOptions& options) : options_(options) {}

    Status run() {
        if (const Status status = prepare(); !status) return status;
        std::optional<BoardProcess> board;
        if (!options_.no_board) {
            auto started = start_board();
            if (!started) return started.error();
            board.emplace(std::move(*started));
        }
        const Status status = follow(board ? &*board : nullptr);
        for (auto& camera : cameras_) camera->finish();
        if (!status) return status;
        for (auto& camera : cameras_)
            if (const Status told = camera->truth_written(); !told) return told;
        if (board) {
            board->stop();
            if (const int code = board->wait(); code != 0)
                return fail(fmt::format("the emulated board ended with status {}: its message is above", code));
        }
        return write_cost();
    }

  private:
    Status prepare() {
        auto inputs = read_inputs(options_.inputs);
        if (!inputs) return inputs.error();
        inputs_ = std::move(*inputs);
        if (const Status playable = check_chain(inputs_.stage); !playable) return playable;
        const Status writable =
            check_outputs({.inputs = {options_.inputs.scene, options_.inputs.stage, options_.image, options_.faults},
                           .streams = {options_.vcd}});
        if (!writable) return writable;
        std::vector<Fault> faults;
        if (!options_.faults.empty()) {
            auto read = read_faults(options_.faults);
            if (!read) return read.error();
            faults = std::move(*read);
        }
        std::error_code error;
        std::filesystem::create_directories(options_.work, error);
        if (error) return fail("cannot make folder '" + options_.work + "': " + error.message());
        for (uint32_t i = 0; i < inputs_.stage.cameras.size(); ++i)
            if (const Status status = add_camera(i, faults); !status) return status;
        auto listener = LineListener::listen(options_.work + "/exposures.sock");
        if (!listener) return listener.error();
        listener_.emplace(std::move(*listener));
        return Done{};
    }

    Status add_camera(uint32_t index, const std::vector<Fault>& faults) {
        const CameraConfig& config = inputs_.stage.cameras[index];
        setups_.push_back(
            std::make_unique<Setup>(Setup{inputs_.scene, inputs_.stage, config, options_.camera_model == "on"}));
        // Some 64 MB of frames, so that the reader may pause without the board standing still.
        const RingContent content = ring_content(*setups_.back(), options_.inputs.disabled_set());
        const uint32_t slots = uint32_t(std::clamp<uint64_t>((64 << 20) / content.frame_bytes(), 8, 256));
        auto ring = RingWriter::create(fmt::format("{}/cam{}.ring", options_.work, index), slots, content);
        if (!ring) return ring.error();
        foretold_.push_back(foretell(*setups_.back(), options_.inputs.disabled_set()));
        cameras_.push_back(std::make_unique<VirtualCamera>(*setups_.back(), options_.inputs.disabled_set(), index,
                                                           std::move(*ring),
                                                           fmt::format("{}/cam{}.frames.jsonl", options_.work, index),
                                                           faults, options_.pace == "virtual", stop_requested));
        if (const Status told = cameras_.back()->truth_written(); !told) return told;
        if (options_.keep_frames)
            if (const Status kept =
                    cameras_.back()->keep_frames(fmt::format("{}/cam{}.frames.bin", options_.work, index));
                !kept)
                return kept;
        starts_.emplace_back();
        Renderer& renderer = cameras_.back()->renderer();
        // The board starts when the lamps are done: its socket says that the stage is ready. A moving scene is looked at once, so
        // that its first frame comes soon after its trigger, not when the daemon takes the camera for dead.
        if (renderer.effects().movement())
            renderer.place(0);
        else
            renderer.render_all_lamps([](double done) { show_progress("lamps", done); });
        return Done{};
    }

    Result<BoardProcess> start_board() {
        const std::string image =
            find_part(options_.image, "build/firmware/stage.elf", "share/open-light-stage/stage.elf");
        const std::string program = find_part(options_.board_program, "tools/stagesim/board/board.mjs",
                                              "share/open-light-stage/board/board.mjs");
        if (!std::filesystem::exists(image))
            return fail("there is no firmware image '" + image + "': build it (`make firmware`) or give --image");
        if (!std::filesystem::exists(program)) return fail("there is no emulated board '" + program + "'");
        std::vector<std::string> command = {"node",         program,
                                            "--image",      image,
                                            "--usb",        options_.work + "/board.sock",
                                            "--exposures",  options_.work + "/exposures.sock",
                                            "--pace",       options_.pace,
                                            "--chain-bits", std::to_string(inputs_.stage.chain_bits)};
        if (!options_.vcd.empty()) command.insert(command.end(), {"--vcd", options_.vcd});
        if (options_.can) command.insert(command.end(), {"--can", options_.work + "/can.sock", "--lamp-nodes"});
        for (const std::string& fault : options_.board_faults) command.insert(command.end(), {"--inject", fault});
        return BoardProcess::start(command);
    }

    // Handles lines until the board ends, or is told to and then does.
    Status follow(BoardProcess* board) {
        bool stopping = false;
        std::string line;
        for (;;) {
            answer_starts();
            if (!stopping && (stop_requested || finished())) {
                stopping = true;
                if (!board) return Done{};
                board->stop();
            }
            const auto event = listener_->read(line);
            if (event == LineListener::Event::end) return Done{};
            // Without a connection the board's end shows only in the process.
            if (event == LineListener::Event::timeout && board && !board->running()) return Done{};
            if (event != LineListener::Event::line) continue;
            const auto message = parse_board_message(line);
            if (!message) {
                if (board) board->stop();
                return message.error();
            }
            if (!stopping) handle(*message);
        }
    }

    void handle(const BoardMessage& message) {
        if (const auto* exposure = std::get_if<ExposureMessage>(&message)) {
            quiet_since_ = exposure->fall;
            for (size_t i = 0; i < cameras_.size(); ++i) {
                if (inputs_.stage.cameras[i].trigger != exposure->trigger) continue;
                const uint64_t unwanted = cameras_[i]->unwanted();
                cameras_[i]->expose(*exposure);
                if (unwanted == 0 && cameras_[i]->unwanted() == 1)
                    fmt::print(stderr,
                               "stagesim: nobody records from camera {}: such frames are not made, and counted\n", i);
            }
        } else if (const auto* now = std::get_if<NowMessage>(&message)) {
            now_ = now->tick;
            for (auto& camera : cameras_) camera->set_now(now->tick);
        } else if (const auto* sync = std::get_if<SyncMessage>(&message)) {
            confirm_starts(sync->n, sync->tick);
        } else if (const auto* usb = std::get_if<UsbMessage>(&message)) {
            client_gone_ = client_came_ && !usb->connected;
            client_came_ = client_came_ || usb->connected;
            quiet_since_ = now_;
        }
    }

    bool finished() const { return options_.once && client_gone_ && now_ >= quiet_since_ + idle_ticks; }

    // A camera starts when the board says that every exposure before is behind us; without a board there is none.
    void answer_starts() {
        for (size_t i = 0; i < cameras_.size(); ++i) {
            const auto start = cameras_[i]->start_asked();
            if (!start || start == starts_[i].start) continue;
            starts_[i] = {*start, ++syncs_};
            if (listener_->has_client())
                listener_->send(fmt::format("{{\"type\":\"sync\",\"n\":{}}}\n", syncs_));
            else
                confirm_starts(syncs_, now_);
        }
    }

    void confirm_starts(uint64_t sync, uint64_t tick) {
        for (size_t i = 0; i < cameras_.size(); ++i)
            if (starts_[i].start && starts_[i].sync == sync) cameras_[i]->confirm_start(*starts_[i].start, tick);
    }

    Status write_cost() {
        nlohmann::json report;
        for (size_t i = 0; i < cameras_.size(); ++i) {
            VirtualCamera& camera = *cameras_[i];
            nlohmann::json actual = account(camera.renderer());
            actual["triggers"] = camera.triggers();
            actual["frames_delivered"] = camera.delivered();
            actual["frames_dropped"] = camera.dropped();
            actual["frames_unwanted"] = camera.unwanted();
            nlohmann::json entry = {{"foretold", foretold_[i]}, {"actual", actual}};
            if (i == 0) report = entry;
            report["cameras"].push_back(std::move(entry));
        }
        if (const Status s = write_whole_file(options_.work + "/cost.json", report.dump(2) + '\n'); !s) return s;
        if (options_.json) print_json(report, 2);
        return Done{};
    }

    const RunOptions& options_;
    Inputs inputs_;
    std::vector<std::unique_ptr<Setup>> setups_;
    std::vector<nlohmann::json> foretold_;
    std::vector<std::unique_ptr<VirtualCamera>> cameras_;
    std::optional<LineListener> listener_;
    struct Start {
        std::optional<uint32_t> start;  // the last one asked for
        uint64_t sync = 0;              // whose answer confirms it
    };
    std::vector<Start> starts_;  // by camera
    uint64_t syncs_ = 0;
    bool client_came_ = false, client_gone_ = false;
    uint64_t now_ = 0, quiet_since_ = 0;
};

}  // namespace

void add_run_verb(CLI::App& app, int& exit_code) {
    auto options = std::make_shared<RunOptions>();
    CLI::App* verb = app.add_subcommand("run", "play the stage: emulated board, lamps, cameras");
    verb->footer(
        "Makes WORK/board.sock (the board's USB), WORK/cam0.ring (frames), WORK/cam0.frames.jsonl (which trigger and "
        "lamps made each frame: the truth that identification is held against) and, at the end, WORK/cost.json.\n"
        "Example: stagesim run tools/stagesim/scenes/head.toml --stage examples/stage.toml --work out/stage --once");
    add_input_options(*verb, options->inputs);
    verb->add_option("--work", options->work, "folder of sockets and rings")->required();
    verb->add_option("--image", options->image, "firmware image (default: the one built here)");
    verb->add_option("--vcd", options->vcd, "write the board's signals there");
    verb->add_option("--pace", options->pace, "virtual: never outrun the reader; wall: drop and count")
        ->check(CLI::IsMember({"virtual", "wall"}));
    verb->add_option("--inject", options->faults, "faults.toml: faults of cameras and delivery");
    verb->add_option("--board-inject", options->board_faults,
                     "fault of the board, FAULT@WHEN as board.mjs --help says");
    verb->add_option("--camera-model", options->camera_model,
                     "off: float RGB counts without noise, mosaic, quantisation, saturation")
        ->check(CLI::IsMember({"on", "off"}));
    verb->add_option("--board-program", options->board_program, "the emulated board's board.mjs");
    verb->add_flag("--can", options->can,
                   "a CAN bus, WORK/can.sock: the board is on it, and the lamp nodes with their telemetry");
    verb->add_flag("--no-board", options->no_board, "wait for a board that connects to WORK/exposures.sock by itself");
    verb->add_flag("--keep-frames", options->keep_frames,
                   "keep every frame in WORK/camN.frames.bin, too: id and time (64 bits each), then 16-bit samples");
    verb->add_flag("--once", options->once, "end when the board's USB client has gone and the board is idle");
    verb->add_flag("--json", options->json, "print the cost as JSON at the end");
    verb->callback([options, &exit_code] {
        for (const int signal : {SIGTERM, SIGINT}) std::signal(signal, request_stop);
        if (const Status status = StageRun(*options).run(); !status) {
            fmt::print(stderr, "stagesim run: {}\n", status.error().message);
            exit_code = 1;
        }
    });
}

}  // namespace ols
