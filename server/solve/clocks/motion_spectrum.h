// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <complex>
#include <optional>
#include <vector>

#include "server/solve/clocks/ray_paths.h"

namespace rigcal::server {

// The rays of one track on an even grid of time, ready to be compared with another track's at all
// offsets at once: of each marker the spectra of u^2, u v, v^2, u, v and 1, the products of which
// make the normal matrix of the eight-point algorithm. Zero where the marker was not seen.
struct MotionSpectrum {
  static constexpr size_t kMonomials = 6;
  using Half = std::vector<std::complex<double>>;  // frequencies 0 to half the sampling rate

  std::vector<std::array<Half, kMonomials>> markers;
  double first_time_s = 0;  // of the grid
  int sample_count = 0;     // of the grid, without the zeros behind them
  int fft_size = 0;         // samples and zeros
  double step_s = 0;        // of the grid
  // Of the rays before they were moved and scaled to order one.
  double focal_px = 1, scale = 1;
};

// How well two tracks fit one epipolar geometry, by offset of the second (as in
// SearchTimeOffsets).
struct LagScores {
  double first_offset_s = 0, step_s = 0;
  std::vector<double> rms_px;  // of epipolar distances; infinite where they hardly overlap
  std::vector<int> matches;    // samples of markers that both saw

  double OffsetS(size_t lag) const { return first_offset_s + step_s * static_cast<double>(lag); }
};

// From the first to the last row of a track; 0 without any.
double SpanS(const TrackPaths& paths);

// The step of a grid for tracks of up to this span: `finest_s`, or so many times doubled that
// memory suffices for it. None for a span of many hours.
std::optional<double> GridStepS(double span_s, double finest_s);

// The number of samples that a grid of this step needs for a track; 0 without any.
int GridSamples(const TrackPaths& paths, double step_s);

// Rays between two rows are interpolated (see At). `fft_size` is at least twice GridSamples() of
// each track that this one is compared with; see FftSizeFor().
MotionSpectrum SpectrumOf(const TrackPaths& paths, double step_s, int fft_size);

// The smallest product of 2, 3 and 5 that is even and not below.
int FftSizeFor(int samples);

// Scores at every offset at which the tracks have `min_matches` samples in common. At each offset
// tau the normalised eight-point algorithm (Hartley 1997, "In defense of the eight-point
// algorithm") minimises f^T N(tau) f, where N(tau) is the sum over t of products of two coordinates
// of track a at t and two of track b at t - tau. These are 36 cross-correlations, which the fast
// Fourier transform gives for all offsets in n log n; the least eigenvalue of N is the squared
// algebraic residual. It needs no depth and no poses, so one marker is enough. Both spectra have
// one step and size.
LagScores ScoreAllLags(const MotionSpectrum& a, const MotionSpectrum& b, int min_matches);

// Root mean square distance between a track and itself, in pixels, by the time in between (0 and
// later); infinite with fewer than `min_matches` samples in common.
LagScores DistanceFromItself(const MotionSpectrum& spectrum, int min_matches);

}  // namespace rigcal::server
