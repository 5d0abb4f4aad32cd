// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <opencv2/aruco.hpp>
#include <opencv2/imgproc.hpp>

namespace rigcal::testing {

// A marker with a black border of one bit, `side_px` square, as OpenCV draws it: by drawMarker
// until 4.6, by generateImageMarker from 4.7 on.
inline cv::Mat MarkerPicture(const cv::aruco::Dictionary& dictionary, int id, int side_px) {
  const cv::Mat bits = cv::aruco::Dictionary::getBitsFromByteList(dictionary.bytesList.row(id),
                                                                  dictionary.markerSize);
  cv::Mat cells(bits.rows + 2, bits.cols + 2, CV_8UC1, cv::Scalar(0)), picture;
  cv::Mat(bits * 255).copyTo(cells(cv::Rect(1, 1, bits.cols, bits.rows)));
  cv::resize(cells, picture, cv::Size(side_px, side_px), 0, 0, cv::INTER_NEAREST);
  return picture;
}

}  // namespace rigcal::testing
