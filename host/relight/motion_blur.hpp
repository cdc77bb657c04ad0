// SPDX-License-Identifier: MIT
// Motion blur: a sharp picture as a shutter that stays open for a while would have seen it.
#pragma once

#include <cstddef>

#include "image/frame.hpp"
#include "image/target_motion.hpp"
#include "result.hpp"

namespace ols {

struct MotionBlurOptions {
    double shutter_deg = 180;  // of the time between two targets: 0 is none of it, 360 all, 720 the most
    double phase_deg = 0;      // from the target's instant to the middle of the exposure; 0: centred on the target
    double step_px = 1;        // between sub-frames, at most; smaller is slower and nearer to the limit
    int threads = 0;           // 0: as many as there are cores; the result is the same for any number
};

struct BlurredImage {
    Image image;
    double extrapolated_s = 0;  // how far the exposure reaches beyond the instants whose motion is known
    size_t unseen_pixels = 0;   // saw nothing of the picture at any time, and stayed as they were
};

// The mean over the exposure of the picture carried along the target's motion: I(q) = 1/T int I_t(q) dt, with every pixel on a
// path that is piecewise linear in time between the instants of the motion (Wenger et al. 2005, section 6.2). Scene-linear
// values, any number of channels; alpha is a channel like the others, so colours are to be premultiplied.
//
// Method. At each of many instants the picture is a sheet of cells between pixel centres, whose corners move and which is
// interpolated bilinearly inside; values are carried, not spread, so that white stays white however the motion stretches it.
// Where the corners of a cell part by more than a pixel the sheet is cut: quarters go with their corners, and what opens between them
// shows the corner that moved least. What moved farther lies in front. Instants are the middles of equal parts of
// each linear piece, as many as the fastest pixel nearby needs to stay within step_px, tile by tile. Before the first and
// after the last known instant motion goes on at the speed it had. A pixel that the sheet left for a part of the time (at the
// picture's border) has the mean of the rest.
//
// Deviation from the paper, which draws anti-aliased lines (Wu 1991): those add what they cross, so that a hand's blur would brighten
// or mix with the face that it covers.
//
// Exact: no motion (the same bits) and, for step_px to 0, affine motion of the bilinear picture. Sums over the picture are kept
// by translation that does not leave it, as far as bilinear interpolation and an edge cut at half pixels keep them.
//
// Errors: samples that are not finite; motion that check_motion() refuses, that has no instant, or that leads farther than the picture is
// large; shutter, phase (-360..360), step (0.01..16 pixels) or frame rate out of range.
Result<BlurredImage> motion_blurred(const Image& sharp, const TargetMotion& motion, double frame_rate_hz,
                                    const MotionBlurOptions& options = {});

}  // namespace ols
