// SPDX-License-Identifier: Apache-2.0
// The fields of OpenCV's calibration files and of ROS's camera_info: image_width, image_height,
// camera_matrix, distortion_coefficients, and the model's name as ROS (distortion_model) or as
// OpenCV's sample (fisheye_model) writes it.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <optional>

#include "absl/strings/ascii.h"
#include "absl/strings/escaping.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/strip.h"
#include "common/import/import_readers.h"
#include "common/import/lens_tree.h"
#include "common/status/status_macros.h"

namespace rigcal {
namespace {

constexpr char kWidthField[] = "image_width";
constexpr char kHeightField[] = "image_height";
constexpr char kMatrixField[] = "camera_matrix";
constexpr char kModelField[] = "distortion_model";
constexpr char kDistortionField[] = "distortion_coefficients";
constexpr char kPoseField[] = "extrinsics";

using LensMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

std::optional<double> NumberOf(const LensNode& node) {
  double value = 0;
  if (node.kind != LensNode::Kind::kScalar || !absl::SimpleAtod(node.text, &value)) {
    return std::nullopt;
  }
  return value;
}

std::string Show(const LensNode& node) {
  if (node.kind != LensNode::Kind::kScalar) return "a list or map";
  const std::optional<double> number = NumberOf(node);
  if (number) return absl::StrCat(*number);
  return absl::StrCat("\"", absl::CHexEscape(node.text.substr(0, 64)), "\"");
}

// Reads fields by name, and names file, line and field in every error.
class LensFields {
 public:
  LensFields(const std::string& path, const LensNode& root) : path_(path), root_(root) {}

  const LensNode* Find(const char* name) const {
    const LensNode* const node = root_.Find(name);
    return node == nullptr || node->kind == LensNode::Kind::kNone ? nullptr : node;
  }

  template <typename... Pieces>
  absl::Status Error(const char* field, const Pieces&... why) const {
    const LensNode* const node = root_.Find(field);
    return ImportError(path_, node != nullptr ? node->line : 0, absl::StrCat(field, " ", why...));
  }

  absl::StatusOr<const LensNode*> Field(const char* name) const {
    if (const LensNode* const node = Find(name)) return node;
    constexpr size_t kMostShown = 16;
    std::vector<std::string> found;
    for (const auto& [key, value] : root_.fields) {
      found.push_back(found.size() < kMostShown ? absl::CHexEscape(key.substr(0, 40)) : "...");
      if (found.size() > kMostShown) break;
    }
    return Error(name, "is missing; the file has ", absl::StrJoin(found, ", "), "; a lens has ",
                 kWidthField, ", ", kHeightField, ", ", kMatrixField, ", ", kDistortionField,
                 " and maybe ", kModelField);
  }

  absl::StatusOr<uint32_t> ImageSide(const char* name) const {
    RIGCAL_ASSIGN_OR_RETURN(const LensNode* const node, Field(name));
    const std::optional<double> value = NumberOf(*node);
    if (!value || !(*value >= 1 && *value <= kMaxImageSidePx) || *value != std::floor(*value)) {
      return Error(name, "is ", Show(*node), ", it must be a whole number of pixels, 1 to ",
                   kMaxImageSidePx);
    }
    return static_cast<uint32_t>(*value);
  }

  absl::StatusOr<std::vector<double>> Values(const char* name, const LensNode& node) const {
    std::vector<double> values;
    // A text of one number is a list of one in OpenCV's XML.
    const std::vector<LensNode> one = {node};
    for (const LensNode& item : node.kind == LensNode::Kind::kScalar ? one : node.items) {
      const std::optional<double> value = NumberOf(item);
      if (!value || !std::isfinite(*value)) {
        return Error(name, "has the value ", Show(item), " at index ", values.size(),
                     ", it must be a finite number");
      }
      values.push_back(*value);
    }
    return values;
  }

  // OpenCV's and ROS's rows, cols and data, or a list of rows. `other_count`: so many values may
  // stand in a row that says another number of columns.
  absl::StatusOr<LensMatrix> Matrix(const char* name, size_t other_count = 0) const {
    RIGCAL_ASSIGN_OR_RETURN(const LensNode* const node, Field(name));
    if (node->kind == LensNode::Kind::kList) return MatrixOfRows(name, *node);
    const LensNode* const data = node->Find("data");
    const LensNode* const row_node = node->Find("rows");
    const LensNode* const col_node = node->Find("cols");
    std::optional<double> rows, cols;
    if (row_node != nullptr) rows = NumberOf(*row_node);
    if (col_node != nullptr) cols = NumberOf(*col_node);
    if (!rows || !cols || data == nullptr ||
        (data->kind != LensNode::Kind::kList && data->kind != LensNode::Kind::kScalar)) {
      return Error(name, "is not a matrix with rows, cols and data");
    }
    if (!(*rows >= 1 && *rows <= 64 && *cols >= 1 && *cols <= 64)) {
      return Error(name, "has ", *rows, " x ", *cols, " elements");
    }
    RIGCAL_ASSIGN_OR_RETURN(const std::vector<double> values, Values(name, *data));
    if (*rows == 1 && other_count > 0 && values.size() == other_count) {
      *cols = static_cast<double>(other_count);
    }
    if (static_cast<double>(values.size()) != *rows * *cols) {
      return Error(name, "says ", *rows, " x ", *cols, " but has ", values.size(), " values");
    }
    return LensMatrix(Eigen::Map<const LensMatrix>(values.data(), static_cast<Eigen::Index>(*rows),
                                                   static_cast<Eigen::Index>(*cols)));
  }

 private:
  absl::StatusOr<LensMatrix> MatrixOfRows(const char* name, const LensNode& node) const {
    const bool nested = !node.items.empty() && node.items.front().kind == LensNode::Kind::kList;
    std::vector<std::vector<double>> rows;
    if (nested) {
      for (const LensNode& item : node.items) {
        RIGCAL_ASSIGN_OR_RETURN(rows.emplace_back(), Values(name, item));
        if (rows.back().size() != rows.front().size() || rows.back().empty()) {
          return Error(name, "has rows of ", rows.front().size(), " and of ", rows.back().size(),
                       " values");
        }
      }
    } else {
      RIGCAL_ASSIGN_OR_RETURN(rows.emplace_back(), Values(name, node));
      if (rows.back().empty()) return Error(name, "has no values");
    }
    LensMatrix matrix(rows.size(), rows.front().size());
    for (size_t i = 0; i < rows.size(); ++i) {
      matrix.row(static_cast<Eigen::Index>(i)) = Eigen::Map<const Eigen::RowVectorXd>(
          rows[i].data(), static_cast<Eigen::Index>(rows[i].size()));
    }
    return matrix;
  }

  const std::string& path_;
  const LensNode& root_;
};

absl::Status ReadCameraMatrix(const LensFields& fields, Intrinsics* intrinsics) {
  RIGCAL_ASSIGN_OR_RETURN(const LensMatrix m, fields.Matrix(kMatrixField));
  if (m.rows() != 3 || m.cols() != 3) {
    return fields.Error(kMatrixField, "is ", m.rows(), " x ", m.cols(), ", not 3 x 3");
  }
  intrinsics->fx_px = m(0, 0);
  intrinsics->cx_px = m(0, 2);
  intrinsics->fy_px = m(1, 1);
  intrinsics->cy_px = m(1, 2);
  if (!(m(0, 0) > 0 && m(1, 1) > 0)) {
    return fields.Error(kMatrixField, "has focal lengths ", m(0, 0), " and ", m(1, 1),
                        ", they must be positive");
  }
  // A matrix written by rows instead of columns, or one with skew, would be misread silently.
  const double negligible = 1e-9 * m(0, 0);
  for (const double zero : {m(0, 1), m(1, 0), m(2, 0), m(2, 1), (m(2, 2) - 1) * m(0, 0)}) {
    if (std::abs(zero) <= negligible) continue;
    return fields.Error(kMatrixField,
                        "must have the form fx 0 cx, 0 fy cy, 0 0 1 (skew is not supported)");
  }
  return absl::OkStatus();
}

struct ModelWord {
  const char* word;
  DistortionModel model;
};
constexpr ModelWord kModelWords[] = {{"plumb_bob", DistortionModel::kBrownConrady},
                                     {"radtan", DistortionModel::kBrownConrady},
                                     {"rational_polynomial", DistortionModel::kRational},
                                     {"equidistant", DistortionModel::kFisheye},
                                     {"fisheye", DistortionModel::kFisheye},
                                     {"kannala_brandt", DistortionModel::kFisheye}};

absl::StatusOr<std::optional<DistortionModel>> ReadModel(const LensFields& fields) {
  std::optional<DistortionModel> model;
  if (const LensNode* const node = fields.Find(kModelField)) {
    std::vector<std::string> words;
    for (const ModelWord& known : kModelWords) {
      if (absl::EqualsIgnoreCase(node->text, known.word)) model = known.model;
      words.emplace_back(known.word);
    }
    if (!model) {
      return fields.Error(kModelField, "is ", Show(*node), ", known are ",
                          absl::StrJoin(words, ", "));
    }
  }
  constexpr char kFisheyeField[] = "fisheye_model";
  const LensNode* const node = fields.Find(kFisheyeField);
  if (node == nullptr) return model;
  const bool yes = node->text == "1" || absl::EqualsIgnoreCase(node->text, "true");
  if (!yes && node->text != "0" && !absl::EqualsIgnoreCase(node->text, "false")) {
    return fields.Error(kFisheyeField, "is ", Show(*node), ", it must be 0 or 1");
  }
  if (model && yes != (*model == DistortionModel::kFisheye)) {
    return fields.Error(kFisheyeField, "is ", Show(*node), ", but ", kModelField, " is ",
                        std::string(DistortionModelName(*model)));
  }
  if (yes) return DistortionModel::kFisheye;
  return model;
}

bool AllZero(const std::vector<double>& values, size_t begin, size_t end = 14) {
  for (size_t i = begin; i < std::min(end, values.size()); ++i) {
    if (values[i] != 0) return false;
  }
  return true;
}

// The coefficients of OpenCV's projectPoints: k1 k2 p1 p2, k3, k4 k5 k6, s1 to s4, tau x and y.
constexpr size_t kBrown4 = 4, kBrown5 = 5, kRational8 = 8, kThinPrism12 = 12, kTilted14 = 14;

absl::Status ReadDistortion(const LensFields& fields, Intrinsics* intrinsics) {
  RIGCAL_ASSIGN_OR_RETURN(const std::optional<DistortionModel> named, ReadModel(fields));
  // ROS's calibrator once wrote "cols: 5" for all models.
  RIGCAL_ASSIGN_OR_RETURN(
      const LensMatrix matrix,
      fields.Matrix(kDistortionField, named == DistortionModel::kRational ? kRational8 : 0));
  if (matrix.rows() != 1 && matrix.cols() != 1) {
    return fields.Error(kDistortionField, "is ", matrix.rows(), " x ", matrix.cols(),
                        ", not one row or column");
  }
  std::vector<double>& k = intrinsics->distortion;
  k.assign(matrix.data(), matrix.data() + matrix.size());
  const size_t count = k.size();
  const bool opencv_count = count == kBrown4 || count == kBrown5 || count == kRational8 ||
                            count == kThinPrism12 || count == kTilted14;
  if (!named && !opencv_count) {
    return fields.Error(kDistortionField, "has ", count,
                        " values; OpenCV's models have 4, 5, 8, 12 or 14");
  }
  if (named != DistortionModel::kFisheye && opencv_count && !AllZero(k, kRational8)) {
    const bool tilted = !AllZero(k, kThinPrism12);
    return fields.Error(kDistortionField, "has ", count, " values, the ",
                        tilted ? "last ones" : "9th to 12th", " not 0: ",
                        "thin prism or tilted sensor, not supported; calibrate this camera without "
                        "CALIB_THIN_PRISM_MODEL and CALIB_TILTED_MODEL");
  }
  intrinsics->model =
      named.value_or(count >= kRational8 && !AllZero(k, kBrown5) ? DistortionModel::kRational
                                                                 : DistortionModel::kBrownConrady);
  if (intrinsics->model == DistortionModel::kBrownConrady && count == kBrown4) {
    k.push_back(0);  // OpenCV's short form, without k3
  }
  const size_t expected = static_cast<size_t>(CoefficientCount(intrinsics->model));
  const bool zero_tail = k.size() > expected && AllZero(k, expected);
  if (k.size() != expected && !(zero_tail && count <= kTilted14)) {
    return fields.Error(kDistortionField, "has ", count, " values, ",
                        std::string(DistortionModelName(intrinsics->model)), " has ", expected);
  }
  k.resize(expected);
  return absl::OkStatus();
}

absl::Status ReadPose(const LensFields& fields, const std::string& path, ImportedCamera* camera) {
  if (fields.Find(kPoseField) == nullptr) return absl::OkStatus();
  RIGCAL_ASSIGN_OR_RETURN(const LensMatrix pose, fields.Matrix(kPoseField));
  if ((pose.rows() != 3 && pose.rows() != 4) || pose.cols() != 4) {
    return fields.Error(kPoseField, "is ", pose.rows(), " x ", pose.cols(), ", not 3 x 4 or 4 x 4");
  }
  if (pose.rows() == 4 && pose.row(3) != Eigen::RowVector4d(0, 0, 0, 1)) {
    return fields.Error(kPoseField, "has a last row that is not 0 0 0 1; is it transposed?");
  }
  const absl::StatusOr<Eigen::Quaterniond> rotation = RotationFrom(pose.topLeftCorner<3, 3>());
  if (!rotation.ok()) {
    return ImportError(path, fields.Find(kPoseField)->line,
                       absl::StrCat(kPoseField, ": ", std::string(rotation.status().message())));
  }
  camera->cam_from_rig = RigidTransform(*rotation, pose.topRightCorner<3, 1>());
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<ImportedCamera> LensCameraOf(const std::string& path, const LensNode& root) {
  if (root.kind != LensNode::Kind::kMap) {
    return ImportError(path, root.line,
                       "has no fields (image_width, camera_matrix, ...); is it a file of a lens?");
  }
  const LensFields fields(path, root);
  ImportedCamera camera;
  // ROS's camera_name is often another than the camera's file is called by.
  camera.name = std::filesystem::path(path).stem().string();
  camera.name = CameraNameFrom(std::string(absl::StripSuffix(camera.name, ".camera_info")));
  if (const LensNode* const name = fields.Find("camera_name")) camera.other_name = name->text;
  RIGCAL_ASSIGN_OR_RETURN(camera.image_size_px.width, fields.ImageSide(kWidthField));
  RIGCAL_ASSIGN_OR_RETURN(camera.image_size_px.height, fields.ImageSide(kHeightField));
  RIGCAL_RETURN_IF_ERROR(ReadCameraMatrix(fields, &camera.intrinsics));
  RIGCAL_RETURN_IF_ERROR(ReadDistortion(fields, &camera.intrinsics));
  const absl::Status valid = camera.intrinsics.Validate(camera.image_size_px);
  if (!valid.ok()) return fields.Error(kMatrixField, std::string(valid.message()));
  RIGCAL_RETURN_IF_ERROR(ReadPose(fields, path, &camera));
  RIGCAL_RETURN_IF_ERROR(CheckImported(path, 0, camera));
  return camera;
}

}  // namespace rigcal
