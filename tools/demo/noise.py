# SPDX-License-Identifier: MIT
"""What the camera's noise model predicts for a relit picture, beside what a noisy take shows.

A relit mosaic sample is I = 1/(pi F t) sum_j c_j (y_j - black), with y_j the counts of basis slot j, c = P^-T w for the slots' 0/1
matrix P and the lamps' irradiances w, F the flat field, t the exposure. Slots are independent, so
var I = 1/(pi F t)^2 sum_j c_j^2 (sigma(mu_j)^2 + 1/12), sigma(mu) = read + shot sqrt(mu) (Wenger section 4), 1/12 for rounding.
The lamps of a multiplexed basis are correlated: adding their variances would be wrong.
"""
import re

import numpy as np
import OpenEXR

CFA_RGGB = np.array([[0, 1], [1, 2]])


def read_lamps(path):
    """Lamp layers of an archive's target: (lamps, planes, height, width)."""
    with OpenEXR.File(str(path), separate_channels=True) as file:
        channels = {}
        for part in file.parts:
            for name, channel in part.channels.items():
                match = re.match(r"lamp_(\d+)\.([YRGB])$", name)
                if match:
                    channels[int(match[1]), "YRGB".index(match[2])] = channel.pixels
    lamps = sorted({lamp for lamp, _ in channels})
    planes = sorted({plane for _, plane in channels})
    return np.stack([np.stack([channels[lamp, plane] for plane in planes]) for lamp in lamps]).astype(np.float32)


def read_plane(path):
    with OpenEXR.File(str(path), separate_channels=True) as file:
        return next(iter(file.parts[0].channels.values())).pixels.astype(np.float64)


def mosaic(rgb, height, width):
    """(..., 3, height, width) sampled as an RGGB camera does: (..., height, width)."""
    color = np.tile(CFA_RGGB, (height // 2, width // 2))
    return np.take_along_axis(rgb, np.broadcast_to(color, rgb.shape[:-3] + (1, height, width)), axis=-3)[..., 0, :, :]


def compare(noisy_target, clean_target, flat, basis_rows, irradiance, exposure_us, noise):
    """Measured and predicted rms noise of the relit mosaic, and both as PSNR with the clean picture's maximum as peak.

    basis_rows: (slots, lamps) 0/1; irradiance: (lamps, 3); flat: counts per microsecond for r = 1; noise: read, shot.
    """
    noisy = read_lamps(noisy_target)[:, 0]
    height, width = noisy.shape[1:]
    clean = mosaic(read_lamps(clean_target), height, width)
    color = np.tile(CFA_RGGB, (height // 2, width // 2))

    counts_per_r = flat * exposure_us
    error = np.zeros((height, width))
    picture = np.zeros((height, width))
    variance = np.zeros((height, width))
    # Mean counts of every slot, lit lamps added up; P is rows x lamps.
    slots = np.einsum("jl,lyx->jyx", basis_rows.astype(np.float32), clean, optimize=True) * counts_per_r
    sigma2 = (noise["read"] + noise["shot"] * np.sqrt(np.maximum(slots, 0))) ** 2 + 1 / 12
    for channel in range(3):
        here = color == channel
        weight = irradiance[:, channel] / np.pi
        c = np.linalg.lstsq(basis_rows.T.astype(float), weight, rcond=None)[0]
        picture[here] = np.tensordot(weight, clean[:, here], axes=1)
        error[here] = np.tensordot(weight, noisy[:, here], axes=1) - picture[here]
        variance[here] = np.tensordot(c**2, sigma2[:, here], axes=1) / counts_per_r[here] ** 2
    peak = picture.max()
    rms, predicted = np.sqrt(np.mean(error**2)), np.sqrt(np.mean(variance))
    return {
        "rms": float(rms),
        "rms_predicted": float(predicted),
        "ratio": float(rms / predicted),
        "psnr_db": float(20 * np.log10(peak / rms)),
        "psnr_predicted_db": float(20 * np.log10(peak / predicted)),
    }
