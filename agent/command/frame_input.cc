// SPDX-License-Identifier: Apache-2.0
#include "agent/command/frame_input.h"

#include <algorithm>
#include <filesystem>
#include <system_error>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "agent/capture/image_file.h"
#include "agent/capture/registry/source_registry.h"
#include "common/config/agent_config.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

namespace fs = std::filesystem;

bool IsEventFileName(const std::string& name) {
  const std::string ending = absl::AsciiStrToLower(fs::path(name).extension().string());
  return ending == ".raw" || ending == ".h5" || ending == ".hdf5" || ending == ".csv";
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
  const char* const kind = is_images                      ? "=images:"
                           : IsEventFileName(input.input) ? "=raw:"
                                                          : "=video:";
  return absl::StrCat(camera.substr(0, 64), kind, input.input,
                      has_calibration || !input.calibration.empty() ? "" : ";calibration=none");
}

absl::StatusOr<std::unique_ptr<SourceSpec>> FromConfig(const FrameInput& input,
                                                       const std::vector<OptionText>& typed) {
  RIGCAL_ASSIGN_OR_RETURN(const AgentConfig config, ReadAgentConfig(input.config));
  std::vector<std::string> names;
  for (CameraConfig camera : config.cameras) {
    camera.options.insert(camera.options.end(), typed.begin(), typed.end());
    RIGCAL_ASSIGN_OR_RETURN(std::unique_ptr<SourceSpec> spec, ParseSourceSpec(camera));
    names.push_back(spec->camera());
    if (names.back() == input.camera || (input.camera.empty() && config.cameras.size() == 1)) {
      return spec;
    }
  }
  return absl::InvalidArgumentError(
      absl::StrCat(input.config, " has no camera \"", input.camera, "\"; say --camera ",
                   names.empty() ? "NAME" : absl::StrJoin(names, " or ")));
}

absl::StatusOr<std::unique_ptr<FrameSourceSpec>> AsFrames(std::unique_ptr<SourceSpec> spec,
                                                          const std::string& otherwise) {
  auto* const frames = dynamic_cast<FrameSourceSpec*>(spec.get());
  if (frames == nullptr) return absl::InvalidArgumentError(otherwise);
  spec.release();
  return std::unique_ptr<FrameSourceSpec>(frames);
}

}  // namespace

void AddFrameInput(CLI::App& command, FrameInput* input) {
  command.add_option("INPUT", input->input,
                     "An image, a folder of images, a video, or a SPEC as for --source");
  command.add_option("--config", input->config, "Instead of INPUT: TOML file of an agent ...");
  command.add_option("--camera", input->camera, "... and which of its cameras");
  command.add_option("--calibration", input->calibration,
                     "OpenCV YAML of the camera [the same path with .yaml, if it exists]");
  command.add_option("--fps", input->fps, "Frame rate, Hz, if the frames have no times");
  command.add_option("--set", input->settings,
                     "OPTION=VALUE of the source or the detector, as in a SPEC; repeatable");
}

absl::StatusOr<std::unique_ptr<SourceSpec>> ResolveInput(const FrameInput& input) {
  if (input.input.empty() == input.config.empty()) {
    return absl::InvalidArgumentError(
        "name the frames: a file, a folder or a SPEC, or --config FILE --camera NAME");
  }
  std::vector<std::string> texts = input.settings;
  if (!input.calibration.empty()) texts.push_back("calibration=" + input.calibration);
  if (!input.fps.empty()) texts.push_back("fps=" + input.fps);
  RIGCAL_ASSIGN_OR_RETURN(std::vector<OptionText> typed, SplitOptions(texts));
  if (!input.config.empty()) return FromConfig(input, typed);
  const bool is_path = !IsSourceText(input.input);
  if (std::error_code error; is_path && !fs::exists(input.input, error)) {
    return absl::NotFoundError(absl::StrCat("there is no file or folder ", input.input));
  }
  // A file needs no pace.
  if (is_path && std::ranges::find(typed, "speed", &OptionText::key) == typed.end()) {
    typed.push_back({.key = "speed", .value = "max"});
  }
  return ParseSourceSpec(is_path ? SpecOfPath(input) : input.input, typed);
}

absl::StatusOr<std::unique_ptr<FrameSourceSpec>> ResolveFrameInput(const FrameInput& input) {
  RIGCAL_ASSIGN_OR_RETURN(std::unique_ptr<SourceSpec> spec, ResolveInput(input));
  const std::string otherwise =
      input.config.empty()
          ? absl::StrCat(input.input, " yields no frames; a simulated camera does with ;pixels=1")
          : absl::StrCat("camera ", spec->camera(), " of ", input.config, " yields no frames");
  return AsFrames(std::move(spec), otherwise);
}

}  // namespace rigcal::agent
