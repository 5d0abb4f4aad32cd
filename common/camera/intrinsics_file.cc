// SPDX-License-Identifier: Apache-2.0
#include "common/camera/intrinsics_file.h"

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <opencv2/core.hpp>
#include <optional>
#include <system_error>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/escaping.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "common/status/status_macros.h"
#include "common/text/nesting.h"

namespace rigcal {
namespace {

// INVALID_ARGUMENT: "PATH, line N: WHY".
absl::Status YamlLineError(const std::string& path, int line, const std::string& why) {
  return absl::InvalidArgumentError(absl::StrCat(path, ", line ", line, ": ", why));
}

// Refuses what OpenCV's parser does not survive: bytes that are not text, and deep nesting.
absl::Status CheckBytes(const std::string& path, const std::string& text) {
  int line = 1;
  for (const char c : text) {
    const unsigned char byte = static_cast<unsigned char>(c);
    if ((byte < 0x20 && c != '\n' && c != '\r' && c != '\t') || byte == 0x7f) {
      return YamlLineError(path, line,
                           absl::StrCat("byte 0x", absl::Hex(byte), " is not text; is this YAML?"));
    }
    if (c == '\n') ++line;
  }
  const std::optional<int> deep = LineNestedTooDeep(NestedFormat::kYaml, text);
  return deep ? YamlLineError(path, *deep, kNestedTooDeep) : absl::OkStatus();
}

// A line of the one document that a calibration file has: a field, or part of a field.
bool IsFieldLine(absl::string_view row, bool first) {
  const size_t begin = row.find_first_not_of(' ');
  const char c = row[begin];
  if (begin == 0 && (absl::ascii_isalnum(static_cast<unsigned char>(c)) || c == '_')) return true;
  if (first || begin == 0) return false;
  const bool dashes = c == '-' && begin + 1 < row.size() && row[begin + 1] == '-';
  return absl::ascii_isgraph(static_cast<unsigned char>(c)) && !dashes;
}

constexpr size_t kMaxFileBytes = 256 * 1024;

absl::StatusOr<std::string> ReadText(const std::string& path) {
  std::error_code error;
  const std::filesystem::file_status status = std::filesystem::status(path, error);
  if (!std::filesystem::exists(status)) {
    return absl::NotFoundError(absl::StrCat(path, ": no such calibration file"));
  }
  if (!std::filesystem::is_regular_file(status)) {
    return absl::InvalidArgumentError(
        absl::StrCat(path, ": is not a file; name the camera's calibration YAML"));
  }
  std::ifstream file(path, std::ios::binary);
  if (!file) return absl::PermissionDeniedError(absl::StrCat(path, ": cannot open"));
  std::string text(kMaxFileBytes + 1, '\0');
  file.read(text.data(), static_cast<std::streamsize>(text.size()));
  if (file.bad()) return absl::DataLossError(absl::StrCat(path, ": cannot read"));
  text.resize(static_cast<size_t>(file.gcount()));
  if (text.size() <= kMaxFileBytes) return text;
  return absl::InvalidArgumentError(absl::StrCat(path, ": is larger than ", kMaxFileBytes,
                                                 " bytes, too large for the "
                                                 "calibration of a camera"));
}

// Reads fields by name, and names file, line and field in every error.
class FieldReader {
 public:
  FieldReader(const std::string& path, const std::string& text, const cv::FileNode& root)
      : path_(path), text_(text), root_(root) {}

  const std::string& path() const { return path_; }

  template <typename... Pieces>
  absl::Status Error(const std::string& field, const Pieces&... why) const {
    // The parser keeps no lines; fields of interest stand at the beginning of theirs.
    int line = 1;
    for (const absl::string_view row : absl::StrSplit(text_, '\n')) {
      if (absl::StartsWith(row, absl::StrCat(field, ":"))) {
        return YamlLineError(path_, line, absl::StrCat(field, " ", why...));
      }
      ++line;
    }
    return absl::InvalidArgumentError(absl::StrCat(path_, ": ", field, " ", why...));
  }

  absl::StatusOr<cv::FileNode> Field(const std::string& name) const {
    const cv::FileNode node = root_[name];
    if (node.empty() || node.isNone()) return Error(name, "is missing");
    return node;
  }

  absl::StatusOr<uint32_t> ImageSide(const std::string& name) const {
    RIGCAL_ASSIGN_OR_RETURN(const cv::FileNode node, Field(name));
    const std::optional<double> value = Number(node);
    if (!value || !(*value >= 1 && *value <= kMaxImageSidePx) || *value != std::floor(*value)) {
      return Error(name, "is ", Show(node), ", it must be a whole number of pixels, 1 to ",
                   kMaxImageSidePx);
    }
    return static_cast<uint32_t>(*value);
  }

  // A matrix, tagged !!opencv-matrix or a plain map.
  absl::StatusOr<cv::Mat1d> ReadMatrix(const std::string& name) const {
    RIGCAL_ASSIGN_OR_RETURN(const cv::FileNode node, Field(name));
    if (!node.isMap()) return Error(name, "is not a matrix with rows, cols and data");
    const cv::FileNode data = node["data"];
    const std::optional<double> rows = Number(node["rows"]);
    const std::optional<double> cols = Number(node["cols"]);
    if (!rows || !cols || !data.isSeq()) {
      return Error(name, "is not a matrix with rows, cols and data");
    }
    if (!(*rows >= 1 && *rows <= 64 && *cols >= 1 && *cols <= 64)) {
      return Error(name, "has ", *rows, " x ", *cols, " elements");
    }
    cv::Mat1d matrix(static_cast<int>(*rows), static_cast<int>(*cols));
    if (data.size() != matrix.total()) {
      return Error(name, "says ", matrix.rows, " x ", matrix.cols, " but has ", data.size(),
                   " values");
    }
    double* next = matrix.ptr<double>();
    for (const cv::FileNode& element : data) {
      const std::optional<double> value = Number(element);
      if (!value || !std::isfinite(*value)) {
        return Error(name, "has the value ", Show(element), " at index ",
                     next - matrix.ptr<double>(), ", it must be a finite number");
      }
      *next++ = *value;
    }
    return matrix;
  }

 private:
  static std::optional<double> Number(const cv::FileNode& node) {
    if (node.isInt() || node.isReal()) return static_cast<double>(node);
    return std::nullopt;
  }

  static std::string Show(const cv::FileNode& node) {
    if (node.isString()) {
      return absl::StrCat("\"", absl::CHexEscape(node.string().substr(0, 64)), "\"");
    }
    const std::optional<double> number = Number(node);
    return number ? absl::StrCat(*number) : "a list or map";
  }

  const std::string& path_;
  const std::string& text_;
  const cv::FileNode root_;
};

absl::Status ReadCameraMatrix(const FieldReader& reader, Intrinsics* intrinsics) {
  RIGCAL_ASSIGN_OR_RETURN(const cv::Mat1d m, reader.ReadMatrix("camera_matrix"));
  if (m.rows != 3 || m.cols != 3) {
    return reader.Error("camera_matrix", "is ", m.rows, " x ", m.cols, ", not 3 x 3");
  }
  intrinsics->fx_px = m(0, 0);
  intrinsics->cx_px = m(0, 2);
  intrinsics->fy_px = m(1, 1);
  intrinsics->cy_px = m(1, 2);
  if (!(m(0, 0) > 0 && m(1, 1) > 0)) {
    return reader.Error("camera_matrix", "has focal lengths ", m(0, 0), " and ", m(1, 1),
                        ", they must be positive");
  }
  // A matrix written by rows instead of columns, or one with skew, would be misread silently.
  const double negligible = 1e-9 * m(0, 0);
  for (const double zero : {m(0, 1), m(1, 0), m(2, 0), m(2, 1), (m(2, 2) - 1) * m(0, 0)}) {
    if (std::abs(zero) <= negligible) continue;
    return reader.Error("camera_matrix",
                        "must have the form fx 0 cx, 0 fy cy, 0 0 1 (skew is not supported)");
  }
  return absl::OkStatus();
}

absl::StatusOr<std::optional<DistortionModel>> ReadModel(const FieldReader& reader) {
  const absl::StatusOr<cv::FileNode> node = reader.Field("distortion_model");
  if (!node.ok()) return std::nullopt;
  const std::string name = node->isString() ? node->string() : "";
  for (const DistortionModel model :
       {DistortionModel::kBrownConrady, DistortionModel::kRational, DistortionModel::kFisheye}) {
    if (name == DistortionModelName(model)) return model;
  }
  return reader.Error("distortion_model", "is \"", absl::CHexEscape(name.substr(0, 64)),
                      "\", known are plumb_bob, rational_polynomial and equidistant");
}

absl::Status ReadDistortion(const FieldReader& reader, Intrinsics* intrinsics) {
  RIGCAL_ASSIGN_OR_RETURN(const std::optional<DistortionModel> model, ReadModel(reader));
  RIGCAL_ASSIGN_OR_RETURN(const cv::Mat1d matrix, reader.ReadMatrix("distortion_coefficients"));
  const size_t count = matrix.total();
  if (matrix.rows != 1 && matrix.cols != 1) {
    return reader.Error("distortion_coefficients", "is ", matrix.rows, " x ", matrix.cols,
                        ", not one row or column");
  }
  intrinsics->model =
      model.value_or(count == 8 ? DistortionModel::kRational : DistortionModel::kBrownConrady);
  intrinsics->distortion.assign(matrix.begin(), matrix.end());
  if (intrinsics->model == DistortionModel::kBrownConrady && count == 4) {
    intrinsics->distortion.push_back(0);  // OpenCV's short form, without k3
  }
  const int expected = CoefficientCount(intrinsics->model);
  if (intrinsics->distortion.size() != static_cast<size_t>(expected)) {
    return reader.Error("distortion_coefficients", "has ", count, " values, ",
                        std::string(DistortionModelName(intrinsics->model)), " has ", expected);
  }
  return absl::OkStatus();
}

absl::StatusOr<IntrinsicsFile> ReadFields(const FieldReader& reader) {
  IntrinsicsFile file;
  RIGCAL_ASSIGN_OR_RETURN(file.image_size_px.width, reader.ImageSide("image_width"));
  RIGCAL_ASSIGN_OR_RETURN(file.image_size_px.height, reader.ImageSide("image_height"));
  RIGCAL_RETURN_IF_ERROR(ReadCameraMatrix(reader, &file.intrinsics));
  RIGCAL_RETURN_IF_ERROR(ReadDistortion(reader, &file.intrinsics));
  const absl::Status valid = file.intrinsics.Validate(file.image_size_px);
  if (!valid.ok()) return reader.Error("camera_matrix", std::string(valid.message()));
  return file;
}

// OpenCV begins parse errors with the line in brackets, "(12): Incorrect indentation", and its
// version 4.6 puts that text where the function's name belongs.
absl::Status ParseError(const std::string& path, const cv::Exception& exception) {
  for (const std::string& text : {exception.err, exception.func}) {
    int line = 0;
    const std::vector<std::string> parts = absl::StrSplit(text, absl::MaxSplits("): ", 1));
    if (parts.size() == 2 && absl::StartsWith(parts[0], "(") &&
        absl::SimpleAtoi(parts[0].substr(1), &line)) {
      return YamlLineError(path, line, parts[1]);
    }
  }
  return absl::InvalidArgumentError(
      absl::StrCat(path, ": OpenCV cannot read it as YAML: ", exception.err));
}

absl::StatusOr<CameraFile> ReadCameraFields(const FieldReader& reader) {
  CameraFile file;
  RIGCAL_ASSIGN_OR_RETURN(file.lens, ReadFields(reader));
  file.camera = std::filesystem::path(reader.path()).stem().string();
  if (reader.Field("extrinsics").ok()) {
    RIGCAL_ASSIGN_OR_RETURN(const cv::Mat1d pose, reader.ReadMatrix("extrinsics"));
    if ((pose.rows != 3 && pose.rows != 4) || pose.cols != 4) {
      return reader.Error("extrinsics", "is ", pose.rows, " x ", pose.cols, ", not 3 x 4 or 4 x 4");
    }
    file.extrinsics.emplace(Eigen::Matrix4d::Identity());
    file.extrinsics->topRows(pose.rows) =
        Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, 4, Eigen::RowMajor>>(
            pose.ptr<double>(), pose.rows, 4);
    if (file.extrinsics->row(3) != Eigen::RowVector4d(0, 0, 0, 1)) {
      return reader.Error("extrinsics", "has a last row that is not 0 0 0 1; is it transposed?");
    }
  }
  return file;
}

template <typename File>
absl::StatusOr<File> ReadFile(const std::string& path,
                              absl::StatusOr<File> (*read)(const FieldReader&)) {
  RIGCAL_ASSIGN_OR_RETURN(const std::string content, ReadText(path));
  RIGCAL_ASSIGN_OR_RETURN(const std::string text, SingleDocument(path, content));
  try {
    const cv::FileStorage storage(text, cv::FileStorage::READ | cv::FileStorage::MEMORY);
    const cv::FileNode root = storage.isOpened() ? storage.root() : cv::FileNode();
    if (!root.isMap()) {
      return absl::InvalidArgumentError(
          absl::StrCat(path, ": has no fields (image_width, camera_matrix, ...)"));
    }
    return read(FieldReader(path, text, root));
  } catch (const cv::Exception& exception) {
    return ParseError(path, exception);
  } catch (const std::exception& exception) {
    return absl::InvalidArgumentError(
        absl::StrCat(path, ": OpenCV cannot read it as YAML: ", exception.what()));
  }
}

}  // namespace

absl::StatusOr<std::string> SingleDocument(const std::string& path, const std::string& text) {
  if (text.find_first_not_of(" \t\r\n") == std::string::npos) {
    return absl::InvalidArgumentError(absl::StrCat(path, ": is empty"));
  }
  if (!absl::StartsWith(text, "%YAML")) {
    return YamlLineError(path, 1,
                         "does not begin with %YAML:1.0, as OpenCV's calibration files do");
  }
  RIGCAL_RETURN_IF_ERROR(CheckBytes(path, text));
  std::string document = "%YAML:1.0\n";
  int line = 0;
  bool first = true;
  for (absl::string_view row : absl::StrSplit(text, '\n')) {
    if (++line == 1) continue;
    row = absl::StripTrailingAsciiWhitespace(row);
    if (row == "...") break;
    const bool skipped =
        row.empty() || absl::StripLeadingAsciiWhitespace(row)[0] == '#' || (first && row == "---");
    if (!skipped) {
      if (row.find('\t') != absl::string_view::npos) {
        return YamlLineError(path, line, "has a tab; YAML is indented by spaces");
      }
      if (!IsFieldLine(row, first)) {
        return YamlLineError(path, line,
                             "is neither a field (\"image_width: 1280\") nor part of one");
      }
      first = false;
      absl::StrAppend(&document, row);
    }
    absl::StrAppend(&document, "\n");
  }
  return document;
}

absl::StatusOr<IntrinsicsFile> ReadIntrinsicsFile(const std::string& path) {
  return ReadFile<IntrinsicsFile>(path, &ReadFields);
}

absl::StatusOr<CameraFile> ReadCameraFile(const std::string& path) {
  return ReadFile<CameraFile>(path, &ReadCameraFields);
}

}  // namespace rigcal
