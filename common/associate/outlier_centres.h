// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

namespace rigcal {

// Finds centres of one marker far from the position that their neighbours predict: further than
// 15 px, and 12 times what is usual. Neighbours further away than `gap_s` are ignored; a centre
// with fewer than three of them is believed. Times ascend.
std::vector<bool> FindOutlierCentres(const std::vector<int64_t>& times_ns,
                                     const std::vector<Eigen::Vector2d>& centres_px, double gap_s);

}  // namespace rigcal
