// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "common/associate/motion_weights.h"
#include "common/associate/outlier_centres.h"
#include "common/camera/camera_description.h"
#include "server/associate/align_clocks.h"

namespace rigcal::server {

// The image row whose time is that of the camera's clock where rows have times of their own.
inline double MiddleRow(const CameraDescription& camera) {
  return 0.5 * (camera.image_size_px.height - 1.0);
}

// Centre and image velocity of a marker at a time near one of its rows.
struct MarkerMotion {
  Eigen::Vector2d centre_px = Eigen::Vector2d::Zero();
  // To weigh the centre with beside those of the neighbouring instants (ImageMotion says how).
  Eigen::Matrix2d covariance_px2 = Eigen::Matrix2d::Identity();
  // The centre's own variance, by that: below 1 where it is a mean of several rows.
  double noise_share = 1;
  Eigen::Vector2d velocity_px_s = Eigen::Vector2d::Zero();  // zero where it is not known
};

// The motion of the markers in one camera's image, from local polynomial fits to its rows. The row
// asked about is moved along the fitted polynomial, u(t) = u_row + P(t) - P(t_row), so that it
// keeps its own noise, and a row without neighbours stays where it is.
//
// The centre is a sum of rows, u = sum_i w_i u_i with sum_i w_i = 1. Its own variance,
// sum_i w_i^2 S_i, is down to half a row's between two rows; but then the next instant's centre is
// a sum of the same rows, and the two share their noise. To parameters that change slowly against
// the frames a run of n such centres is worth as much as its n rows, not more: the variance of
// their mean is their spectrum at frequency zero, |sum_i w_i|^2 S / n (Whittle 1953). So what is
// stated is the row's covariance, times tr(sum w_i^2 S_i) / tr(S) where that is above 1 (beyond the
// last row), plus half of what the fit's highest order contributes, squared, as a measure of what
// the fit leaves out.
//
// The velocity is a sum of rows as well, sum_i v_i u_i. It multiplies the residual in the time
// offset's gradient, so a noise it shared with the centre, S sum_i v_i w_i, would pull the offset.
// Its weights are those of the least-squares polynomial among v with sum_i v_i w_i = 0, where there
// are rows enough: an instrument in the sense of errors in variables (Fuller 1987, 2.4).
//
// Rows within 45 ms of the row asked about take part in the fit; at least 2.5 periods do. An
// outlying centre takes no part in its neighbours' fits.
class ImageMotion {
 public:
  // Observations of which `flipped` is true (empty: none is) have their labels counted from the
  // target's other end, here and by whoever asks IsFlipped().
  // `track` must outlive it.
  ImageMotion(const AlignedTrack& track, int marker_count, std::vector<bool> flipped = {});
  ImageMotion(const AlignedTrack&& track, int marker_count, std::vector<bool> = {}) = delete;

  // Rolling shutter: a marker in image row y is seen this times (y - middle row) after the time of
  // its row of observations. Until it is set there is none.
  void SetLineDelay(double line_delay_s) { line_delay_s_ = line_delay_s; }
  double line_delay_s() const { return line_delay_s_; }
  // Camera time of a visible marker of a row, which is where the row has it, whatever its label.
  int64_t TimeNs(size_t row, size_t column) const;
  // The mean of its visible markers' delays by their image rows; 0 without any.
  int64_t MeanDelayNs(size_t row) const;

  bool IsFlipped(int observation) const {
    return !flipped_.empty() && flipped_[static_cast<size_t>(observation)];
  }

  // Takes a marker of a row out of its neighbours' fits: it is an outlier.
  void Exclude(int observation, int marker);

  // Of a marker of `observation` that is visible under this label, `shift_s` after its own time
  // (camera clock). `memory`, if given, saves time where it has been asked about another marker of
  // the observation before.
  MarkerMotion At(int observation, int marker, double shift_s,
                  MotionWeightsMemory* memory = nullptr) const;

  // Median speed of the visible markers, px/s; 0 where nothing is known.
  double typical_speed_px_s() const { return typical_speed_px_s_; }

 private:
  // A row in which the marker is visible.
  struct Sample {
    size_t row;
    size_t column;  // of the marker in that row
    int64_t time_ns;
  };
  // Ascending in time, the own one among them.
  struct Neighbourhood {
    std::array<Sample, kMaxMotionPoints> samples;
    size_t count, own;
  };
  std::optional<Sample> SampleAt(size_t row, size_t label) const;
  // The next one after (step 1) or before (step -1) a row.
  std::optional<Sample> Next(size_t row, size_t label, int step) const;
  Neighbourhood Around(const Sample& own, size_t label) const;
  size_t Place(size_t row, size_t label) const { return row * marker_count_ + label; }

  const ObservationTable* rows_;
  size_t marker_count_;
  double period_s_;
  double middle_row_;
  double line_delay_s_ = 0;
  std::vector<bool> flipped_;   // by observation
  std::vector<bool> excluded_;  // by observation, then marker
  double typical_speed_px_s_ = 0;
};

}  // namespace rigcal::server
