// SPDX-License-Identifier: Apache-2.0
#include "client/results/c3d_file.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "common/export/little_endian.h"
#include "common/status/status_macros.h"

namespace rigcal::client {
namespace {

constexpr size_t kBlockBytes = 512;
constexpr size_t kMostOfWord = 65'535;      // an unsigned word
constexpr size_t kLabelsOfParameter = 255;  // a dimension is a byte
constexpr size_t kMostLabelBytes = 127;
constexpr size_t kMostParameterBlocks = 255;
constexpr char kKey = 0x50;
constexpr char kIntel = 84;
constexpr int kMaskCameras = 7;

void PutWord(size_t value, std::string* bytes) {
  AppendLittleEndian(static_cast<uint16_t>(std::min(value, kMostOfWord)), bytes);
}

void PutFloat(double value, std::string* bytes) {
  AppendLittleEndian(std::bit_cast<uint32_t>(static_cast<float>(value)), bytes);
}

std::string Word(size_t value) {
  std::string bytes;
  PutWord(value, &bytes);
  return bytes;
}

std::string Float(double value) {
  std::string bytes;
  PutFloat(value, &bytes);
  return bytes;
}

void FillBlock(std::string* bytes) {
  bytes->resize((bytes->size() + kBlockBytes - 1) / kBlockBytes * kBlockBytes);
}

// Groups and parameters, one behind the other.
class ParameterSection {
 public:
  void Group(const std::string& name) {
    ++group_;
    Begin(name, -group_);
    // Behind the offset: the length of the description.
    AppendLittleEndian(static_cast<uint16_t>(3), &bytes_);
    bytes_.push_back(0);
  }
  void Words(const std::string& name, const std::string& data) { Add(name, 2, {}, data); }
  void Floats(const std::string& name, const std::string& data) { Add(name, 4, {}, data); }
  // A long of two words.
  void Long(const std::string& name, size_t value) {
    Add(name, 2, {2}, Word(value & kMostOfWord) + Word(value >> 16));
  }
  void Text(const std::string& name, const std::string& text) {
    Add(name, -1, {text.size()}, text);
  }
  // Padded to the longest.
  void Texts(const std::string& name, const std::vector<std::string>& texts) {
    size_t longest = 1;
    for (const std::string& text : texts) longest = std::max(longest, text.size());
    std::string data;
    for (std::string text : texts) {
      text.resize(longest, ' ');
      data += text;
    }
    Add(name, -1, {longest, texts.size()}, data);
  }

  // With the four bytes before it, in whole blocks. The offset of the last one is 0.
  absl::StatusOr<std::string> Bytes() const {
    std::string bytes = {1, kKey, 0, kIntel};
    bytes += bytes_ + std::string(2, '\0');
    bytes[4 + last_offset_] = bytes[5 + last_offset_] = 0;
    FillBlock(&bytes);
    const size_t blocks = bytes.size() / kBlockBytes;
    if (blocks > kMostParameterBlocks) {
      return absl::InvalidArgumentError("the labels are too many, or too long, for a C3D file");
    }
    bytes[2] = static_cast<char>(blocks);
    return bytes;
  }

 private:
  // Up to the offset to the next one.
  void Begin(const std::string& name, int group) {
    bytes_.push_back(static_cast<char>(name.size()));
    bytes_.push_back(static_cast<char>(group));
    bytes_ += name;
    last_offset_ = bytes_.size();
  }
  void Add(const std::string& name, int element_bytes, const std::vector<size_t>& dimensions,
           const std::string& data) {
    Begin(name, group_);
    const size_t size = 2 + 2 + dimensions.size() + data.size() + 1;
    AppendLittleEndian(static_cast<uint16_t>(size), &bytes_);
    bytes_.push_back(static_cast<char>(element_bytes));
    bytes_.push_back(static_cast<char>(dimensions.size()));
    for (const size_t dimension : dimensions) bytes_.push_back(static_cast<char>(dimension));
    bytes_ += data;
    bytes_.push_back(0);
  }

  std::string bytes_;
  size_t last_offset_ = 0;
  int group_ = 0;
};

// The magnitude of POINT:SCALE: the largest coordinate becomes 32000 in a file of integers.
double ScaleOf(const PointFrames& frames) {
  double largest_mm = 1;
  for (const TriangulatedPoint* point : frames.points) {
    if (point != nullptr) {
      largest_mm = std::max(largest_mm, 1000 * point->position_m.cwiseAbs().maxCoeff());
    }
  }
  return largest_mm / 32'000;
}

void AddLabels(const std::vector<std::string>& labels, ParameterSection* parameters) {
  for (size_t begin = 0; begin < labels.size(); begin += kLabelsOfParameter) {
    const size_t end = std::min(begin + kLabelsOfParameter, labels.size());
    const size_t number = begin / kLabelsOfParameter + 1;
    parameters->Texts(number == 1 ? "LABELS" : absl::StrCat("LABELS", number),
                      {labels.begin() + static_cast<std::ptrdiff_t>(begin),
                       labels.begin() + static_cast<std::ptrdiff_t>(end)});
  }
}

absl::StatusOr<std::string> ParametersOf(const PointFrames& frames, const std::string& calibration,
                                         double scale_mm, size_t data_block) {
  ParameterSection parameters;
  parameters.Group("POINT");
  parameters.Words("USED", Word(frames.labels.size()));
  parameters.Floats("SCALE", Float(-scale_mm));
  parameters.Floats("RATE", Float(frames.rate_hz));
  parameters.Words("DATA_START", Word(data_block));
  parameters.Words("FRAMES", Word(frames.frame_count));
  if (frames.frame_count > kMostOfWord) {
    parameters.Floats("LONG_FRAMES", Float(static_cast<double>(frames.frame_count)));
  }
  parameters.Text("UNITS", "mm");
  AddLabels(frames.labels, &parameters);
  parameters.Group("ANALOG");
  parameters.Words("USED", Word(0));
  parameters.Floats("GEN_SCALE", Float(1));
  parameters.Floats("RATE", Float(frames.rate_hz));
  if (frames.frame_count > kMostOfWord) {
    parameters.Group("TRIAL");
    parameters.Long("ACTUAL_START_FIELD", 1);
    parameters.Long("ACTUAL_END_FIELD", frames.frame_count);
  }
  parameters.Group("RIGCAL");
  parameters.Text("CALIBRATION", calibration.substr(0, 255));
  parameters.Text("FIRST_TIME_NS", absl::StrCat(frames.first_ns));
  return parameters.Bytes();
}

std::string C3dHeader(const PointFrames& frames, double scale_mm, size_t data_block) {
  std::string header = {2, kKey};
  PutWord(frames.labels.size(), &header);
  PutWord(0, &header);  // analog measurements of a frame
  PutWord(1, &header);
  PutWord(frames.frame_count, &header);
  PutWord(0, &header);  // nothing is interpolated
  PutFloat(-scale_mm, &header);
  PutWord(data_block, &header);
  PutWord(0, &header);
  PutFloat(frames.rate_hz, &header);
  FillBlock(&header);
  return header;
}

// The fourth word of a point: the cameras in the high byte, the residual in the low one.
double MaskAndResidual(const TriangulatedPoint& point, double scale_mm) {
  int mask = 0;
  for (const PixelView& view : point.views) {
    if (view.camera < kMaskCameras) mask |= 1 << view.camera;
  }
  const double sigma_mm = 1000 * std::sqrt(point.noise_m2.trace());
  // 0 would say that the point is not measured.
  return 256.0 * mask + std::clamp(std::round(sigma_mm / scale_mm), 1.0, 255.0);
}

}  // namespace

absl::StatusOr<std::string> C3dFile(const PointFrames& frames, const std::string& calibration) {
  if (frames.labels.size() > kMostOfWord) {
    return absl::InvalidArgumentError(absl::StrCat("a C3D file has at most ", kMostOfWord,
                                                   " markers, not ", frames.labels.size()));
  }
  for (const std::string& label : frames.labels) {
    if (label.size() <= kMostLabelBytes) continue;
    return absl::InvalidArgumentError(absl::StrCat("the label ", label.substr(0, 40),
                                                   "... is too long for a C3D file, which has ",
                                                   kMostLabelBytes, " letters for it"));
  }
  const double scale_mm = ScaleOf(frames);
  // The place of the data does not change the size of the parameters.
  RIGCAL_ASSIGN_OR_RETURN(std::string parameters, ParametersOf(frames, calibration, scale_mm, 0));
  const size_t data_block = 2 + parameters.size() / kBlockBytes;
  RIGCAL_ASSIGN_OR_RETURN(parameters, ParametersOf(frames, calibration, scale_mm, data_block));
  std::string file = C3dHeader(frames, scale_mm, data_block) + parameters;
  file.reserve(file.size() + 16 * frames.points.size() + kBlockBytes);
  for (const TriangulatedPoint* point : frames.points) {
    const Eigen::Vector3d at_mm =
        point == nullptr ? Eigen::Vector3d::Zero() : Eigen::Vector3d(1000 * point->position_m);
    for (const double coordinate : {at_mm.x(), at_mm.y(), at_mm.z()}) PutFloat(coordinate, &file);
    PutFloat(point == nullptr ? -1 : MaskAndResidual(*point, scale_mm), &file);
  }
  FillBlock(&file);
  return file;
}

}  // namespace rigcal::client
