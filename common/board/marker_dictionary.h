// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <opencv2/aruco.hpp>

namespace rigcal {

// The dictionary with this number of OpenCV (cv::aruco::DICT_...): a pointer with OpenCV 4.6, where
// getPredefinedDictionary returns one, and with 4.7 and later, where it returns a value.
cv::Ptr<cv::aruco::Dictionary> MarkerDictionary(int number);

}  // namespace rigcal
