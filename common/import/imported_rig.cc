// SPDX-License-Identifier: Apache-2.0
#include "common/import/imported_rig.h"

#include <Eigen/LU>
#include <Eigen/SVD>
#include <set>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "common/status/fault_list.h"
#include "common/status/validate_name.h"

namespace rigcal {
namespace {

// Files have 4 to 6 digits at least.
constexpr double kOrthonormalWithin = 1e-3;
constexpr size_t kMaxNameLetters = 64;

}  // namespace

void ImportedRig::Add(const std::string& name, absl::StatusOr<ImportedCamera> camera) {
  if (camera.ok()) {
    cameras.push_back(*std::move(camera));
  } else {
    left_out.push_back({name, std::string(camera.status().message())});
  }
}

absl::Status ImportError(const std::string& path, int line, const std::string& why) {
  if (line <= 0) return absl::InvalidArgumentError(absl::StrCat(path, ": ", why));
  return absl::InvalidArgumentError(absl::StrCat(path, ", line ", line, ": ", why));
}

absl::Status CheckText(const std::string& path, const std::string& text) {
  int line = 1;
  for (const char letter : text) {
    const unsigned char byte = static_cast<unsigned char>(letter);
    if ((byte < 0x20 && letter != '\n' && letter != '\r' && letter != '\t') || byte == 0x7f) {
      return ImportError(path, line,
                         absl::StrCat("byte 0x", absl::Hex(byte, absl::kZeroPad2), " is not text"));
    }
    if (letter == '\n') ++line;
  }
  return absl::OkStatus();
}

absl::Status CheckText(const std::string& path, const std::string& text, NestedFormat format) {
  RIGCAL_RETURN_IF_ERROR(CheckText(path, text));
  const std::optional<int> line = LineNestedTooDeep(format, text);
  return line ? ImportError(path, *line, kNestedTooDeep) : absl::OkStatus();
}

absl::StatusOr<Eigen::Quaterniond> RotationFrom(const Eigen::Matrix3d& matrix) {
  if (!matrix.allFinite()) return absl::InvalidArgumentError("the rotation is not finite");
  const double off =
      (matrix * matrix.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  if (off > kOrthonormalWithin) {
    return absl::InvalidArgumentError(
        absl::StrCat("the rotation is no rotation: its rows are not orthonormal, by ", off));
  }
  if (matrix.determinant() < 0) {
    return absl::InvalidArgumentError(
        "the rotation is mirrored (its determinant is -1): the axes of the file are left-handed");
  }
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(matrix, Eigen::ComputeFullU | Eigen::ComputeFullV);
  return Eigen::Quaterniond(Eigen::Matrix3d(svd.matrixU() * svd.matrixV().transpose()));
}

absl::Status CheckImported(const std::string& path, int line, const ImportedCamera& camera) {
  FaultList faults;
  faults.Add(ValidateName("camera name", camera.name));
  faults.Add(camera.image_size_px.Validate());
  faults.Add(camera.intrinsics.Validate(camera.image_size_px));
  if (camera.cam_from_rig && !camera.cam_from_rig->Matrix().allFinite()) {
    faults.Add("its pose is not finite");
  }
  const absl::Status status = faults.Result();
  return status.ok() ? status : ImportError(path, line, std::string(status.message()));
}

absl::Status CheckNames(const std::string& path, const ImportedRig& rig) {
  if (rig.cameras.empty() && !rig.left_out.empty()) {
    return absl::InvalidArgumentError(rig.left_out.front().why);
  }
  if (rig.cameras.empty()) return ImportError(path, 0, "has no cameras");
  std::set<std::string> names;
  for (const ImportedCamera& camera : rig.cameras) {
    if (names.insert(camera.name).second) continue;
    return ImportError(path, 0, absl::StrCat("has two cameras ", camera.name));
  }
  return absl::OkStatus();
}

std::string CameraNameFrom(std::string text) {
  for (char& letter : text) {
    const bool good = absl::ascii_isalnum(static_cast<unsigned char>(letter)) || letter == '_' ||
                      letter == '-' || letter == '.';
    if (!good) letter = '_';
  }
  if (text.starts_with('.')) text[0] = '_';
  return text.substr(0, kMaxNameLetters);
}

}  // namespace rigcal
