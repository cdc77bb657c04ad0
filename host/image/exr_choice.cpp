// SPDX-License-Identifier: MIT
// Channels are grouped by layer, layers judged by the names and kinds of their channels.
#include "image/exr_choice.hpp"

#include <ImfChannelList.h>
#include <ImfPartType.h>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <functional>
#include <map>

namespace ols {

namespace {

using Headers = std::vector<const Imf::Header*>;
using Channels = std::map<std::string, Imf::Channel>;  // by the name behind the layer's

bool is_deep(const Imf::Header& header) {
    return header.hasType() && Imf::isDeepData(header.type());
}

std::string part_words(const Headers& headers, int part) {
    const auto& header = *headers[size_t(part)];
    return header.hasName() ? fmt::format("part {} '{}'", part, header.name()) : fmt::format("part {}", part);
}

std::map<std::string, Channels> layers_of(const Imf::Header& header) {
    std::map<std::string, Channels> layers;
    for (auto it = header.channels().begin(); it != header.channels().end(); ++it) {
        const std::string name = it.name();
        const size_t dot = name.rfind('.');
        if (dot == std::string::npos)
            layers[""][name] = it.channel();
        else
            layers[name.substr(0, dot)][name.substr(dot + 1)] = it.channel();
    }
    return layers;
}

bool has_light(const Channels& channels, const std::string& name, int sampling) {
    const auto it = channels.find(name);
    return it != channels.end() && it->second.type != Imf::UINT && it->second.xSampling == sampling &&
           it->second.ySampling == sampling;
}

bool has_all(const Channels& channels, std::initializer_list<const char*> names, int sampling) {
    return std::all_of(names.begin(), names.end(), [&](const char* n) { return has_light(channels, n, sampling); });
}

// The layer of these channels, if they are a picture.
std::optional<ExrLayer> as_picture(const Channels& channels, int part, const std::string& name) {
    ExrLayer layer{part, name, ExrColour::grey, {}, {}};
    if (has_all(channels, {"R", "G", "B"}, 1)) {
        layer.colour = ExrColour::rgb;
        layer.channels = {"R", "G", "B"};
    } else if (has_all(channels, {"Y"}, 1) && !channels.count("X")) {  // X Y are coordinates
        const bool chroma = has_all(channels, {"RY", "BY"}, 1) || has_all(channels, {"RY", "BY"}, 2);
        if (!chroma && (channels.count("RY") || channels.count("BY"))) return std::nullopt;
        layer.colour = chroma ? ExrColour::luminance_chroma : ExrColour::grey;
        layer.channels = chroma ? std::vector<std::string>{"Y", "RY", "BY"} : std::vector<std::string>{"Y"};
    } else {
        return std::nullopt;
    }
    if (has_light(channels, "A", 1)) layer.channels.push_back("A");
    if (!name.empty())
        for (auto& channel : layer.channels) channel = name + "." + channel;
    return layer;
}

std::string layer_words(const Headers& headers, const ExrLayer& layer) {
    const std::string channels = fmt::format("{}", fmt::join(layer.channels, " "));
    return headers.size() > 1 ? fmt::format("{} ({})", part_words(headers, layer.part), channels) : channels;
}

std::string some_of(const std::vector<std::string>& words) {
    constexpr size_t most = 12;
    if (words.size() <= most) return fmt::format("{}", fmt::join(words, ", "));
    return fmt::format("{} and {} more", fmt::join(words.begin(), words.begin() + most, ", "), words.size() - most);
}

std::vector<std::string> channel_words(const Imf::Header& header) {
    std::vector<std::string> words;
    for (auto it = header.channels().begin(); it != header.channels().end(); ++it) {
        const Imf::Channel& c = it.channel();
        words.push_back(it.name());
        if (c.type == Imf::UINT) words.back() += " (whole numbers)";
        if (c.xSampling != 1 || c.ySampling != 1)
            words.back() += fmt::format(" (sampled {} x {})", c.xSampling, c.ySampling);
    }
    return words;
}

bool is_meant(const Headers& headers, int part, const ExrChoice& choice) {
    if (!choice.part) return true;
    const auto& header = *headers[size_t(part)];
    return *choice.part == std::to_string(part) || (header.hasName() && header.name() == *choice.part);
}

std::vector<ExrLayer> pictures_of(const Headers& headers, const ExrChoice& choice) {
    std::vector<ExrLayer> pictures;
    for (int part = 0; part < int(headers.size()); ++part) {
        if (!is_meant(headers, part, choice) || is_deep(*headers[size_t(part)])) continue;
        for (const auto& [name, channels] : layers_of(*headers[size_t(part)])) {
            if (choice.layer && name != *choice.layer) continue;
            if (auto picture = as_picture(channels, part, name)) pictures.push_back(std::move(*picture));
        }
    }
    return pictures;
}

// What the parts that were meant hold instead of a picture.
Error no_picture(const Headers& headers, const ExrChoice& choice) {
    std::vector<std::string> words;
    for (int part = 0; part < int(headers.size()); ++part) {
        if (!is_meant(headers, part, choice)) continue;
        if (is_deep(*headers[size_t(part)])) words.push_back(part_words(headers, part) + ", which is deep");
        for (auto& word : channel_words(*headers[size_t(part)])) words.push_back(std::move(word));
    }
    if (words.empty()) return fail(fmt::format("it has no part '{}': `exrheader` lists them", *choice.part));
    const std::string layer = choice.layer ? fmt::format(" in a layer '{}'", *choice.layer) : "";
    return fail(fmt::format("it holds no light{} that can be read (R G B, Y, or Y RY BY, of floats), but: {}", layer,
                            some_of(words)));
}

Error several(const Headers& headers, const std::vector<ExrLayer>& pictures) {
    std::vector<std::string> words;
    for (const auto& picture : pictures) words.push_back(layer_words(headers, picture));
    return fail(fmt::format("it holds several pictures: {}: choose with --part NAME or --layer NAME", some_of(words)));
}

std::string words_of_the_rest(const Headers& headers, const ExrLayer& taken) {
    std::vector<std::string> words;
    for (int part = 0; part < int(headers.size()); ++part) {
        const auto& header = *headers[size_t(part)];
        if (part != taken.part) {
            words.push_back(part_words(headers, part));
            continue;
        }
        for (auto it = header.channels().begin(); it != header.channels().end(); ++it)
            if (std::find(taken.channels.begin(), taken.channels.end(), it.name()) == taken.channels.end())
                words.push_back(it.name());
    }
    return words.empty() ? "" : some_of(words);
}

}  // namespace

Result<ExrLayer> choose_exr_layer(const Headers& headers, const ExrChoice& choice) {
    std::vector<ExrLayer> pictures = pictures_of(headers, choice);
    const auto keep = [&](auto wanted) {
        if (std::any_of(pictures.begin(), pictures.end(), wanted)) std::erase_if(pictures, std::not_fn(wanted));
    };
    keep([](const ExrLayer& p) { return p.colour != ExrColour::grey; });
    keep([](const ExrLayer& p) { return p.name.empty(); });
    if (pictures.empty()) return no_picture(headers, choice);
    if (pictures.size() > 1) return several(headers, pictures);
    ExrLayer taken = std::move(pictures.front());
    taken.left_out = words_of_the_rest(headers, taken);
    return taken;
}

}  // namespace ols
