// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/image_file.h"

#include <algorithm>
#include <array>
#include <bit>
#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

constexpr std::array kEndings = {".png",  ".jpg", ".jpeg", ".bmp", ".tif",
                                 ".tiff", ".pgm", ".ppm",  ".pnm", ".webp"};
constexpr std::uintmax_t kMaxFileBytes = 1u << 30;
constexpr size_t kMaxTrailingBytes = 4096;

absl::StatusOr<std::vector<uchar>> ReadBytes(const std::string& path) {
  std::error_code error;
  const std::uintmax_t size = std::filesystem::file_size(path, error);
  if (error) return absl::NotFoundError(absl::StrCat("there is no image ", path));
  if (size == 0) return absl::DataLossError(absl::StrCat(path, " is empty"));
  if (size > kMaxFileBytes) {
    return absl::DataLossError(absl::StrCat(path, " has ", size, " bytes; no image has"));
  }
  std::vector<uchar> bytes(size);
  std::ifstream stream(path, std::ios::binary);
  stream.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(size));
  if (!stream) return absl::DataLossError(absl::StrCat("cannot read ", path));
  return bytes;
}

// OpenCV fills what is missing of a JPEG with grey and says nothing. Its end marker cannot occur
// inside of what is coded.
bool IsTruncatedJpeg(const std::vector<uchar>& bytes) {
  if (bytes.size() < 4 || bytes[0] != 0xFF || bytes[1] != 0xD8) return false;
  const size_t first = bytes.size() - std::min(bytes.size(), kMaxTrailingBytes);
  for (size_t i = bytes.size() - 1; i > first; --i) {
    if (bytes[i - 1] == 0xFF && bytes[i] == 0xD9) return false;
  }
  return true;
}

// The length a BMP says it has; OpenCV takes what is missing for black.
bool IsTruncatedBmp(const std::vector<uchar>& bytes) {
  if (bytes.size() < 6 || bytes[0] != 'B' || bytes[1] != 'M') return false;
  const size_t said =
      bytes[2] | bytes[3] << 8 | bytes[4] << 16 | static_cast<size_t>(bytes[5]) << 24;
  return bytes.size() < said;
}

}  // namespace

ImageView ViewOf(const cv::Mat& image) {
  return {.data = image.data,
          .width = image.cols,
          .height = image.rows,
          .stride_bytes = static_cast<ptrdiff_t>(image.step[0]),
          .format = image.channels() == 1 ? PixelFormat::kMono8 : PixelFormat::kBgr8};
}

absl::StatusOr<cv::Mat> AsEightBit(const cv::Mat& image, int bits) {
  if (image.empty()) return absl::InvalidArgumentError("the image has no pixels");
  if (image.type() == CV_8UC1 || image.type() == CV_8UC3) return image;
  cv::Mat eight_bit = image;
  if (image.depth() == CV_16U) {
    image.convertTo(eight_bit, CV_8U, 255.0 / ((1 << bits) - 1));
  } else if (image.depth() != CV_8U) {
    return absl::InvalidArgumentError("its pixels have neither 8 nor 16 bits");
  }
  if (eight_bit.channels() == 4) cv::cvtColor(eight_bit, eight_bit, cv::COLOR_BGRA2BGR);
  if (eight_bit.channels() == 2) cv::extractChannel(eight_bit, eight_bit, 0);  // grey and alpha
  return eight_bit;
}

bool IsImageName(std::string_view name) {
  const std::string lower = absl::AsciiStrToLower(std::string(name));
  return std::any_of(kEndings.begin(), kEndings.end(),
                     [&](const char* ending) { return absl::EndsWith(lower, ending); });
}

absl::StatusOr<cv::Mat> ReadImage(const std::string& path, int bits, int* used_bits) {
  RIGCAL_ASSIGN_OR_RETURN(const std::vector<uchar> bytes, ReadBytes(path));
  if (IsTruncatedJpeg(bytes) || IsTruncatedBmp(bytes)) {
    return absl::DataLossError(absl::StrCat(path, " is cut short"));
  }
  cv::Mat decoded;
  try {
    decoded = cv::imdecode(bytes, cv::IMREAD_UNCHANGED);
  } catch (const cv::Exception&) {
    decoded.release();
  }
  if (decoded.empty()) {
    return absl::DataLossError(absl::StrCat(path, " is truncated, damaged or not an image"));
  }
  if (used_bits != nullptr) {
    double brightest = 0;
    if (decoded.depth() == CV_16U) cv::minMaxLoc(decoded.reshape(1), nullptr, &brightest);
    *used_bits = std::max(8, static_cast<int>(std::bit_width(static_cast<unsigned>(brightest))));
  }
  absl::StatusOr<cv::Mat> image = AsEightBit(decoded, bits);
  if (image.ok()) return image;
  return absl::DataLossError(absl::StrCat(path, ": ", std::string(image.status().message())));
}

}  // namespace rigcal::agent
