// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <vector>

namespace rigcal::agent {

// Where the markers of a wand that is followed will be: constant velocity in the image, each marker
// for itself. A marker that is not seen moves on with the others. Times are the lower 32 bits of
// the sensor's clock. One thread at a time.
class BlinkWandTrack {
 public:
  struct Sighting {
    bool seen = false;
    Eigen::Vector2d centre_px = Eigen::Vector2d::Zero();
    double radius_px = 0;
    double time_us = 0;
    int frequency = 0;
  };
  struct Prediction {
    Eigen::Vector2d centre_px = Eigen::Vector2d::Zero();
    double gate_px = 0;  // it is within this distance, if the wand is moved by a hand
    double radius_px = 0;
    int frequency = 0;
  };

  void Forget() { markers_.clear(); }
  // Forgets a wand that was last seen too long ago.
  void ForgetBefore(double time_us);
  // The wand as it was seen: by marker. The first time all of them must be seen.
  void Add(const std::vector<Sighting>& sightings, double label_confidence);

  bool empty() const { return markers_.empty(); }
  double label_confidence() const { return label_confidence_; }  // of the wand as a whole
  Prediction Predict(size_t marker, double time_us) const;
  // px/us; none: not known yet, or there is no wand.
  std::optional<Eigen::Vector2d> Velocity(size_t marker) const {
    return empty() ? std::nullopt : markers_[marker].velocity_px_us;
  }

 private:
  struct Marker {
    Sighting last;
    std::optional<Eigen::Vector2d> velocity_px_us;
  };
  std::vector<Marker> markers_;
  double last_us_ = 0;
  double label_confidence_ = 0;
};

}  // namespace rigcal::agent
