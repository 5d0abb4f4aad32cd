// SPDX-License-Identifier: Apache-2.0
#include "agent/command/frame_input.h"

#include <algorithm>
#include <filesystem>
#include <system_error>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "agent/capture/recorded/image_file.h"
#include "common/config/agent_config.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

namespace fs = std::filesystem;

bool IsSpec(const std::string& text) {
  const size_t equals = text.find('=');
  const std::string behind_name = equals == std::string::npos ? "" : text.substr(equals + 1);
  return std::any_of(kSourceKindNames.begin(), kSourceKindNames.end(), [&](const auto& kind) {
    return text.starts_with(kind.prefix) || behind_name.starts_with(kind.prefix);
  });
}

// A path that has no calibration beside it needs none for detecting.
std::string SpecOfPath(const FrameInput& input) {
  const fs::path path(input.input);
  std::error_code error;
  const bool is_images = fs::is_directory(path, error) || IsImageName(input.input);
  fs::path name = path.has_filename() ? path : path.parent_path();
  std::string camera = name.stem().string();
  // A file's name may hold what a camera's name may not.
  for (char& c : camera) {
    if (!absl::ascii_isalnum(static_cast<unsigned char>(c)) && c != '_' && c != '-') c = '_';
  }
  if (camera.empty()) camera = "camera";
  const bool has_calibration = fs::exists(name.replace_extension(".yaml"), error);
  return absl::StrCat(camera.substr(0, 64), is_images ? "=images:" : "=video:", input.input,
                      has_calibration || !input.calibration.empty() ? "" : ";calibration=none");
}

absl::StatusOr<std::vector<SourceOption>> Typed(const FrameInput& input) {
  std::vector<std::string> texts = input.settings;
  if (!input.calibration.empty()) texts.push_back("calibration=" + input.calibration);
  if (!input.fps.empty()) texts.push_back("fps=" + input.fps);
  RIGCAL_ASSIGN_OR_RETURN(SourceOptions options, SourceOptions::Split(texts));
  return options.TakeRest();
}

absl::StatusOr<SourceSpec> FromConfig(const FrameInput& input,
                                      const std::vector<SourceOption>& typed) {
  RIGCAL_ASSIGN_OR_RETURN(const AgentConfig config, ReadAgentConfig(input.config));
  std::vector<std::string> names;
  for (CameraConfig camera : config.cameras) {
    for (const SourceOption& option : typed) camera.options.push_back(option);
    RIGCAL_ASSIGN_OR_RETURN(SourceSpec spec, ParseSourceSpec(camera));
    names.push_back(CameraNameOf(spec));
    if (names.back() == input.camera || (input.camera.empty() && config.cameras.size() == 1)) {
      return spec;
    }
  }
  return absl::InvalidArgumentError(
      absl::StrCat(input.config, " has no camera \"", input.camera, "\"; say --camera ",
                   names.empty() ? "NAME" : absl::StrJoin(names, " or ")));
}

}  // namespace

void AddPictureInput(CLI::App& command, FrameInput* input) {
  command.add_option("INPUT", input->input,
                     "A picture, a folder of pictures, a video, or a SPEC as for --source");
  command.add_option("--config", input->config, "Instead of INPUT: TOML file of an agent ...");
  command.add_option("--camera", input->camera, "... and which of its cameras");
  command.add_option("--calibration", input->calibration,
                     "OpenCV YAML of the camera [the same path with .yaml, if it is there]");
  command.add_option("--fps", input->fps, "Pictures per second where they have no times");
  command.add_option("--set", input->settings,
                     "KEY=VALUE of the source or the detector, as in a SPEC; repeatable");
}

absl::StatusOr<FrameSourceSpec> ResolvePictureInput(const FrameInput& input) {
  if (input.input.empty() == input.config.empty()) {
    return absl::InvalidArgumentError(
        "say which pictures: a file, a folder or a SPEC, or --config FILE --camera NAME");
  }
  RIGCAL_ASSIGN_OR_RETURN(std::vector<SourceOption> typed, Typed(input));
  if (!input.config.empty()) {
    RIGCAL_ASSIGN_OR_RETURN(SourceSpec spec, FromConfig(input, typed));
    if (auto* pictures = std::get_if<FrameSourceSpec>(&spec)) return std::move(*pictures);
    return absl::InvalidArgumentError(
        absl::StrCat("camera ", CameraNameOf(spec), " of ", input.config, " yields no pictures"));
  }
  const bool is_path = !IsSpec(input.input);
  if (std::error_code error; is_path && !fs::exists(input.input, error)) {
    return absl::NotFoundError(absl::StrCat("there is no file or folder ", input.input));
  }
  // A file is no camera: nobody waits for its pace.
  const bool says_speed = std::any_of(typed.begin(), typed.end(),
                                      [](const SourceOption& o) { return o.key == "speed"; });
  if (is_path && !says_speed) typed.push_back({.key = "speed", .value = "max", .where = ""});
  RIGCAL_ASSIGN_OR_RETURN(SourceSpec spec,
                          ParseSourceSpec(is_path ? SpecOfPath(input) : input.input, typed));
  if (auto* pictures = std::get_if<FrameSourceSpec>(&spec)) return std::move(*pictures);
  return absl::InvalidArgumentError(
      absl::StrCat(input.input, " yields no pictures; a simulated camera does with ;pixels=1"));
}

}  // namespace rigcal::agent
