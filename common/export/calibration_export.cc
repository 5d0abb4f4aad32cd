// SPDX-License-Identifier: Apache-2.0
#include "common/export/calibration_export.h"

#include <google/protobuf/util/json_util.h>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"
#include "common/export/format_writers.h"
#include "common/export/lens_refit.h"
#include "common/export/rig_model.h"
#include "common/status/status_macros.h"

namespace rigcal {
namespace {

// Of a writer, from the calibration instead of the neutral model.
template <ExportFiles (*kWrite)(const ExportedRig&), LensRange kRange = LensRange::kAll,
          const char* kProgram = nullptr, bool kLensesAlone = false>
ExportFiles Make(const v1::Calibration& calibration, const ExportOptions& options,
                 std::vector<LensNote>* notes) {
  RIGCAL_ASSIGN_OR_RETURN(ExportedRig rig, RigOf(calibration));
  if (!rig.has_poses && !kLensesAlone) {
    return absl::FailedPreconditionError(absl::StrCat(
        calibration.id(), " has lenses and no poses, which this format needs; use opencv or ros"));
  }
  rig.up = options.up;
  RIGCAL_RETURN_IF_ERROR(RefitLenses(kRange, kProgram, options.max_error_px, &rig));
  for (const ExportedCamera& camera : rig.cameras) {
    if (notes == nullptr || camera.refit_error_px == 0) continue;
    notes->push_back({camera.name, camera.refit_error_px});
  }
  return kWrite(rig);
}

constexpr char kKalibrProgram[] = "kalibr";
constexpr char kNerfstudioProgram[] = "nerfstudio";
constexpr char kOpenMvgProgram[] = "OpenMVG";
constexpr char kBlenderProgram[] = "Blender";
constexpr char kUsdProgram[] = "USD";

absl::StatusOr<std::vector<ExportFile>> MakeJson(const v1::Calibration& calibration,
                                                 const ExportOptions&, std::vector<LensNote>*) {
  RIGCAL_RETURN_IF_ERROR(CheckHasResult(calibration));
  google::protobuf::util::JsonPrintOptions options;
  options.add_whitespace = true;
  options.always_print_primitive_fields = true;
  options.preserve_proto_field_names = true;
  std::string text;
  if (const auto status = google::protobuf::util::MessageToJsonString(calibration, &text, options);
      !status.ok()) {
    return absl::DataLossError(absl::StrCat("calibration ", calibration.id(),
                                            " cannot be written as JSON: ", status.ToString()));
  }
  if (!text.ends_with('\n')) text += '\n';
  return std::vector<ExportFile>{{"calibration.json", std::move(text)}};
}

constexpr char kYaml[] = "application/yaml";
constexpr char kTomlType[] = "application/toml";
constexpr char kJsonType[] = "application/json";
constexpr char kText[] = "text/plain";
constexpr char kBinary[] = "application/octet-stream";

constexpr CalibrationExportFormat kFormats[] = {
    {"opencv",
     "one FileStorage YAML per camera (camera_matrix, distortion_coefficients, extrinsics: "
     "cam_from_rig 4x4 in metres, reprojection_error; line_delay of a rolling shutter)",
     kYaml, true, &Make<&WriteOpenCvYaml, LensRange::kAll, nullptr, true>},
    {"json", "the whole calibration", kJsonType, false, &MakeJson},
    {"kalibr",
     "camchain with clock offsets; lenses as radtan or equidistant, refitted where they are others",
     kYaml, false, &Make<&WriteKalibr, LensRange::kRadtan, kKalibrProgram>},
    {"ros", "camera_info per camera, static transforms as launch files of ROS 1 and 2", kText, true,
     &Make<&WriteRos, LensRange::kAll, nullptr, true>},
    {"colmap", "model as text, first pixel centre (0.5, 0.5)", kText, false,
     &Make<&WriteColmapText>},
    {"colmap-binary", "the same as binary files", kBinary, false, &Make<&WriteColmapBinary>},
    {"nerfstudio", "transforms.json with OpenGL's axes; rational lenses are refitted", kJsonType,
     false, &Make<&WriteNerfstudio, LensRange::kNoRational, kNerfstudioProgram>},
    {"anipose", "calibration.toml", kTomlType, false, &Make<&WriteAnipose>},
    {"pose2sim", "calibration TOML; no fisheye lens", kTomlType, false, &Make<&WritePose2Sim>},
    {"caliscope", "camera_array.toml; cameras are numbered there", kTomlType, false,
     &Make<&WriteCaliscope>},
    {"mcap", "Foxglove's CameraCalibration and FrameTransforms", kBinary, false, &Make<&WriteMcap>},
    {"mrcal", "a .cameramodel per camera; no fisheye lens", kText, true,
     &Make<&WriteMrcal, LensRange::kAll, nullptr, true>},
    {"openmvg", "sfm_data.json; lenses are refitted to one focal length", kJsonType, false,
     &Make<&WriteOpenMvg, LensRange::kOneFocal, kOpenMvgProgram>},
    {"matlab", "MAT-file of level 5 with a struct array, first pixel centre (1, 1)", kBinary, false,
     &Make<&WriteMatlab>},
    {"blender", "Python script that adds the cameras; no lens distortion", kText, false,
     &Make<&WriteBlender, LensRange::kPinhole, kBlenderProgram>},
    {"usd", "cameras as a text file of USD; no lens distortion", kText, false,
     &Make<&WriteUsd, LensRange::kPinhole, kUsdProgram>},
};

// "calibration.json" -> ".json"
std::string_view ExtensionOf(std::string_view name) {
  const size_t dot = name.rfind('.');
  return dot == std::string_view::npos ? std::string_view() : name.substr(dot);
}

}  // namespace

absl::Status CheckHasResult(const v1::Calibration& calibration) {
  if (calibration.state() == v1::Calibration::STATE_SUCCEEDED) return absl::OkStatus();
  const std::string& name = v1::Calibration::State_Name(calibration.state());
  std::string message = absl::StrCat("calibration ", calibration.id(), " has no result: it is ",
                                     absl::AsciiStrToLower(absl::StripPrefix(name, "STATE_")));
  if (!calibration.error().empty()) absl::StrAppend(&message, " (", calibration.error(), ")");
  return absl::FailedPreconditionError(message);
}

std::span<const CalibrationExportFormat> CalibrationExportFormats() { return kFormats; }

absl::StatusOr<const CalibrationExportFormat*> FindCalibrationExportFormat(std::string_view name) {
  std::string names;
  for (const CalibrationExportFormat& format : kFormats) {
    if (format.name == name) return &format;
    absl::StrAppend(&names, names.empty() ? "" : ", ", format.name);
  }
  return absl::InvalidArgumentError(
      absl::StrCat("there is no such format of exports; the formats are: ", names));
}

absl::StatusOr<ExportDownload> MakeDownload(const CalibrationExportFormat& format,
                                            const v1::Calibration& calibration,
                                            std::string_view variant,
                                            const ExportOptions& options) {
  RIGCAL_ASSIGN_OR_RETURN(std::vector<ExportFile> files, format.make(calibration, options));
  const std::string base = absl::StrCat(calibration.id(), "-", format.name,
                                        absl::string_view(variant.data(), variant.size()));
  if (files.size() == 1) {
    const std::string_view extension = ExtensionOf(files.front().name);
    return ExportDownload{base + std::string(extension), format.content_type,
                          std::move(files.front().content)};
  }
  RIGCAL_ASSIGN_OR_RETURN(std::string zip, ZipOf(files));
  return ExportDownload{base + ".zip", "application/zip", std::move(zip)};
}

}  // namespace rigcal
