// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "agent/detect/blobs/image_view.h"
#include "common/camera/camera_description.h"

namespace rigcal::agent {

// `picture` is CV_8UC1 or CV_8UC3 (BGR) and outlives the view.
ImageView ViewOf(const cv::Mat& picture);

// CV_8UC1 or CV_8UC3 from what decoders give: 16 bits lose the lower eight, alpha is left out.
// INVALID_ARGUMENT: another depth or number of channels.
absl::StatusOr<cv::Mat> AsEightBit(const cv::Mat& picture);

// True for the endings of picture files (.png, .jpg, .bmp, .tif, ...) in any case.
bool IsImageName(std::string_view name);

// A picture from a file, as it lies on the sensor (EXIF rotation is ignored), CV_8UC1 or CV_8UC3.
// NOT_FOUND: no such file. DATA_LOSS: it is empty, truncated, damaged or no picture. Both name it.
absl::StatusOr<cv::Mat> ReadImage(const std::string& path);

// What is known of a camera whose pictures are recorded: its own clock, time base "recording".
// `calibration_path` empty: no intrinsics. INVALID_ARGUMENT: the calibration cannot be read, or is
// one for pictures of another size than `picture_size`; `picture` names the one that was looked at.
absl::StatusOr<CameraDescription> DescribeRecordedCamera(const std::string& camera,
                                                         const std::string& calibration_path,
                                                         cv::Size picture_size,
                                                         const std::string& picture);

}  // namespace rigcal::agent
