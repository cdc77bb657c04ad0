// SPDX-License-Identifier: MIT
// libjpeg's own warnings, counted. T.81 has no checksums: this is all that can be known.
#include <csetjmp>
#include <cstdio>
#include <memory>
// clang-format off
#include <jpeglib.h>  // needs <cstdio>
// clang-format on
#include <jerror.h>

#include "photographs/file_damage.hpp"

namespace ols {

namespace {

struct Catcher {
    jpeg_error_mgr manager;  // first: libjpeg hands this one back
    jmp_buf back;
    char first[JMSG_LENGTH_MAX] = "";
};

void note(j_common_ptr info, int level) {
    auto* catcher = reinterpret_cast<Catcher*>(info->err);
    if (level >= 0) return;  // a trace
    if (info->err->num_warnings++ == 0) info->err->format_message(info, catcher->first);
}

[[noreturn]] void leave(j_common_ptr info) {
    auto* catcher = reinterpret_cast<Catcher*>(info->err);
    info->err->format_message(info, catcher->first);
    longjmp(catcher->back, 1);
}

// Nothing with a destructor lives here: errors leave by longjmp. Returns the number of components; 0 after an error.
int decode_all(std::FILE* file, Catcher& catcher) {
    jpeg_decompress_struct info{};
    info.err = jpeg_std_error(&catcher.manager);
    info.err->emit_message = note;
    info.err->error_exit = leave;
    if (setjmp(catcher.back) != 0) {
        jpeg_destroy_decompress(&info);
        return 0;
    }
    jpeg_create_decompress(&info);
    jpeg_stdio_src(&info, file);
    jpeg_read_header(&info, TRUE);
    jpeg_read_coefficients(&info);
    jpeg_finish_decompress(&info);
    const int components = info.num_components;
    jpeg_destroy_decompress(&info);
    return components;
}

}  // namespace

Status check_jpeg(const std::string& path) {
    const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::fopen(path.c_str(), "rbe"), std::fclose);
    if (!file) return fail("cannot open '" + path + "': check its permissions");
    Catcher catcher;
    const int components = decode_all(file.get(), catcher);
    if (components == 0 || catcher.manager.num_warnings > 0)
        return fail("'" + path + "' is damaged (" + catcher.first +
                    "): copy it again; if it is as its camera wrote it, `jpegtran -copy all` writes it anew");
    if (components != 1 && components != 3)
        return fail("'" + path + "' is in CMYK, which is ink and no light: save it as R G B");
    return Done{};
}

}  // namespace ols
