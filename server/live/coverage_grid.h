// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>

#include "common/camera/intrinsics.h"
#include "server/live/arrivals.h"

namespace rigcal::server {

// Counts marker centres in cells of one camera's image.
class CoverageGrid {
 public:
  static constexpr uint32_t kColumns = 16;
  static constexpr uint32_t kRows = 12;

  // The visible markers of a row.
  void Add(const ThinnedRow& row, ImageSize size);
  void Add(const CoverageGrid& other);

  // One octet per cell, row by row; 255: that many or more.
  std::string Counts() const { return {cells_.begin(), cells_.end()}; }
  // The share of the cells with at least ten centres.
  double CoveredShare() const;

 private:
  std::array<uint8_t, size_t{kColumns}* kRows> cells_ = {};
};

}  // namespace rigcal::server
