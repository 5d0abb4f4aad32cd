// SPDX-License-Identifier: Apache-2.0
#include "agent/offer/chosen_cameras.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/file/durable_file.h"
#include "common/file/private_folder.h"
#include "common/status/status_macros.h"
#include "common/status/validate_name.h"
#include "common/text/nesting.h"

namespace rigcal::agent {
namespace {

constexpr char kChosenFile[] = "cameras.json";
constexpr char kLensFolder[] = "lenses";

absl::Status Damaged(const std::filesystem::path& path, std::string_view why) {
  return absl::DataLossError(absl::StrCat(
      path.string(), " is damaged: ", std::string(why),
      "; restore it, or remove it and choose the cameras again with rigcal cameras use"));
}

absl::StatusOr<std::vector<ChosenCamera>> ParseChosen(const std::string& text) {
  std::vector<ChosenCamera> cameras;
  try {
    const auto file = ParseJson<nlohmann::json>(text);
    for (const auto& entry : file.at("cameras")) {
      cameras.push_back({.device = entry.at("device").get<std::string>(),
                         .kind = entry.at("kind").get<std::string>(),
                         .source = entry.at("source").get<std::string>(),
                         .camera = entry.at("camera").get<std::string>(),
                         .vendor = entry.at("vendor").get<std::string>(),
                         .model = entry.at("model").get<std::string>(),
                         .has_lens = entry.at("has_lens").get<bool>()});
    }
  } catch (const nlohmann::json::exception&) {
    return absl::InvalidArgumentError("it is not what this program writes");
  }
  for (auto camera = cameras.begin(); camera != cameras.end(); ++camera) {
    // A name is part of the path of the lens.
    RIGCAL_RETURN_IF_ERROR(ValidateName("camera", camera->camera));
    const bool repeated = std::any_of(cameras.begin(), camera, [&](const ChosenCamera& other) {
      return other.device == camera->device || other.camera == camera->camera;
    });
    if (repeated) {
      return absl::InvalidArgumentError(absl::StrCat("camera ", camera->camera, " is repeated"));
    }
  }
  return cameras;
}

}  // namespace

absl::StatusOr<ChosenCameras> ChosenCameras::Open(std::filesystem::path folder) {
  ChosenCameras chosen(std::move(folder));
  const std::filesystem::path path = chosen.folder_ / kChosenFile;
  const absl::StatusOr<std::string> text = ReadSmallFile(path);
  if (absl::IsNotFound(text.status())) return chosen;
  RIGCAL_RETURN_IF_ERROR(text.status());
  auto cameras = ParseChosen(*text);
  if (!cameras.ok()) return Damaged(path, std::string(cameras.status().message()));
  chosen.cameras_ = *std::move(cameras);
  return chosen;
}

const ChosenCamera* ChosenCameras::FindDevice(std::string_view device) const {
  const auto found = std::ranges::find(cameras_, device, &ChosenCamera::device);
  return found == cameras_.end() ? nullptr : &*found;
}

const ChosenCamera* ChosenCameras::FindCamera(std::string_view camera) const {
  const auto found = std::ranges::find(cameras_, camera, &ChosenCamera::camera);
  return found == cameras_.end() ? nullptr : &*found;
}

absl::Status ChosenCameras::Add(ChosenCamera camera) {
  if (const ChosenCamera* const same = FindDevice(camera.device)) {
    return absl::AlreadyExistsError(
        absl::StrCat("device ", same->device, " is camera ", same->camera));
  }
  if (FindCamera(camera.camera) != nullptr) {
    return absl::AlreadyExistsError(absl::StrCat("there is a camera ", camera.camera));
  }
  std::vector<ChosenCamera> cameras = cameras_;
  cameras.push_back(std::move(camera));
  return Save(std::move(cameras));
}

absl::Status ChosenCameras::Remove(const std::string& camera) {
  std::vector<ChosenCamera> cameras = cameras_;
  if (std::erase_if(cameras, [&](const auto& one) { return one.camera == camera; }) == 0) {
    return absl::NotFoundError(absl::StrCat("no camera ", camera, " was chosen"));
  }
  RIGCAL_RETURN_IF_ERROR(Save(std::move(cameras)));
  RemoveLens(camera);
  return absl::OkStatus();
}

absl::Status ChosenCameras::Save(std::vector<ChosenCamera> cameras) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const ChosenCamera& camera : cameras) {
    list.push_back({{"device", camera.device},
                    {"kind", camera.kind},
                    {"source", camera.source},
                    {"camera", camera.camera},
                    {"vendor", camera.vendor},
                    {"model", camera.model},
                    {"has_lens", camera.has_lens}});
  }
  const nlohmann::ordered_json file = {{"cameras", std::move(list)}};
  RIGCAL_RETURN_IF_ERROR(WriteDurableFile(
      folder_ / kChosenFile,
      file.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n"));
  cameras_ = std::move(cameras);
  return absl::OkStatus();
}

absl::Status ChosenCameras::WriteLens(const std::string& camera, std::string_view yaml) const {
  RIGCAL_RETURN_IF_ERROR(MakePrivateFolder(folder_ / kLensFolder));
  return WriteDurableFile(LensPath(camera), yaml);
}

void ChosenCameras::RemoveLens(const std::string& camera) const {
  std::error_code ignored;  // it is of no camera any more, and the next one replaces it
  std::filesystem::remove(LensPath(camera), ignored);
}

std::filesystem::path ChosenCameras::LensPath(const std::string& camera) const {
  return folder_ / kLensFolder / (camera + ".yaml");
}

}  // namespace rigcal::agent
