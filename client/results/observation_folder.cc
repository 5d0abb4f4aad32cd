// SPDX-License-Identifier: Apache-2.0
#include "client/results/observation_folder.h"

#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/camera/camera_export.h"
#include "common/file/durable_file.h"
#include "common/file/may_write.h"
#include "common/status/status_macros.h"
#include "common/wire/camera_wire.h"

namespace rigcal::client {
namespace {

namespace fs = std::filesystem;

void AppendRows(const ObservationBatch& batch, std::string* text) {
  for (size_t row = 0; row < batch.rows(); ++row) {
    absl::StrAppend(text, batch.time_ns[row]);
    for (uint32_t m = 0; m < batch.marker_count; ++m) {
      const size_t i = row * batch.marker_count + m;
      if (batch.IsVisible(row, m)) {
        absl::StrAppendFormat(text, ";%.9g;%.9g", batch.x_px[i], batch.y_px[i]);
      } else {
        absl::StrAppend(text, ";-1;-1");
      }
    }
    *text += '\n';
  }
}

bool HasSphereCentres(const ObservationBatch& batch) {
  for (const uint8_t kind : batch.centre_kind) {
    if (kind == static_cast<uint8_t>(CentreKind::kSphereCentre)) return true;
  }
  return false;
}

}  // namespace

absl::Status ObservationFolder::Begin(const std::vector<v1::CameraDescription>& cameras) {
  for (const v1::CameraDescription& camera : cameras) {
    for (const char* const end : {".csv", ".yaml"}) {
      RIGCAL_RETURN_IF_ERROR(CheckMayWrite(folder_ / (camera.camera() + end), replace_));
    }
  }
  std::error_code error;
  fs::create_directories(folder_, error);
  if (error || !fs::is_directory(folder_, error)) {
    return absl::FailedPreconditionError(
        absl::StrCat("cannot make the folder ", folder_.string(), ": ",
                     error ? error.message() : "there is something else of that name"));
  }
  for (const v1::CameraDescription& camera : cameras) {
    if (!camera.has_intrinsics()) {
      notes_.push_back(absl::StrCat("camera ", camera.camera(), " has no intrinsics: put ",
                                    (folder_ / (camera.camera() + ".yaml")).string(),
                                    " beside its rows"));
      continue;
    }
    CameraExport file{.camera = camera.camera(),
                      .image_size_px = wire::FromProto(camera.image_size_px()),
                      .intrinsics = {},
                      .cam_from_rig = {}};
    RIGCAL_ASSIGN_OR_RETURN(file.intrinsics, wire::FromProto(camera.intrinsics()));
    RIGCAL_ASSIGN_OR_RETURN(const std::string text, CameraExportText(file));
    files_.push_back(folder_ / (camera.camera() + ".yaml"));
    RIGCAL_RETURN_IF_ERROR(WriteOutputFile(files_.back(), text));
  }
  return absl::OkStatus();
}

absl::Status ObservationFolder::Add(const ObservationBatch& batch) {
  if (batch.stream.camera != camera_) {
    RIGCAL_RETURN_IF_ERROR(Finish());
    camera_ = batch.stream.camera;
  }
  AppendRows(batch, &rows_);
  if (!has_sphere_centres_ && HasSphereCentres(batch)) {
    has_sphere_centres_ = true;
    notes_.push_back(
        "the rows hold the centres of the spheres, not of their images: give no diameter with them "
        "(a --target without diameter=, triangulate --diameter 0)");
  }
  return absl::OkStatus();
}

absl::Status ObservationFolder::Finish() {
  if (camera_.empty()) return absl::OkStatus();
  files_.push_back(folder_ / (std::exchange(camera_, "") + ".csv"));
  return WriteOutputFile(files_.back(), std::exchange(rows_, ""));
}

}  // namespace rigcal::client
