# SPDX-License-Identifier: MIT
"""What the camera's noise model predicts for a relit picture, beside what a noisy take shows.

A relit mosaic sample is I = 1/(pi F t) sum_j c_j (y_j - black), with y_j the counts of basis slot j, c = P^-T w for the slots' 0/1
matrix P and the lamps' irradiances w, F the flat field, t the exposure. Slots are independent, so
var I = 1/(pi F t)^2 sum_j c_j^2 s2(mu_j), s2(mu) = (read + shot sqrt(mu))^2 + 1/12 (Wenger section 4; 1/12 for rounding).
The calibration's own noise adds (sum_j c_j)^2 s2(0) / N for the black level and I^2 s2(m) / (N m^2) for the flat field, N frames of a
card of m counts: all slots share one black level, so it matters most where the c_j have one sign, in the single basis. The lamps of a multiplexed basis are correlated: adding their variances would be wrong.
"""
import re

import numpy as np
import OpenEXR

RGGB = np.array([[0, 1], [1, 2]])  # 0 red, 1 green, 2 blue


def middle(plane):
    """The middle quarter of a picture, which the face fills: it tells as much as all of it and takes a quarter of the time."""
    height, width = plane.shape
    return plane[height // 8 * 2 : height // 8 * 6, width // 8 * 2 : width // 8 * 6]


def read_target(path):
    """The middle of an archive's target: its lamp layers as (lamps, planes, height, width), its mask as (height, width)."""
    channels, mask = {}, None
    with OpenEXR.File(str(path), separate_channels=True) as file:
        for part in file.parts:
            for name, channel in part.channels.items():
                match = re.match(r"lamp_(\d+)\.([YRGB])$", name)
                if match:
                    channels[int(match[1]), "YRGB".index(match[2])] = middle(channel.pixels)
                elif part.name() == "mask":
                    mask = middle(channel.pixels)
    lamps = sorted({lamp for lamp, _ in channels})
    planes = sorted({plane for _, plane in channels})
    return np.stack([np.stack([channels[lamp, plane] for plane in planes]) for lamp in lamps]).astype(np.float32), mask


def read_image(path):
    """A one-part OpenEXR picture as (height, width) or (height, width, channels R G B ...)."""
    with OpenEXR.File(str(path), separate_channels=True) as file:
        channels = file.parts[0].channels
        names = [name for name in "RGB" if name in channels] or list(channels)
        planes = [channels[name].pixels.astype(np.float64) for name in names]
    return planes[0] if len(planes) == 1 else np.stack(planes, axis=-1)


def psnr_db(image, truth):
    """Peak is the truth's maximum."""
    return float(10 * np.log10(truth.max() ** 2 / np.mean((image - truth) ** 2)))


def compare(noisy_target, clean_target, flat, card, basis_rows, irradiance, exposure_us, read, shot):
    """Measured and predicted rms noise of the relit mosaic over the unmasked samples of the picture's middle.

    flat: counts per microsecond for r = 1, from card = (frames, microseconds times summed r); basis_rows: (slots, lamps) 0/1;
    irradiance: (lamps, 3); read, shot: the noise model.
    """
    def sigma2(counts):
        return (read + shot * np.sqrt(np.maximum(counts, 0))) ** 2 + 1 / 12

    noisy, mask = read_target(noisy_target)
    clean, _ = read_target(clean_target)
    flat = middle(flat)
    height, width = mask.shape
    color = np.tile(RGGB, (height // 2, width // 2))
    error2, variance, peak, samples = 0.0, 0.0, 0.0, 0
    for channel in range(3):
        here = (color == channel) & (mask == 0)
        counts_per_r = flat[here] * exposure_us
        lamps = clean[:, channel][:, here].astype(np.float64)
        weight = irradiance[:, channel] / np.pi
        c = np.linalg.lstsq(basis_rows.T.astype(float), weight, rcond=None)[0]
        slots = basis_rows.astype(float) @ lamps * counts_per_r
        truth = weight @ lamps
        frames, card_counts = card[0], flat[here] * card[1]
        variance += np.sum(c.sum() ** 2 * sigma2(0) / counts_per_r**2 + (truth / card_counts) ** 2 * sigma2(card_counts)) / frames
        error2 += np.sum((weight @ noisy[:, 0][:, here] - truth) ** 2)
        variance += np.sum(c**2 @ sigma2(slots) / counts_per_r**2)
        peak, samples = max(peak, truth.max()), samples + truth.size
    return {
        "mosaic_psnr_db": round(float(10 * np.log10(peak**2 * samples / error2)), 2),
        "mosaic_psnr_predicted_db": round(float(10 * np.log10(peak**2 * samples / variance)), 2),
        "noise_over_prediction": round(float(np.sqrt(error2 / variance)), 4),
        "masked_fraction": round(1 - samples / mask.size, 5),
    }
