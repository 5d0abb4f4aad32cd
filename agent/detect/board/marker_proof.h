// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "agent/detect/board/board_detector.h"
#include "agent/detect/board/found_marker.h"
#include "agent/detect/board/printed_pattern.h"

namespace rigcal::agent {

// The squares of a board look alike: what proves which of them is which.

// The markers within `reach_m` of one are where it expects them, or half of them are, as they may
// be misread, too. False: it is misread, or the board is one of other counts.
bool AgreesWithThoseBeside(const PrintedPattern& pattern, const FoundMarker& marker,
                           const std::vector<FoundMarker>& markers, double reach_m);

// Most of these markers are where the points of the board have them.
bool HasItsMarkers(const PrintedPattern& pattern, const SeenBoard& seen,
                   const std::vector<FoundMarker>& markers);

// `grey` (CV_8UC1) shows the bits of the markers that have four points within `reach_m`: of two or
// more by themselves, and of all together. `blur_px`: one sigma of the lens.
bool ShowsItsBits(const PrintedPattern& pattern, const cv::Mat& grey, const SeenBoard& seen,
                  double blur_px, double reach_m);

}  // namespace rigcal::agent
