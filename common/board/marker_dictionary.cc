// SPDX-License-Identifier: Apache-2.0
#include "common/board/marker_dictionary.h"

namespace rigcal {
namespace {

using Pointer = cv::Ptr<cv::aruco::Dictionary>;

[[maybe_unused]] Pointer AsPointer(const Pointer& dictionary) { return dictionary; }
[[maybe_unused]] Pointer AsPointer(const cv::aruco::Dictionary& dictionary) {
  return cv::makePtr<cv::aruco::Dictionary>(dictionary);
}

}  // namespace

Pointer MarkerDictionary(int number) {
  return AsPointer(cv::aruco::getPredefinedDictionary(number));
}

}  // namespace rigcal
