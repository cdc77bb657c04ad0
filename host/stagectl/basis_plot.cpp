// SPDX-License-Identifier: MIT
// A gnuplot script with its data, through a pipe.
#include "stagectl/basis_plot.hpp"

#include <fmt/format.h>
#include <sys/wait.h>

#include <algorithm>
#include <csignal>
#include <cstdio>

#include "image/whole_file.hpp"

namespace ols {

namespace {

std::string block(const std::string& name, const std::string& rows) {
    return fmt::format("${} << EOD\n{}EOD\n", name, rows);
}

template <typename F>
std::string lines(size_t count, F line) {
    std::string text;
    for (size_t n = 0; n < count; ++n) text += line(n) + "\n";
    return text;
}

std::string levels_block(const Sequence& sequence) {
    std::string rows;
    for (const Slot& slot : sequence.slots)
        for (int lamp = 0; slot.kind == SlotKind::basis && lamp < sequence.basis.lamps; ++lamp)
            rows += fmt::format("{:.3g}{}", sequence.basis.light(slot.row, lamp),
                                lamp + 1 < sequence.basis.lamps ? " " : "\n");
    return block("levels", rows);
}

std::string data_blocks(const Sequence& sequence, const BasisFigures& figures, const Flicker& flicker) {
    const auto& values = figures.matrix.singular_values;
    // A rank-deficient basis has values that are rounding alone; they stand at the bottom.
    const double least = values[0] * 1e-6;
    return levels_block(sequence) +
           block("singular",
                 lines(values.size(), [&](size_t n) { return fmt::format("{:g}", std::max(values[n], least)); })) +
           block("images", lines(figures.noise_gain.size(),
                                 [&](size_t n) {
                                     return fmt::format("{:g} {:g} {:g}", figures.noise_gain[n], figures.chart_snr[n],
                                                        figures.shadow_snr[n]);
                                 })) +
           block("lamps", lines(size_t(sequence.basis.lamps), [&](size_t n) {
                     const LampLight& lamp = flicker.lamps[n];
                     return fmt::format("{:g} {:g}", lamp.duty * 100, lamp.cycle_modulation * 100);
                 }));
}

std::string quoted(std::string text) {
    for (size_t at = 0; (at = text.find('\'', at)) != std::string::npos; at += 2) text.insert(at, "'");
    return "'" + text + "'";
}

std::string script_of(const std::string& path, const Sequence& sequence, const BasisFigures& figures,
                      const Flicker& flicker) {
    const Basis& basis = sequence.basis;
    return data_blocks(sequence, figures, flicker) +
           fmt::format(R"(set terminal pngcairo size 1500,1000 font 'DejaVu Sans,11'
set output {}
set multiplot layout 2,3 title {} noenhanced font ',15'
unset key
set tics out nomirror
set palette grey
set title 'light of each lamp, in the order of play'
set xlabel 'lamp'
set ylabel 'basis slot'
set autoscale xfix
set yrange [{}:-0.5]
set cbrange [0:1]
unset colorbox
plot $levels matrix with image
set autoscale y
set grid ytics
set xrange [0:*]
set logscale y
set format y '%g'
set title 'singular values'
set xlabel 'number'
set ylabel 'value'
plot $singular using 0:1 with points pointtype 7 pointsize 0.5 linecolor '#1f4e79'
set title 'noise gain (variance, additive noise; a single lamp: 1)'
set xlabel 'image'
set ylabel 'gain'
set format y '%g'
set yrange [*<0.01:1.5<*]
plot $images using 0:1 with points pointtype 7 pointsize 0.6 linecolor '#1f4e79', 1 linecolor '#999999'
set title 'predicted signal to noise, grey chart and deep shadow'
set ylabel 'SNR'
set autoscale y
set key bottom left
plot $images using 0:($2 > 1e-6 ? $2 : 1/0) with points pointtype 7 pointsize 0.6 linecolor '#c0504d' title 'chart', \
     $images using 0:($3 > 1e-6 ? $3 : 1/0) with points pointtype 6 pointsize 0.6 linecolor '#444444' title 'shadow'
unset key
unset logscale y
set yrange [0:*]
set title 'time lit by the basis'
set xlabel 'lamp'
set ylabel '%'
plot $lamps using 0:1 with points pointtype 7 pointsize 0.6 linecolor '#1f4e79'
set title 'comes and goes once a cycle (200 %: one flash)'
set ylabel '% of mean light'
set yrange [0:210]
plot $lamps using 0:2 with points pointtype 7 pointsize 0.6 linecolor '#1f4e79'
unset multiplot
set output
)",
                       quoted(path),
                       quoted(fmt::format("{}: {} rows, {} images, condition {:.4g}, {:g} us", basis.name, basis.rows,
                                          basis.images(), figures.matrix.condition, sequence.config.basis_exposure_us)),
                       basis.rows - 0.5);
}

// The exit code of gnuplot, fed with `script`; 127 when there is none.
int run_gnuplot(const std::string& script) {
    const auto before = std::signal(SIGPIPE, SIG_IGN);  // gnuplot may end before it has read all
    std::FILE* pipe = popen("gnuplot 2>&1", "w");
    if (pipe) std::fwrite(script.data(), 1, script.size(), pipe);
    const int status = pipe ? pclose(pipe) : -1;
    std::signal(SIGPIPE, before);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

}  // namespace

Status plot_basis(const std::string& path, const Sequence& sequence, const BasisFigures& figures,
                  const Flicker& flicker) {
    return write_whole_file(path, [&](const std::string& temporary) -> Status {
        switch (run_gnuplot(script_of(temporary, sequence, figures, flicker))) {
            case 0: return Done{};
            case 127: return fail("the plot is drawn by gnuplot, which is not installed: apt install gnuplot-nox");
            default: return fail("gnuplot could not draw '" + path + "': its message is above");
        }
    });
}

}  // namespace ols
