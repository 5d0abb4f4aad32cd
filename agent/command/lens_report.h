// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "agent/command/board_views.h"
#include "common/board/board.h"
#include "common/lens/lens_solver.h"

namespace rigcal::agent {

// For people: the lens, how well it fits, how far it can be trusted, what would make it better.
// `output`: the file it was written to; empty: to none.
std::string FormatLensReport(const Board& board, const BoardViews& views,
                             const LensSolution& solution, const std::string& output);
// The same as one JSON object, a contract: board, camera, image_size_px, pictures, with_board,
// views, corners, model, intrinsics{distortion_model, fx_px, fy_px, cx_px, cy_px, distortion},
// sigmas (fx, fy, cx, cy, then the coefficients; of noise alone), noise_px (in each coordinate of a
// corner), rms_px, held_out_rms_px, candidates[{model, rms_px, held_out_rms_px}],
// uncertainty{median_px, p95_px} (one sigma over the image, of noise alone; null: not determined),
// uncertainty_map_px{columns, rows, values[row by row from the upper left; null: no ray]},
// halves{median_px, p95_px, most_px, unknown_share} or null, board_bend{height_m, sigma_m} (along
// rows and columns) or null, covered_share, blind_share, view_results[{name, corners,
// left_out_corners, rms_px, tilt_deg, left_out}], not_read[{reason, count, example}], advice[text],
// file (null: not written); of an event camera events{count, bursts, blink_hz, flicker_hz} (0: not seen).
std::string LensReportJson(const Board& board, const BoardViews& views,
                           const LensSolution& solution, const std::string& output);

}  // namespace rigcal::agent
