// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <bitset>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace rigcal::server {

// Counts for each pair of cameras how long both have seen the wand at once. Time is cut into steps
// of 20 ms; a row with the wand stands for the time around it. So it makes no difference how two
// cameras are triggered, and clocks that agree to some tens of milliseconds change little. Of the
// last `step_count` steps any order of arrival gives the same counts; what is older is not counted.
class OverlapCounter {
 public:
  static constexpr size_t kMaxCameras = 512;
  static constexpr int64_t kStepNs = 20'000'000;
  static constexpr size_t kDefaultSteps = 2048;  // 40 s

  // At most kMaxCameras; `step_count` above 0, of 72 bytes each.
  explicit OverlapCounter(size_t camera_count, size_t step_count = kDefaultSteps);

  // The camera has seen the wand from `begin_ns` to `end_ns`, common time.
  void Add(size_t camera, int64_t begin_ns, int64_t end_ns);
  // What another counter of the same cameras has counted, of another time.
  void Add(const OverlapCounter& other);

  // How long both have seen it, seconds. `a` and `b` differ.
  double PairS(size_t a, size_t b) const;
  // How long this camera and at least one other have.
  double SharedS(size_t camera) const;
  size_t camera_count() const { return camera_count_; }

 private:
  struct Step {
    int64_t number = -1;
    std::bitset<kMaxCameras> cameras;
  };
  size_t PairIndex(size_t a, size_t b) const;

  size_t camera_count_;
  std::vector<Step> steps_;
  std::vector<uint32_t> pairs_;   // steps, by PairIndex
  std::vector<uint32_t> shared_;  // steps, by camera
};

}  // namespace rigcal::server
